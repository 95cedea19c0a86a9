"""Of several draws one is kept whose hands carry the object, like the others and not deep."""

from dataclasses import replace

import pytest
import torch
from made_actions import box_actions

from geneoh.bundle import concatenated
from geneoh.generators.text2hoi.choosing import (
    COMPARED_AT,
    HANDS,
    MISSED,
    MISSED_SHARE,
    best_draws,
    depth_in_object,
    distances,
    largest_step,
    missed_motion,
    moved_by,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.spheres import hand_spheres

FRAMES = 30
ASIDE = torch.tensor([-1.0, 0.0, 0.0])  # where the fingers of the resting hand point
UP = torch.tensor([0.0, 0.0, 1.0])
RISE = torch.linspace(0, 1, FRAMES)[:, None]


def lifted(height: float = 0.2, aside: float = 0.0):
    """A ball that a right hand lifts, its wrist so far beside the surface, metres."""
    clip = box_actions(["lift"], frames=FRAMES, points=600)
    normals = torch.nn.functional.normalize(clip.points[:, :300] - clip.points.mean(1), dim=-1)
    normals = torch.cat([normals, -normals], 1)
    translation = height * RISE[None] * UP
    wrist = translation + 0.05 * UP + (0.05 + aside) * ASIDE
    return replace(
        clip,
        points=0.05 * normals + 0.05 * UP,
        normals=normals,
        rotation=torch.eye(3).expand(1, FRAMES, 3, 3),
        translation=translation,
        wrist=torch.stack([torch.zeros_like(wrist), wrist], 1),
    )


def draws(*clips):
    return concatenated(list(clips), "B")


def test_a_draw_whose_hands_stay_away_from_what_they_lift_is_not_kept():
    away, held = lifted(aside=0.5), lifted(0.35)
    assert best_draws(draws(away, away, held, away), 4).tolist() == [2]


def test_where_no_hand_carries_the_object_the_one_that_misses_least_is_kept():
    away = lifted(aside=0.5)
    half = replace(away, wrist=torch.where(RISE < 0.4, lifted().wrist, away.wrist))
    assert best_draws(draws(away, half, away), 3).tolist() == [1]


def test_of_the_half_most_like_the_others_the_least_deep_one_is_kept():
    strange, deep, beside = lifted(0.5, aside=0.015), lifted(aside=-0.02), lifted(0.21)
    clips = strange, deep, beside, deep, strange, beside, deep, deep
    assert best_draws(draws(*clips), 4).tolist() == [2, 5]


def test_a_draw_in_which_a_hand_turns_over_within_a_frame_is_not_kept_where_another_carries():
    calm, away = lifted(aside=-0.02), lifted(aside=0.5)
    pose = lifted().pose.clone()
    pose[:, 1, :3, 0, 2] += torch.pi
    turned = replace(lifted(), pose=pose)
    turned_step, lifted_step = largest_step(draws(turned, calm)).tolist()
    assert turned_step > 0.3
    assert lifted_step == pytest.approx(0.2 / (FRAMES - 1), abs=1e-6)
    assert best_draws(draws(turned, calm, turned), 3).tolist() == [1]
    assert best_draws(draws(turned, away, turned), 3).tolist() == [0]


def test_draws_that_do_not_fit_are_not_kept_where_another_one_does():
    clips = draws(lifted(aside=0.001), lifted(), lifted(0.4), lifted(0.19, aside=-0.001))
    fits = torch.tensor([False, True, True, True])
    assert best_draws(clips, 4).tolist() == [0]
    assert best_draws(clips, 4, fits).tolist() == [1]
    assert best_draws(clips, 4, torch.zeros(4, dtype=torch.bool)).tolist() == [0]


def test_an_object_that_is_carried_is_where_it_was_drawn_and_one_that_is_not_stays_behind():
    clips = draws(lifted(), lifted(aside=0.5))
    travel = 0.2 * float(RISE.mean())
    may = MISSED_SHARE * travel + MISSED
    assert missed_motion(clips).tolist() == pytest.approx([-may, travel - may], abs=1e-5)


def test_an_object_has_moved_by_the_farthest_way_of_its_parts():
    assert moved_by(draws(lifted(), lifted(0.003))).tolist() == pytest.approx([0.2, 0.003])
    door = box_actions(["open"], frames=FRAMES, jointed=True)
    still = replace(door, translation=0 * door.translation, rotation=0 * door.rotation)
    still = replace(still, rotation=still.rotation + torch.eye(3))
    assert moved_by(still) > 0.02
    assert moved_by(replace(still, joint=0 * still.joint)) == 0


def test_a_part_that_no_hand_moves_is_missed():
    door = box_actions(["open"], frames=FRAMES, jointed=True)
    moved = replace(door, joint=3 * door.joint, rotation=0 * door.rotation + torch.eye(3))
    apart = replace(moved, wrist=moved.wrist + 9 * ASIDE * moved.hands[:, :, None, None])
    assert missed_motion(apart) > 0


def test_hands_that_come_from_another_side_are_alike_and_objects_that_go_elsewhere_are_not():
    clip = lifted(aside=0.05)
    higher = replace(clip, translation=clip.translation + 0.07 * UP, wrist=clip.wrist + 0.07 * UP)
    turn = axis_angle_to_matrix(torch.pi / 2 * UP)
    pose = clip.pose.clone()
    pose[:, 1, :, 0] = torch.pi / 2 * UP
    plain = replace(clip, pose=clip.pose * (torch.arange(16) > 0)[:, None])
    around = replace(plain, wrist=clip.wrist @ turn.mT, pose=pose)
    tall = replace(clip, rotation=turn @ clip.rotation)
    found = distances(draws(clip, higher, tall, plain, around, plain), 3)
    assert found[0, 0].tolist() == pytest.approx([0, 0.07, COMPARED_AT * 2**0.5 * 2 / 3], abs=1e-6)
    assert found[1].abs().max() < 1e-6
    assert torch.equal(found, found.mT)


def test_hands_that_are_farther_from_the_object_count():
    far = distances(draws(lifted(aside=9.0), lifted(aside=9.1)), 2)
    assert float(far[0, 0, 1]) == pytest.approx(0.1 * HANDS, abs=1e-3)


def test_depth_is_that_of_the_deepest_sphere_of_the_hand_in_the_mean_over_frames():
    clips = draws(lifted(aside=-0.01), lifted(aside=0.0), lifted(aside=0.5))
    centers, radii = hand_spheres(clips.keypoints()[:, 1, 0], torch.ones(3, 1))
    deep = (0.05 + radii - (centers - 0.05 * UP).norm(dim=-1)).amax(1)
    found = depth_in_object(clips)
    torch.testing.assert_close(found[:2], deep[:2], atol=2e-3, rtol=0)
    assert found[2] == 0
    there = replace(clips, length=torch.full((3,), 6))
    torch.testing.assert_close(depth_in_object(there), found, atol=1e-3, rtol=0)
