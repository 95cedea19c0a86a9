from dataclasses import replace

import pytest
import torch

from geneoh.denoisers.candidate_corrections import (
    CANDIDATES,
    LARGEST_CHANGE,
    PAD_DEPTH,
    SMOOTHING_FRAMES,
    candidate_corrections,
    filter_kernels,
    filtered_changes,
    fingers_to_touch,
    whole_hand_to_touch,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.representation.parameters import UNIT, HandParameters

TIPS = list(TIP_KEYPOINTS)


def hands(draw, frames: int, seed: int = 0) -> HandParameters:
    return HandParameters(
        0.05 * draw(2, frames, 3, seed=seed),
        axis_angle_to_matrix(
            0.2 * draw(2, frames, 3, seed=seed + 1) + torch.tensor([0.4, 1, -0.5])
        ),
        0.3 * draw(2, frames, 15, 3, seed=seed + 2),
        load_hand("right").shaped(torch.zeros(2, 10)).offsets,
    )


def still(hand: HandParameters) -> HandParameters:
    wrist, turn, fingers = (
        values[:, :1].expand_as(values) for values in (hand.wrist, hand.turn, hand.fingers)
    )
    return HandParameters(wrist, turn, fingers, hand.offsets)


def surface(hand: HandParameters, gap: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """A surface whose pads' places are `gap` away from the keypoints, and its normals."""
    normals = torch.zeros_like(hand.joints)
    normals[..., 2] = 1.0
    return hand.joints + gap - PAD_DEPTH * normals, normals


def unturned(hand: HandParameters) -> torch.Tensor:
    """A canonical frame that stands in the world."""
    return torch.eye(3).expand_as(hand.turn)


def touching_change(hand, near, normals, rotation=None, frames: float = 0.01) -> torch.Tensor:
    """Both kinds of change together, frame by frame unless `frames` filter them."""
    kernels = filter_kernels(torch.ones(hand.wrist.shape[:2]), (frames,))
    rotation = unturned(hand) if rotation is None else rotation
    whole = whole_hand_to_touch(hand, near, normals, rotation, kernels)[:, 0]
    return whole + fingers_to_touch(hand, near, normals)


def test_there_are_as_many_candidates_as_stated(draw):
    hand = hands(draw, 5)
    got = candidate_corrections(
        hand, torch.ones(2, 5), *surface(hand, torch.zeros(3)), unturned(hand)
    )
    assert got.shape == (2, 5, CANDIDATES, 51)
    assert bool(got.isfinite().all())


@pytest.mark.parametrize("frames", [1, 2])
def test_the_shortest_clips_have_candidates(draw, frames):
    hand = hands(draw, frames)
    near = surface(hand, torch.tensor([0.01, 0, 0]))
    got = candidate_corrections(hand, torch.ones(2, frames), *near, unturned(hand))
    assert bool(got.isfinite().all())


def test_filters_leave_a_hand_that_stands_still(draw):
    hand = still(hands(draw, 5))
    change = filtered_changes(hand, filter_kernels(torch.ones(2, 5), SMOOTHING_FRAMES))
    assert change.shape == (2, len(SMOOTHING_FRAMES), 5, 51)
    assert float(change.abs().max()) < 0.01  # a turn of 1e-3 of a radian is float32's rounding


def test_filters_look_at_trusted_frames_only(draw):
    hand = hands(draw, 5)
    kernels = filter_kernels(torch.tensor([1.0, 1, 0, 1, 1]).expand(2, 5), SMOOTHING_FRAMES)
    wild = hand.wrist + torch.tensor([0.0, 0.0, 0.5, 0.0, 0.0])[:, None]
    plain = filtered_changes(hand, kernels)
    other = filtered_changes(replace(hand, wrist=wild), kernels)
    around = torch.tensor([0, 1, 3, 4])
    # 0.5 m times the least trust of 1e-4 is 0.05 mm, 0.005 units
    torch.testing.assert_close(plain[:, :, around], other[:, :, around], atol=0.01, rtol=0)


def test_a_wide_filter_moves_each_frame_to_the_mean(draw):
    hand = hands(draw, 3)
    goal = hand.moved(filtered_changes(hand, filter_kernels(torch.ones(2, 3), (25.0,)))[:, 0])
    mean = hand.wrist.mean(1, keepdim=True).expand_as(goal.wrist)
    torch.testing.assert_close(goal.wrist, mean, atol=2e-4, rtol=0)
    fingers = hand.fingers.mean(1, keepdim=True).expand_as(goal.fingers)
    torch.testing.assert_close(goal.fingers, fingers, atol=2e-3, rtol=0)


def test_one_candidate_is_flat_fingers(draw):
    hand = still(hands(draw, 4))
    got = candidate_corrections(
        hand, torch.ones(2, 4), *surface(hand, torch.zeros(3)), unturned(hand)
    )
    flat = hand.moved(got[:, :, len(SMOOTHING_FRAMES)])
    torch.testing.assert_close(flat.fingers, torch.zeros_like(flat.fingers), atol=1e-5, rtol=0)
    torch.testing.assert_close(flat.wrist, hand.wrist)


def test_a_hand_that_touches_is_left_where_it_is(draw):
    hand = hands(draw, 3)
    change = touching_change(hand, *surface(hand, torch.zeros(3)))
    assert float(change.abs().max()) < 1e-4


@pytest.mark.parametrize("part", ["whole", "fingers"])
def test_the_hand_and_its_fingers_each_close_most_of_a_gap(draw, part):
    hand = hands(draw, 3)
    # a gap that fingers can close: towards the palm
    gap = -0.008 * hand.turn[:, :, None, :, 1]
    near, normals = surface(hand, gap)
    change = touching_change(hand, near, normals)
    change = change.clone()
    change[..., slice(6, None) if part == "whole" else slice(0, 6)] = 0.0

    def left(moved: HandParameters) -> float:
        return float((near + PAD_DEPTH * normals - moved.joints)[:, :, TIPS].norm(dim=-1).mean())

    assert left(hand) == pytest.approx(0.008, rel=1e-3)
    assert left(hand.moved(change)) < (0.004 if part == "whole" else 0.006)


def test_the_change_moves_with_the_canonical_frame(draw):
    hand = hands(draw, 3)
    near, normals = surface(hand, 0.01 * draw(2, 3, 21, 3, seed=7))
    turn = axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
    other = replace(hand, wrist=hand.wrist @ turn.T, turn=turn @ hand.turn)
    rotation = unturned(hand)
    plain = touching_change(hand, near, normals, rotation, 4.0)
    got = touching_change(other, near @ turn.T, normals @ turn.T, rotation @ turn.T, 4.0)
    torch.testing.assert_close(got[..., :3], plain[..., :3] @ turn.T, atol=1e-4, rtol=0)
    torch.testing.assert_close(got[..., 3:], plain[..., 3:], atol=1e-4, rtol=0)


def test_a_hand_that_is_off_in_the_world_is_brought_back_while_the_object_turns(draw):
    """Each frame tells of one direction, across its surface; together they tell the offset."""
    hand = hands(draw, 30)
    rotation = axis_angle_to_matrix(torch.linspace(0, 2.5, 30)[:, None] * torch.tensor([1.0, 0, 0]))
    rotation = rotation.expand_as(hand.turn)
    offset = torch.tensor([0.0, 0.004, 0.005])
    near, normals = surface(hand, (rotation.mT @ offset)[:, :, None])
    # of the gap only what is across the surface can be seen
    across = ((near + PAD_DEPTH * normals - hand.joints) * normals).sum(-1, keepdim=True)
    near = hand.joints + (across - PAD_DEPTH) * normals
    kernels = filter_kernels(torch.ones(2, 30), (25.0,))
    change = whole_hand_to_touch(hand, near, normals, rotation, kernels)[:, 0]
    moved = (rotation @ (change[..., :3] * UNIT[0])[..., None])[..., 0]
    assert float((moved - offset).norm(dim=-1).mean()) < 0.5 * float(offset.norm())
    still = whole_hand_to_touch(hand, near, normals, unturned(hand), kernels)[:, 0]
    worse = (rotation @ (still[..., :3] * UNIT[0])[..., None])[..., 0]
    assert float((moved - offset).norm(dim=-1).mean()) < float((worse - offset).norm(dim=-1).mean())


def test_absurd_gaps_are_bounded_and_far_ones_hardly_count(draw):
    hand = hands(draw, 3)
    touching = slice(len(SMOOTHING_FRAMES) + 1, None)
    for gap in (0.1, 1.0):
        near = surface(hand, torch.tensor([0.0, 0.0, gap]))
        changes = candidate_corrections(hand, torch.ones(2, 3), *near, unturned(hand))
        assert float(changes[:, :, touching].abs().max()) <= LARGEST_CHANGE
    assert float(changes[:, :, touching, 6:].abs().max()) * UNIT[-1] < 1e-4
