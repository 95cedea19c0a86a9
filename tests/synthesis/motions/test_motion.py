from dataclasses import fields, replace

import pytest
import torch
from draws import seeded
from made_grasps import grasps_at
from torch import Tensor

from geneoh.errors import ConfigError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.bimanual import HandPairs
from geneoh.synthesis.grasping.grasp_types import FINGER_MEAN
from geneoh.synthesis.grasping.grasps import Grasps, Grips
from geneoh.synthesis.motions.hand_motion import HandMotionConfig
from geneoh.synthesis.motions.motion import Interactions, animate
from geneoh.synthesis.motions.object_motion import (
    ObjectMotionConfig,
    Schedule,
    ScheduleConfig,
    Standing,
    carried_path,
    draw_standing,
    held_part,
)
from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.synthesis.shapes.solids import Solids

BATCH, FRAMES, POINTS = 24, 60, 16
CONFIG = ObjectMotionConfig()


def grasps_and_solids() -> tuple[Grasps, Solids]:
    """Hands at some place on boxes; whether they touch is not what moves them."""
    generator = seeded()
    orient = torch.randn(BATCH, 1, 3, generator=generator)
    wrist = 0.1 * torch.randn(BATCH, 3, generator=generator)
    return grasps_at(wrist, orient[:, 0]), draw_objects(["box"] * BATCH, generator=generator)


def interactions(seed: int = 1, frames: int = FRAMES) -> Interactions:
    generator = seeded(seed)
    return animate(*grasps_and_solids(), frames, POINTS, generator=generator)


@pytest.fixture(scope="module")
def made() -> Interactions:
    return interactions()


def object_moves(made: Interactions) -> Tensor:
    """Frame pairs (B, T - 1) in which the object moves by more than 0.1 mm or 0.1 degrees."""
    shift = made.translation[:, :, 0].diff(dim=1).norm(dim=-1) > 1e-4
    turn = made.rotation[:, :, 0].diff(dim=1).flatten(2).norm(dim=-1) > 2e-3
    return shift | turn


def wrist_in_object(made: Interactions) -> Tensor:
    away = made.wrist - made.translation[:, :, 0]
    return (made.rotation[:, :, 0].mT @ away[..., None])[..., 0]


def test_interactions_are_finite_and_of_the_frames_asked_for(made):
    for field in fields(Interactions):
        assert bool(getattr(made, field.name).isfinite().all()), field.name
    assert made.pose.shape == (BATCH, FRAMES, 16, 3)
    assert made.points.shape == (BATCH, POINTS, 3)


def test_object_rotations_are_rotations(made):
    square = made.rotation @ made.rotation.mT
    torch.testing.assert_close(square, torch.eye(3).expand_as(square), atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.linalg.det(made.rotation), torch.ones(BATCH, FRAMES, 2))


def test_the_object_moves_only_in_a_hand_that_holds_it_still(made):
    grasps, _ = grasps_and_solids()
    away = (wrist_in_object(made) - grasps.wrist[:, None]).norm(dim=-1)
    moving = object_moves(made)
    assert float(moving.float().mean()) > 0.15, "objects should move"
    # the wrist slides about its grasp by a millimetre of deviation per axis
    held = torch.maximum(away[:, 1:], away[:, :-1])
    assert float(held[moving].max()) < 0.006
    assert float(away.max()) > 0.05, "hands should come and go"


def moving_between(lift: Tensor, put_down: Tensor) -> Schedule:
    """The object moves in these frames, held all the time."""
    never = torch.zeros_like(lift, dtype=torch.bool)
    shortest = ScheduleConfig().shortest_move
    return Schedule(FRAMES, lift, put_down, lift, put_down, put_down, never, shortest)


def test_the_object_rests_before_it_is_lifted_and_after_it_is_released():
    lift, release = torch.full((200,), 10.0), torch.linspace(22.0, 50.0, 200)
    generator = seeded()
    rest = Standing(torch.eye(3).expand(200, 3, 3), torch.zeros(200, dtype=torch.bool))
    schedule = moving_between(lift, release)
    rotation, translation = carried_path(schedule, rest, CONFIG, Draws(200, generator))
    shift = translation.diff(dim=1).norm(dim=-1)
    turn = rotation.diff(dim=1).flatten(2).norm(dim=-1)
    time = torch.arange(FRAMES - 1)
    resting = (time + 1 <= 10) | (time >= release[:, None])
    assert float(shift[resting].max()) < 1e-6
    assert float(turn[resting].max()) < 1e-6
    assert float((shift[~resting] > 1e-4).float().mean()) > 0.5


def test_fingers_keep_their_grasp_while_the_object_moves(made):
    grasps, _ = grasps_and_solids()
    off = (made.pose[:, :, 1:] - grasps.pose[:, None, 1:]).abs()
    assert float(off[:, 1:][object_moves(made)].median()) < 0.01, "lifted fingers excepted"


def test_opening_fingers_never_bend_further_than_they_hold(made):
    flexion = made.pose[:, :, 1:13, 2]
    held = FINGER_MEAN[:12, 2]
    trembling = 5 * (0.004 + 0.04)
    assert float((flexion - held).max()) < trembling
    assert float((held - flexion).amax((1, 2)).max()) > 0.3, "and some do open"


def test_people_open_their_hands_in_their_own_ways(made):
    opened = made.pose[:, :, 1:13, 2].mean(2).amin(1)
    assert float(opened.std()) > 0.05


def test_hands_shift_to_their_other_grips_while_they_hold():
    """Both grips of each hand are the same one, 3 cm aside and with other fingers."""
    grasps, solids = grasps_and_solids()
    pose, aside = grasps.pose.clone(), torch.tensor([0.03, 0.0, 0.0])
    pose[:, 4, 2] += 0.2
    grips = Grips(
        pose[:, None].expand(-1, 2, -1, -1), (grasps.wrist + aside)[:, None].expand(-1, 2, -1)
    )
    made = animate(grasps, solids, FRAMES, POINTS, generator=seeded(1), grips=grips)
    off = (
        wrist_in_object(made)[:, :, None]
        - torch.stack([grasps.wrist, grips.wrist[:, 0]], 1)[:, None]
    )
    near = off.norm(dim=-1) < 0.006  # but for small adjustments
    both = near.any(1).all(-1)
    assert 0.1 < float(both.float().mean()) < 0.9, "some shift, in others it is not seen"


def test_hands_move_smoothly(made):
    jump = made.wrist.diff(n=2, dim=1).norm(dim=-1)
    assert float(jump.max()) < 0.035
    assert float(jump.median()) < 0.003


def test_surface_points_lie_on_the_object(made):
    _, solids = grasps_and_solids()
    assert float(solids.signed_distance(made.points).abs().max()) < 1e-5


def test_motion_depends_on_the_generator_alone(made):
    again, other = interactions(), interactions(2)
    for field in fields(Interactions):
        assert torch.equal(getattr(made, field.name), getattr(again, field.name))
    assert not torch.equal(made.wrist, other.wrist)


@pytest.mark.parametrize("frames", [1, 8])
def test_short_clips_are_finite_too(frames):
    short = interactions(frames=frames)
    assert all(bool(getattr(short, f.name).isfinite().all()) for f in fields(Interactions))


def test_tables_are_below_the_hand_and_stand_the_object_up():
    grasps, solids = grasps_and_solids()
    joints = skeleton(grasps)
    surface, _ = solids.surface_points(200, generator=seeded(4))
    floating = torch.arange(BATCH) % 4 == 0
    rest = draw_standing(joints, surface, floating, CONFIG, Draws(BATCH, seeded(5)))
    square = rest.upright @ rest.upright.mT
    torch.testing.assert_close(square, torch.eye(3).expand_as(square), atol=1e-5, rtol=0)
    assert not bool(rest.on_table[floating].any())
    assert 0.2 * BATCH < int(rest.on_table.sum()) <= 0.9 * CONFIG.table_share * BATCH + 3
    height = (surface @ rest.upright.mT)[..., 2].amin(1)
    lowest = (joints @ rest.upright.mT)[..., 2].amin(1)
    assert bool((lowest > height)[rest.on_table].all()), "no part of the hand is under the table"


def test_from_a_table_objects_are_lifted_and_put_back_upright():
    count = 200
    rest = Standing(torch.eye(3).expand(count, 3, 3), torch.ones(count, dtype=torch.bool))
    lift, put = torch.full((count,), 5.0), torch.full((count,), 50.0)
    rotation, shift = carried_path(moving_between(lift, put), rest, CONFIG, Draws(count, seeded()))
    assert float(shift[..., 2].min()) > -1e-5, "never into the table"
    torch.testing.assert_close(shift[:, -1, 2], torch.zeros(count), atol=1e-5, rtol=0)
    torch.testing.assert_close(rotation[:, -1, 2, 2], torch.ones(count), atol=1e-5, rtol=0)
    slid = shift[..., 2].abs().amax(1) < 1e-6
    moved = shift[..., :2].norm(dim=-1).amax(1) > 0.02
    assert 0.1 < float((slid & moved).float().mean()) < 0.4, "some are slid"
    assert float((~slid & moved).float().mean()) > 0.4, "most are lifted"


def skeleton(grasps: Grasps) -> Tensor:
    turns = axis_angle_to_matrix(grasps.pose)
    return forward_kinematics(turns, grasps.wrist, grasps.offsets)[0]


def at_drawers(offset: float) -> tuple[Grasps, Solids]:
    """Hands on the handles of drawers (and so much along the way out), palms any way."""
    grasps, _ = grasps_and_solids()
    solids = draw_objects(["drawer"] * BATCH, generator=seeded(3))
    middle = skeleton(grasps)[:, 1:].mean(1)
    place = solids.center[:, 3] + torch.tensor([offset, 0.0, 0.0])
    return replace(grasps, wrist=grasps.wrist + place - middle), solids


def test_a_hand_at_a_handle_holds_the_second_part_and_may_pull_it():
    grasps, solids = at_drawers(0.05)
    held = held_part(solids, skeleton(grasps), CONFIG)
    holds = held.index == 1
    assert int(holds.sum()) > BATCH // 2
    assert bool((held.travel[:, 0] <= 0).all())
    assert bool((held.travel[:, 1] <= solids.travel[:, 1] + 1e-6).all())
    torch.testing.assert_close(held.travel[holds][:, 1], solids.travel[holds][:, 1])


def test_a_joint_has_no_room_through_the_hand():
    grasps, _ = grasps_and_solids()
    solids = draw_objects(["laptop"] * BATCH, generator=seeded(8))
    # hands on the near half of the keyboard: where the lid would come down
    place = torch.stack([solids.size[:, 0, 0] * 0.5, *torch.zeros(2, BATCH)], dim=-1)
    place[:, 2] = 0.03
    middle = skeleton(grasps)[:, 1:].mean(1)
    grasps = replace(grasps, wrist=grasps.wrist + place - middle)
    joints = skeleton(grasps)
    held = held_part(solids, joints, CONFIG)
    lid = solids.only(1)
    clear = (held.index == 0) & (lid.signed_distance(joints).amin(1) > 0.02)
    assert int(clear.sum()) > BATCH // 3
    assert bool((held.travel[clear, 0] > 0.9 * solids.travel[clear, 0]).any())
    turn, shift = solids.joint_pose(held.travel)
    there = (joints[:, None] - shift[:, :, None]) @ turn
    gap = lid.signed_distance(there.flatten(1, 2)).unflatten(1, (2, 21)).amin(-1)
    assert float(gap[clear].min()) > 0.01


def test_hands_work_joints_and_follow_the_part_they_hold():
    grasps, solids = at_drawers(0.05)
    made = animate(grasps, solids, 90, POINTS, generator=seeded(6))
    held = held_part(solids, skeleton(grasps), CONFIG)
    drawn = (made.translation[:, :, 1] - made.translation[:, :, 0]).norm(dim=-1)
    works = drawn.amax(1) > 0.005
    assert int(works.sum()) > BATCH // 4
    pulled = works & (held.index == 1)
    assert int(pulled.sum()) > BATCH // 5
    for clip in torch.nonzero(pulled)[:, 0].tolist():
        moving = drawn[clip].diff().abs() > 5e-4
        away = made.wrist[clip] - made.translation[clip, :, 1]
        local = (made.rotation[clip, :, 1].mT @ away[..., None])[..., 0]
        off = (local[1:] - grasps.wrist[clip]).norm(dim=-1)
        assert float(off[moving].max()) < 0.006
    assert bool(made.part.any(1).all())
    for part in range(2):
        off = solids.only(part).signed_distance(made.points).abs()
        assert float(off[made.part == part].max()) < 1e-5


def test_two_hands_hold_one_object_seen_in_a_mirror():
    grasps, solids = grasps_and_solids()
    half = BATCH // 2
    pairs = HandPairs(torch.cat([torch.full((half,), -1), torch.arange(half)]))
    made = animate(grasps, solids, FRAMES, POINTS, generator=seeded(7), pairs=pairs)
    flip = torch.tensor([-1.0, 1.0, 1.0])
    one, two = slice(0, half), slice(half, None)
    torch.testing.assert_close(made.translation[two], made.translation[one] * flip)
    torch.testing.assert_close(made.rotation[two], flip[:, None] * made.rotation[one] * flip)
    moving = object_moves(made)
    away = (wrist_in_object(made) - grasps.wrist[:, None]).norm(dim=-1)[:, 1:]
    held = torch.minimum(away[one], away[two])
    assert float(held[moving[one]].max()) < 0.006, "one of them holds what moves"
    lone = (away[one] > 0.05) & moving[one] | (away[two] > 0.05) & moving[two]
    assert bool(lone.any()), "while the other comes or goes"


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (HandMotionConfig, {"tremor_period": 0.0}),
        (HandMotionConfig, {"repeat_period": (0.0, 0.0)}),
        (ObjectMotionConfig, {"joint_states": 1}),
        (ObjectMotionConfig, {"table_directions": 0}),
    ],
)
def test_settings_that_would_make_no_numbers_are_refused(kind, wrong):
    with pytest.raises(ConfigError, match=f"'{next(iter(wrong))}' must be "):
        kind(**wrong)
