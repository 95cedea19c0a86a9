from dataclasses import replace

import pytest
import torch
from made_actions import box_actions

from geneoh.evaluation.generation.nearest import chamfer, nearest_training


def test_nearest_training_clip_has_the_verb_and_hands_and_the_nearest_object():
    real = box_actions(["lift"], hands=(True, False))
    training = box_actions(["lift", "pour", "lift", "lift"], hands=(True, False), seed=1)
    training.hands[3] = torch.tensor([True, True])
    training.points[:] = real.points * torch.tensor([1.5, 1.0, 1.1, 1.0])[:, None, None]
    made = nearest_training(real, training)
    assert torch.equal(made.wrist, training.wrist[2:3])
    assert torch.equal(made.translation, training.translation[2:3])
    assert torch.equal(made.points, real.points)
    assert torch.equal(made.verb, real.verb)


def test_without_a_training_clip_of_the_verb_those_of_the_hands_are_searched():
    real = box_actions(["press"], hands=(True, False))
    training = box_actions(["lift", "pour"], hands=(True, False), seed=1)
    training.hands[0] = torch.tensor([True, True])
    assert torch.equal(nearest_training(real, training).wrist, training.wrist[1:])
    neither = replace(training, hands=torch.ones_like(training.hands))
    assert nearest_training(real, neither).hands.all()


def test_an_object_of_the_same_kind_of_joint_is_searched_first():
    real = box_actions(["open"], jointed=True)
    real = replace(real, slides=~real.slides)  # a drawer
    training = box_actions(["open"] * 3, jointed=True, seed=1)
    training = replace(training, slides=torch.tensor([False, True, False]))
    training.points[:] = real.points * torch.tensor([1.0, 1.5, 1.0])[:, None, None]
    assert torch.equal(nearest_training(real, training).wrist, training.wrist[1:2])


def test_a_drawer_that_moves_as_a_lid_did_moves_decimetres_for_radians():
    real, training = (box_actions(["open"], jointed=True, seed=seed) for seed in (0, 1))
    real = replace(real, slides=~real.slides)
    made = nearest_training(real, training)
    torch.testing.assert_close(made.joint, 0.1 * training.joint)
    torch.testing.assert_close(nearest_training(training, real).joint, 10 * real.joint)


def test_chamfer_distance_of_a_shifted_line():
    line = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    found = chamfer(torch.stack([line, line + torch.tensor([0.0, 3, 0])]), line)
    assert found.tolist() == pytest.approx([0, 6])
