import math
from dataclasses import replace

import pytest
import torch
from made_actions import box_actions

from geneoh.errors import CheckpointError
from geneoh.evaluation.generation.classifier import (
    FRAMES_READ,
    INPUTS,
    ClassifierConfig,
    ClassifierTask,
    classified,
    clip_inputs,
    frames_within,
    inputs_of,
)
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.training.loop import trained
from geneoh.training.processes import Team

QUICK = ClassifierConfig(
    **{"steps": 60, "batch": 16, "width": 16, "rate": 3e-3, "warmup": 5, "ema": 0.9},
    **{"validate_every": 60, "checkpoint_every": 60},
)


def mixed(count: int, seed: int = 0):
    """Half of the boxes rise, the others, with another verb, sink from there."""
    actions = box_actions(["lift", "put down"] * count, frames=16, points=4, seed=seed)
    back = torch.where(
        actions.verb == 0, torch.arange(16)[:, None], torch.arange(16).flip(0)[:, None]
    )
    row = torch.arange(len(actions.verb))
    return replace(
        actions,
        translation=actions.translation[row, back].transpose(0, 1),
        rotation=actions.rotation[row, back].transpose(0, 1),
        wrist=actions.wrist[row, :, back].permute(1, 2, 0, 3),
    )


def test_inputs_are_a_vector_for_each_of_15_frames():
    inputs = clip_inputs(box_actions(["lift", "pass"], frames=20, hands=(True, True)))
    assert inputs.shape == (2, FRAMES_READ, INPUTS)
    assert inputs.isfinite().all()


def test_inputs_of_an_absent_hand_are_zero():
    one = clip_inputs(box_actions(["lift"], frames=20, hands=(False, True)))
    both = clip_inputs(box_actions(["lift"], frames=20, hands=(True, True)))
    differ = one != both
    assert differ.sum() > 0.95 * FRAMES_READ * (2 * 63 + 1)
    assert (one[differ] == 0).all()


def test_first_and_last_frame_are_seen_and_nothing_after_the_end():
    actions = box_actions(["lift"], frames=30, length=20)
    after = replace(actions, translation=actions.translation.clone())
    after.translation[:, 20:] = 9
    assert torch.equal(clip_inputs(actions), clip_inputs(after))
    after.translation[:, 19] = 9
    assert not torch.equal(clip_inputs(actions), clip_inputs(after))


def test_a_drawer_is_seen_to_move_as_far_as_a_lid_that_turns():
    still = box_actions(["open"], frames=20)
    moved = torch.linspace(0, 0.05, 20)[None]  # metres: too little to be seen as it is
    lid = replace(still, joint=10 * moved)  # radians
    drawer = replace(still, joint=moved, slides=~still.slides)
    torch.testing.assert_close(clip_inputs(drawer), clip_inputs(lid))
    assert (clip_inputs(lid) - clip_inputs(still)).abs().max() == 0.5


def test_place_on_the_table_does_not_matter_and_height_does():
    actions = box_actions(["lift"], frames=20)

    def moved(by: list[float]) -> torch.Tensor:
        shift = torch.tensor(by)
        there = actions.hands[:, :, None, None] * shift
        return clip_inputs(
            replace(actions, translation=actions.translation + shift, wrist=actions.wrist + there)
        )

    assert torch.allclose(moved([0.3, -0.2, 0.0]), moved([0, 0, 0]), atol=1e-5)
    assert not torch.allclose(moved([0.0, 0.0, 0.1]), moved([0, 0, 0]), atol=1e-2)


def test_turned_inputs_are_those_of_the_turned_clip():
    actions = box_actions(["lift"], frames=FRAMES_READ, hands=(True, True))
    turn = axis_angle_to_matrix(torch.tensor([[0.0, 0.0, 0.7]]))
    frames = torch.arange(FRAMES_READ)[None]
    pose = actions.pose.clone()
    pose[:, :, :, 0] = matrix_to_axis_angle(turn @ axis_angle_to_matrix(pose[:, :, :, 0]))
    turned = replace(
        actions,
        pose=pose,
        wrist=actions.wrist @ turn.mT,
        translation=actions.translation @ turn.mT,
        rotation=turn[:, None] @ actions.rotation,
    )
    expected = inputs_of(turned, frames)
    assert torch.allclose(inputs_of(actions, frames, turn), expected, atol=1e-4)


def test_random_frames_are_one_of_each_group():
    share = torch.rand(50, FRAMES_READ, generator=torch.Generator().manual_seed(0))
    frames = frames_within(torch.full((50,), 60), share)
    assert torch.equal(frames // 4, torch.arange(FRAMES_READ).expand(50, -1))


def test_random_frames_are_never_behind_the_end():
    last = torch.full((1, FRAMES_READ), 1 - 2**-24)  # the largest share that is drawn
    assert int(frames_within(torch.tensor([60]), last).max()) == 59


def test_classifier_learns_verbs_that_differ_and_is_the_same_again(tmp_path):
    task = ClassifierTask(QUICK, mixed(20), mixed(10, seed=1))
    model = trained(task, tmp_path / "one")
    features, scores = classified(model, task.validation)
    right = (scores.argmax(-1) == task.validation.verb).float().mean()
    assert right > 0.9
    again = trained(task, tmp_path / "two")
    kept = trained(task, tmp_path / "one")
    for other in (again, kept):
        assert torch.equal(classified(other, task.validation)[0], features)


def test_classifier_of_other_clips_is_refused(tmp_path):
    quick = replace(QUICK, steps=1)
    trained(ClassifierTask(quick, mixed(2), mixed(2)), tmp_path)
    with pytest.raises(CheckpointError, match="training data"):
        trained(ClassifierTask(quick, mixed(3), mixed(2)), tmp_path)


def test_batches_depend_on_the_step_alone():
    task = ClassifierTask(QUICK, mixed(20), mixed(2))

    def inputs(step: int) -> torch.Tensor:
        (piece,) = task.pieces(step, Team(), torch.device("cpu"))
        return piece.inputs

    assert torch.equal(inputs(3), inputs(3))
    assert not torch.equal(inputs(3), inputs(4))
    assert math.isclose(float(inputs(3)[..., -2:].max()), 1.0)
