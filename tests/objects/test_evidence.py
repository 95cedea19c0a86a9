"""A hand cleaned against an object whose poses are relied on in part."""

from dataclasses import replace

import pytest
import torch

from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.objects.cleaning import clean_object
from geneoh.objects.evidence import (
    CLEAR,
    TOLERATED,
    TOLERATED_BY_RAY,
    UNCLEAR,
    acceleration_around,
    blended,
    doubt,
    evidence_at_hand,
    evidence_of_nearness,
    evidence_of_place,
    evidence_of_poses,
    placed_vertices,
    radius,
)
from geneoh.sequence.sequence import ObjectTrack

FRAMES = 90


def samples(shift: torch.Tensor, count: int = 2) -> torch.Tensor:
    """Samples of a hand of which every keypoint is at `shift`, (T, 3) metres."""
    return shift[None, :, None].expand(count, FRAMES, 21, 3)


ALONE = samples(torch.zeros(FRAMES, 3))
NEAR = torch.ones(FRAMES)
ASIDE = torch.tensor([0.03, 0.0, 0.0]).expand(FRAMES, 3)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_poses_that_count_fully_or_not_at_all_choose_one_of_both(share):
    found = blended(ALONE, samples(ASIDE), torch.full((FRAMES,), share), NEAR, 30.0)
    torch.testing.assert_close(found, share * samples(ASIDE), atol=2e-5, rtol=0)


def test_a_large_shift_that_lasts_is_kept_where_single_frames_are_hardly_relied_on():
    found = blended(ALONE, samples(ASIDE), torch.full((FRAMES,), 0.2), NEAR, 30.0)
    assert (found[:, 20:70, :, 0] > 0.7 * 0.03).all()


def test_a_shift_that_is_smaller_than_the_noise_of_the_poses_counts_as_a_frame_does():
    found = blended(ALONE, samples(0.1 * ASIDE), torch.full((FRAMES,), 0.2), NEAR, 30.0)
    torch.testing.assert_close(found, 0.2 * samples(0.1 * ASIDE))


def test_what_does_not_last_counts_as_a_frame_does():
    shaking = ASIDE * torch.tensor([1.0, -1.0]).repeat(FRAMES // 2)[:, None]
    found = blended(ALONE, samples(shaking), torch.full((FRAMES,), 0.2), NEAR, 30.0)
    torch.testing.assert_close(found, 0.2 * samples(shaking), atol=1e-5, rtol=0)


def test_a_shift_of_frames_that_are_relied_on_lasts_through_those_that_are_not():
    poses = torch.ones(FRAMES)
    poses[40:50] = 0.0
    found = blended(ALONE, samples(ASIDE), poses, NEAR, 30.0)
    assert (found[..., 0] > 0.99 * 0.03).all()


def test_a_hand_that_hardly_deals_with_its_object_hardly_follows_it():
    poses = torch.full((FRAMES,), 0.2)
    whole, part = (blended(ALONE, samples(ASIDE), poses, near * NEAR, 30.0) for near in (1.0, 0.1))
    torch.testing.assert_close(part, 0.1 * whole)


def test_time_is_in_seconds():
    poses = torch.full((FRAMES,), 0.2)
    slow = blended(ALONE, samples(ASIDE), poses, NEAR, 30.0)
    fast = blended(
        *(v.repeat_interleave(2, dim=1) for v in (ALONE, samples(ASIDE))),
        poses.repeat_interleave(2),
        NEAR.repeat_interleave(2),
        60.0,
    )
    torch.testing.assert_close(fast[:, ::2], slow, atol=2e-4, rtol=0)


def track_with_a_gap(bend: float) -> ObjectTrack:
    """A box that accelerates by `bend`, metres per frame², unseen in frames 40 to 49."""
    corners = torch.tensor([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    box = Mesh(0.05 * corners.float(), torch.tensor([[0, 1, 2]]))
    time = torch.arange(FRAMES, dtype=torch.float32)
    translation = torch.stack([0.5 * bend * time**2, 0 * time, 0 * time], -1)[:, None]
    seen = torch.ones(FRAMES, 1, dtype=torch.bool)
    seen[40:50] = False
    return ObjectTrack((box,), torch.eye(3).expand(FRAMES, 1, 3, 3), translation, seen)


def test_poses_that_are_seen_count_however_few_there_are():
    motion = track_with_a_gap(0.0)
    motion = replace(motion, valid=(torch.arange(FRAMES) < FRAMES // 8)[:, None])
    relied = evidence_of_poses(clean_object(motion, 30.0)[1], motion, 30.0)
    assert float(relied[:2].min()) > 0.9
    assert float(relied[FRAMES // 2 :].max()) < 0.01
    never = replace(motion, valid=torch.zeros(FRAMES, 1, dtype=torch.bool))
    assert (evidence_of_poses(clean_object(never, 30.0)[1], never, 30.0) == 1).all()
    error = torch.full((FRAMES, 1), 2 * TOLERATED)
    less = evidence_of_poses(clean_object(motion, 30.0)[1], motion, 30.0, error)
    torch.testing.assert_close(less, relied / 5)


def test_noise_of_the_poses_counts_less_by_a_ray_and_gaps_as_much():
    motion = track_with_a_gap(0.0)
    noise = 0.008 * torch.randn(FRAMES, 1, 3, generator=torch.Generator().manual_seed(0))
    noisy = replace(motion, translation=motion.translation + noise)

    def relied(given, tolerated):
        clean, examined = clean_object(given, 30.0)
        return evidence_of_poses(examined, clean, 30.0, tolerated=tolerated)[:, 0]

    strict, lenient = relied(noisy, TOLERATED), relied(noisy, TOLERATED_BY_RAY)
    assert float(strict[:30].max()) < 0.5
    assert float(lenient[:30].min()) > 0.75
    assert float((lenient / strict)[45]) == pytest.approx(float((lenient / strict)[20]), rel=0.05)
    torch.testing.assert_close(relied(motion, TOLERATED), relied(motion, TOLERATED_BY_RAY))


def test_a_part_that_is_apart_from_the_hand_says_nothing_of_it():
    boxes = track_with_a_gap(0.0).meshes * 2
    places = torch.tensor([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]).expand(4, 2, 3)
    surface = ObjectTrack(boxes, torch.eye(3).expand(4, 2, 3, 3), places).surface()
    relied = torch.tensor([[1.0, 0.0]]).expand(4, 2)
    first, second = (torch.full((4, 21, 3), 0.01) + places[:, part, None] for part in (0, 1))
    assert evidence_at_hand(relied, first, surface).tolist() == [1.0] * 4
    assert evidence_at_hand(relied, second, surface).tolist() == [0.0] * 4
    # without another part, it is the object
    assert evidence_at_hand(relied[:, 1:], first, surface.of_parts([1])).tolist() == [0.0] * 4


def test_poses_over_a_gap_count_less_the_more_the_object_accelerates():
    def least(bend):
        motion, examined = clean_object(track_with_a_gap(bend), 30.0)
        return float(evidence_of_poses(examined, motion, 30.0)[40:50].min())

    assert least(0.0) > 0.6
    assert least(0.0) == pytest.approx(least(1e-5), rel=0.01)
    assert least(0.005) < 0.5 * least(0.0)


def test_the_acceleration_of_a_surface_is_that_of_the_seen_frames_around():
    motion = track_with_a_gap(0.005)
    (mesh,) = motion.meshes
    torch.testing.assert_close(placed_vertices(motion, 0).float(), mesh.verts + motion.translation)
    motion.translation[40:50] = 0
    found = acceleration_around(motion, 0, motion.valid[:, 0].numpy(), 30.0)
    assert found.tolist() == pytest.approx([0.005] * FRAMES, rel=0.01)
    assert radius(mesh) == pytest.approx(3**0.5 * 0.025)


def hand_beside_a_box(distance: torch.Tensor) -> torch.Tensor:
    """How far a hand so far from a box deals with it in each frame."""
    joints = torch.tensor([0.0, 0.0, 0.05]).expand(FRAMES, 21, 3).clone()
    joints[..., 2] += distance[:, None]
    motion = replace(track_with_a_gap(0.0), valid=None)
    return evidence_of_nearness(joints, motion.surface(), 30.0)


def test_a_hand_deals_with_its_object_in_the_frames_in_which_it_is_beside_it():
    distance = torch.cat([torch.full((45,), 0.015), torch.full((45,), 0.5)])
    found = hand_beside_a_box(distance)
    assert (found[:30] > 0.999).all()
    assert (found[44:] < 0.05).all()
    assert (found.diff() <= 0).all()


def beside_a_moving_box(
    away: float, ray: torch.Tensor | None = None, step: float = 0.01
) -> torch.Tensor:
    """How far a hand deals with a box that moves after frame 30, and that it meets at its start."""
    motion = replace(track_with_a_gap(0.0), valid=None)
    path = torch.zeros(FRAMES, 3)
    path[30:, 0] = step * torch.arange(FRAMES - 30)
    motion = replace(motion, translation=path[:, None])
    joints = torch.tensor([0.0, 0.0, 0.05]) + path[:, None].expand(FRAMES, 21, 3)
    joints[30:, :, 2] += away
    return evidence_of_nearness(joints, motion.surface(), 30.0, ray)


def test_a_hand_that_moves_beside_a_moving_object_does_not_deal_with_it():
    assert (beside_a_moving_box(0.015) == 1).all()
    free = beside_a_moving_box(0.06)
    assert (free[50:] == 0).all()
    assert (beside_a_moving_box(0.03)[50:] < 0.7).all()
    assert (beside_a_moving_box(0.06, step=0.002)[30:55] == 1).all()  # slower than what is carried


def test_a_hand_that_errs_along_the_cameras_ray_may_hold_its_object():
    along, across = torch.eye(3)[[2, 0]][:, None].expand(2, FRAMES, 3)
    assert (beside_a_moving_box(0.06, along) == 1).all()
    assert (beside_a_moving_box(0.06, across)[50:] == 0).all()


def beside_a_box_on_a_path(hand: torch.Tensor, box: torch.Tensor) -> torch.Tensor:
    """How far a hand deals with a box where both move along z as given, metres."""
    up = torch.tensor([0.0, 0.0, 1.0])
    motion = replace(track_with_a_gap(0.0), valid=None, translation=box[:, None, None] * up)
    joints = (torch.tensor([0.0, 0.0, 0.05]) + hand[:, None] * up)[:, None].expand(-1, 21, 3)
    return evidence_of_nearness(joints, motion.surface(), 30.0)


def test_a_thrown_object_is_held_before_and_after():
    time = torch.arange(FRAMES) / 30
    swung = 0.05 * (1 - torch.cos(3 * time))
    flight = 4 * ((time - 1.3) * (1.8 - time)).clamp(min=0) / 0.5**2
    found = beside_a_box_on_a_path(swung, swung - 0.4 * flight)
    assert (found[:15] > 0.95).all()
    assert (found[80:] > 0.95).all()
    assert (found[35:58] < 0.05).all()


def test_a_hand_that_an_object_swings_past_does_not_deal_with_it():
    time = torch.arange(FRAMES) / 30
    swung = 0.04 * torch.sin(3 * time)
    assert (beside_a_box_on_a_path(swung, swung) == 1).all()
    assert (beside_a_box_on_a_path(torch.zeros(FRAMES), swung - 0.02)[20:70] < 0.05).all()


def test_a_hand_that_never_comes_near_deals_with_nothing():
    assert (hand_beside_a_box(torch.full((FRAMES,), 0.095)) == 0).all()
    assert (hand_beside_a_box(torch.full((FRAMES,), 0.015)) == 1).all()


def test_a_hand_that_hovers_beside_a_resting_object_deals_with_it_about_a_touch_alone():
    assert (hand_beside_a_box(torch.full((FRAMES,), 0.045)) == 0).all()
    once = torch.full((FRAMES,), 0.045)
    once[:15] = 0.0
    found = hand_beside_a_box(once)
    assert (found[:35] > 0.999).all()
    assert (found[60:] == 0).all()


@pytest.mark.parametrize(
    ("turns", "with_it", "gripped"), [(0.6, False, 0), (0.6, True, 1), (0.25, False, 1)]
)
def test_what_spins_in_the_hand_like_a_wheel_is_not_gripped(turns, with_it, gripped):
    """`turns` in a second, `with_it` where the hand turns as well."""
    angle = 2 * torch.pi * turns * torch.arange(FRAMES) / 30
    rotation = axis_angle_to_matrix(angle[:, None] * torch.tensor([0.0, 0.0, 1.0]))
    motion = replace(track_with_a_gap(0.0), valid=None)
    motion = replace(motion, rotation=rotation[:, None], translation=torch.zeros(FRAMES, 1, 3))
    palm = torch.randn(21, 3, generator=torch.Generator().manual_seed(0))
    joints = 0.03 * palm.expand(FRAMES, 21, 3)
    joints = joints @ rotation.mT if with_it else joints
    assert (evidence_of_nearness(joints, motion.surface(), 30.0) == gripped).all()


def test_a_hand_whose_place_contact_does_not_tell_is_not_at_the_object():
    found = evidence_of_place(torch.tensor([0.0, CLEAR, (CLEAR + UNCLEAR) / 2, UNCLEAR, 1.0]))
    assert found.tolist() == pytest.approx([1.0, 1.0, 0.5, 0.0, 0.0], abs=1e-6)


def test_frames_in_which_the_object_has_less_than_half_its_weight_are_told():
    (sentence,) = doubt(torch.tensor([1.0, 0.4, 0.2, 0.6]))
    assert sentence.startswith("in 2 frames the object is too noisy")
    assert not list(doubt(torch.ones(4)))
