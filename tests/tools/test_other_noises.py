import pytest
import torch
from short_clips import example

import geneoh
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics, rest_offsets
from geneoh.sequence.gaps import filled_keypoints
from geneoh.sequence.sequence import HandTrack
from tools.other_noises import ERRORS, cell, scored

HAND = example().hands[0]


TWISTED = "fingers twisted about their bones"


def erring(name: str, seed: int = 0) -> HandTrack:
    return ERRORS[name](HAND, torch.Generator().manual_seed(seed))


def offsets(name: str) -> torch.Tensor:
    """How far off each keypoint is, metres."""
    assert HAND.joints is not None
    return filled_keypoints(erring(name)) - HAND.joints


@pytest.mark.parametrize("name", [name for name in ERRORS if name not in ("clean", TWISTED)])
def test_every_error_moves_the_hand_by_millimetres_and_depends_on_the_seed_alone(name):
    first, again, other = (filled_keypoints(erring(name, seed)) for seed in (3, 3, 4))
    assert torch.equal(first, again)
    assert not torch.equal(first, other)
    assert 0.002 < float(offsets(name).norm(dim=-1).mean()) < 0.05


def test_the_clean_hand_is_as_it_was():
    assert erring("clean") is HAND


def test_twisted_fingers_have_other_poses_and_the_same_keypoints():
    twisted = erring(TWISTED)
    assert torch.equal(twisted.joints, HAND.joints)
    apart = (twisted.pose - HAND.pose)[:, 1:].norm(dim=-1)
    assert apart.mean() > 0.3
    wrist, skeleton = HAND.joints[:, 0], rest_offsets(*posed(HAND), HAND.trust)
    made, _ = forward_kinematics(posed(twisted)[0], wrist, skeleton)
    was, _ = forward_kinematics(posed(HAND)[0], wrist, skeleton)
    assert (made - was).norm(dim=-1).max() < 1e-5


def posed(hand: HandTrack) -> tuple[torch.Tensor, torch.Tensor]:
    return axis_angle_to_matrix(hand.pose), hand.joints


def test_an_error_of_the_place_leaves_the_fingers():
    off = offsets("place alone, 12 mm, white")
    assert float((off - off[:, :1]).abs().max()) < 1e-5
    assert float(off[:, 0].std()) == pytest.approx(0.012, rel=0.15)


def test_depth_errs_along_one_direction():
    _, sizes, _ = torch.linalg.svd(offsets("place along one ray, 20 mm, white")[:, 0])
    assert float(sizes[0] / sizes[1]) > 5


def test_a_tracker_that_answers_in_every_third_frame_repeats_itself():
    joints = filled_keypoints(erring("every third frame"))
    assert torch.equal(joints[0:3:2], joints[1:2].expand(2, -1, -1))
    assert not torch.equal(joints[2], joints[3])


def test_a_second_is_lost():
    assert int((~erring("a second lost").valid).sum()) == 30


def test_scores_are_millimetres_of_input_filter_and_result():
    clean = example()[60:75]
    error, generator = ERRORS["clean"], torch.Generator().manual_seed(0)
    options = geneoh.Options(preset="fast")
    given, smoothed, result = scored(clean, error, generator, options)
    assert given == 0
    assert 0.5 < smoothed < 20
    assert 0 < result < 8
    # the input is without error, so that every result is farther off than the better one
    shown = f"0.0 / {smoothed:.1f} / {result:.1f} | 100%"
    assert cell("clean", error, [clean], options) == shown
