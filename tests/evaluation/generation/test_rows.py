from dataclasses import replace
from typing import Any

import pytest
import torch
from made_actions import box_actions

from geneoh.evaluation.generation import rows
from geneoh.evaluation.generation.measures import measure_clip
from geneoh.evaluation.generation.rows import (
    chamfer,
    joint_rests,
    nearest_training,
    part_meshes,
    refined,
    refined_clip,
)
from geneoh.generators.text2hoi.learning.samples import ActionData
from geneoh.generators.text2hoi.networks.library import load_text2hoi
from geneoh.generators.text2hoi.physics.jointed import JointedObject
from geneoh.generators.text2hoi.physics.resting import eased, finished
from geneoh.streamed import Streamed


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


def test_clips_that_are_drawn_apart_may_differ_in_length(monkeypatch):
    monkeypatch.setattr(rows, "BATCH", 1)
    clips = box_actions(["lift", "carry"], frames=40, points=256)
    clips = replace(clips, length=torch.tensor([40, 24])).ended()
    data = ActionData(Streamed.of([clips]), ("box", "mug"))
    drawn = rows.draw_clips(load_text2hoi(), data, generator=torch.Generator().manual_seed(0))
    assert drawn.actions.length.tolist() == [40, 24]
    assert drawn.actions.joint.shape == (2, 40)
    assert torch.equal(drawn.actions.wrist, drawn.actions.ended().wrist)


def test_parts_have_closed_meshes_as_large_as_their_points():
    actions = box_actions(["open"], frames=4, points=1024, jointed=True)
    meshes = part_meshes(actions)
    assert len(meshes) == 2
    whole = torch.cat([mesh.verts for mesh in meshes])
    size = actions.points[0].amax(0) - actions.points[0].amin(0)
    assert torch.allclose(whole.amax(0) - whole.amin(0), size, atol=0.01)


def test_an_object_whose_joint_stands_still_is_one_mesh_in_that_state(monkeypatch):
    actions = box_actions(["open"], frames=8, length=6, points=1024, jointed=True)
    still = replace(actions, joint=torch.full_like(actions.joint, 0.5))
    assert not joint_rests(actions)
    assert joint_rests(still)
    asked = []
    monkeypatch.setattr(rows, "refined_parts", lambda clip, verb, seed: asked.append(clip) or clip)
    assert refined_clip(actions, "open", 0) is actions
    found = refined_clip(still, "open", 0)
    assert len(part_meshes(asked[0])) == 2
    assert len(part_meshes(asked[1])) == 1
    torch.testing.assert_close(asked[1].points, still.posed_points()[:, 0])
    for name in ("points", "part", "axis", "joint"):
        torch.testing.assert_close(getattr(found, name), getattr(still, name))


@pytest.mark.parametrize(("verb", "closes"), [("open", False), ("close", True), ("lift", None)])
def test_hands_that_open_or_close_are_brought_to_the_part_as_generate_does(
    monkeypatch, verb, closes
):
    """Before, they went through the cleaner alone, and stayed centimetres deep in the lid."""
    actions = box_actions(["open"], frames=8, length=6, points=1024, jointed=True)
    asked: list[tuple[JointedObject, torch.Generator]] = []

    def finished(jointed, clip, generator):
        asked.append((jointed, generator))
        return clip, ()

    monkeypatch.setattr(JointedObject, "finished", finished)
    found = rows.held(actions, part_meshes(actions), verb, torch.Generator())
    assert found.joint.shape == actions.joint.shape
    assert [jointed.closes for jointed, _ in asked] == ([] if closes is None else [closes])
    for jointed, _ in asked:
        assert jointed.most == pytest.approx(float(actions.joint[actions.valid].max()))
        assert torch.equal(jointed.part, actions.part[0])


def test_refined_clips_keep_their_order_whichever_is_ready_first(monkeypatch):
    actions = box_actions(["press", "inspect"], frames=6, points=64)
    told: list[Any] = []
    monkeypatch.setattr(rows, "refined_clip", lambda clip, verb, seed: told.append(verb) or clip)
    monkeypatch.setattr(rows, "results_of", lambda work, do, **_: reversed([*map(do, work)]))
    verbs = ["poke", "inspect"]  # of recordings, too
    found = refined(actions, verbs, seed=0, on_step=lambda *at: told.append(at))
    assert told == [*verbs, (1, 2), (2, 2)]
    assert torch.equal(found.verb, actions.verb)


@pytest.mark.slow
def test_a_worker_process_refines_a_clip_to_the_bits_of_this_one():
    actions = box_actions(["press"], frames=6, points=256)
    away = 0.2 * actions.hands[:, :, None, None]  # so that only the cleaner has work to do
    actions = replace(actions, wrist=actions.wrist + away)
    there, here = (refined(actions, ["press"], seed=0, jobs=jobs) for jobs in (2, 1))
    for name, value in vars(here).items():
        assert torch.equal(getattr(there, name), value), name


@pytest.mark.slow
def test_refined_hands_are_less_deep_and_the_object_moves_as_before_but_from_rest_to_rest():
    actions = box_actions(["lift"], frames=16, length=12, points=1024)
    shift = torch.tensor([0.07, 0.0, 0.0])
    actions = replace(actions, wrist=actions.wrist + shift * actions.hands[:, :, None, None])
    found = refined(actions, ["lift"], seed=0)
    assert measure_clip(found).depth_mm < 0.8 * measure_clip(actions).depth_mm
    assert torch.equal(found.translation, eased(finished(actions)).translation)
    assert torch.equal(found.wrist[:, 1, 11], found.wrist[:, 1, 15]), "the last frame is repeated"
    assert (found.wrist[:, 0] == 0).all()
