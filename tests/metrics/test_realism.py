import math
from dataclasses import replace

import pytest
import torch

from geneoh.geometry.oriented_points import signed_to_points
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.metrics.realism import (
    GRAVITY,
    SurfacePoints,
    moved_alone,
    realistic_frames,
    touched_points,
    wanted_wrench,
)

FPS, FRAMES, HALF = 30.0, 12, 0.03
NO_HAND = torch.full((1, FRAMES, 2, 3), torch.nan)


def box(tilt: float = 0.0) -> tuple[torch.Tensor, torch.Tensor]:
    """Points and normals of a cube of 6 cm that stands on the table.

    `tilt` turns the normals at -x and +x upwards, as on a wedge that is narrow above, radians.
    """
    across = torch.linspace(-HALF, HALF, 7)
    points, normals = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            face = torch.cartesian_prod(across, across)
            whole = torch.full((len(face), 3), side * HALF)
            whole[:, [a for a in range(3) if a != axis]] = face
            normal = torch.zeros(3)
            normal[axis] = side
            if axis == 0:
                normal = torch.tensor([side * math.cos(tilt), 0.0, math.sin(tilt)])
            points.append(whole)
            normals.append(normal.expand_as(whole))
    return torch.cat(points) + torch.tensor([0.0, 0.0, HALF]), torch.cat(normals)


def moving(path: torch.Tensor, tilt: float = 0.0) -> SurfacePoints:
    """The box, carried along a path."""
    points, normals = box(tilt)
    path = path.expand(FRAMES, 3)[None, :, None]
    return SurfacePoints(points + path, normals.expand_as(points + path), torch.tensor([FRAMES]))


def pinching(surface: SurfacePoints, off: float = 0.0) -> torch.Tensor:
    """Two fingertips of five vertices each on the sides at -x and +x, some way off them, metres."""
    pad = torch.tensor([[0, 0.0], [1, 0], [-1, 0], [0, 1], [0, -1]]) * 0.005
    aside = torch.tensor([[-1.0], [1.0]])[..., None].expand(2, 5, 1) * (HALF + off)
    tips = torch.cat([aside, pad.expand(2, 5, 2)], -1).flatten(0, 1)
    return surface.points.mean(2, keepdim=True) + tips


def frames_of(skin: torch.Tensor, surface: SurfacePoints, **how: float) -> torch.Tensor:
    """Which frames are realistic with this skin."""
    flat = [each.flatten(0, 1) for each in (skin, surface.points, surface.normals)]
    distance, index = signed_to_points(*flat, within=0.02)
    touched = touched_points(distance, index, surface.points.shape[2])
    return realistic_frames(touched.unflatten(0, skin.shape[:2]), surface, FPS, **how)


def share(skin: torch.Tensor, surface: SurfacePoints, **how: float) -> float:
    """The share of the frames that are realistic."""
    return frames_of(skin, surface, **how).float().mean().item()


def at_height(metres: float) -> torch.Tensor:
    return torch.tensor([0.0, 0.0, metres])


def accelerated(along_x: float) -> torch.Tensor:
    """A path in the air with a constant acceleration along x, m/s²."""
    seconds = torch.arange(FRAMES) / FPS
    return torch.stack([along_x * seconds**2 / 2, 0 * seconds, 0 * seconds + 0.3], -1)


def test_box_at_rest_on_the_table_is_realistic_without_a_hand():
    assert share(NO_HAND, moving(at_height(0.0))) == 1


def test_box_in_the_air_without_a_hand_is_not():
    assert share(NO_HAND, moving(at_height(0.3))) == 0


def test_box_that_slides_alone_is_not():
    path = torch.arange(FRAMES)[:, None] * torch.tensor([0.01, 0.0, 0.0])
    assert share(NO_HAND, moving(path)) == 0


def test_box_that_falls_freely_with_a_hand_at_it_asks_for_no_force():
    drop = -GRAVITY * (torch.arange(FRAMES) / FPS) ** 2 / 2
    path = torch.stack([0 * drop, 0 * drop, 2 + drop], -1)
    assert wanted_wrench(moving(path), FPS)[0].norm(dim=-1).amax() < 1e-3


def test_two_opposing_contacts_hold_a_box_by_friction_and_not_without():
    held = moving(at_height(0.3))
    assert share(pinching(held), held) == 1
    assert share(pinching(held), held, friction=0.0) == 0


@pytest.mark.parametrize(("degrees", "realistic"), [(25, True), (50, False)])
def test_a_wedge_slips_out_beyond_the_angle_of_friction(degrees: float, realistic: bool):
    # friction of 0.8 holds up to atan(0.8) = 39 degrees
    held = moving(at_height(0.3), tilt=math.radians(degrees))
    assert share(pinching(held), held) == float(realistic)


@pytest.mark.parametrize(("off", "realistic"), [(0.004, True), (0.006, False), (-0.004, True)])
def test_skin_touches_up_to_five_millimetres_off_and_inside(off: float, realistic: bool):
    held = moving(at_height(0.3))
    assert share(pinching(held, off), held) == float(realistic)


def test_one_fingertip_at_a_side_holds_nothing():
    held = moving(at_height(0.3))
    assert share(pinching(held)[:, :, :5], held) == 0


def from_below(surface: SurfacePoints) -> torch.Tensor:
    """A flat palm under the box."""
    spots = torch.cartesian_prod(torch.linspace(-0.02, 0.02, 5), torch.linspace(-0.02, 0.02, 5))
    palm = torch.cat([spots, torch.full((25, 1), -HALF)], -1)
    return surface.points.mean(2, keepdim=True) + palm


def test_palm_from_below_lifts_without_friction():
    lifted = moving(at_height(0.3))
    assert share(from_below(lifted), lifted, friction=0.0) == 1


def test_palm_beside_the_centre_of_mass_does_not_balance():
    lifted = moving(at_height(0.3))
    aside = from_below(lifted)[:, :, :5]  # the row at x = -2 cm
    assert share(aside, lifted) == 0


@pytest.mark.parametrize(("part", "realistic"), [(0.4, True), (1.2, False)])
def test_palm_carries_only_accelerations_that_friction_bears(part: float, realistic: bool):
    # friction alone pushes sideways, with at most 0.8 of the weight
    pushed = moving(accelerated(part * GRAVITY))
    assert share(from_below(pushed), pushed) == float(realistic)


def test_table_bears_a_box_that_a_finger_pushes_along():
    path = torch.arange(FRAMES)[:, None] * torch.tensor([0.01, 0.0, 0.0])
    pushed = moving(path)
    assert share(pinching(pushed)[:, :, :5], pushed) == 1


def test_finger_behind_a_box_cannot_pull_it_along_the_table():
    away = moving(accelerated(-15.0) * torch.tensor([1.0, 0.0, 0.0]))
    assert share(pinching(away)[:, :, 5:], away) == 1
    assert share(pinching(away)[:, :, :5], away) < 0.2


def test_turning_asks_for_the_torque_of_the_moment_of_inertia():
    points, normals = box()
    speed = 40.0  # rad/s², about the vertical through the middle
    angle = speed * (torch.arange(FRAMES) / FPS) ** 2 / 2
    turn = axis_angle_to_matrix(torch.stack([0 * angle, 0 * angle, angle], -1))[:, None]
    turned = SurfacePoints(
        (turn @ points[..., None])[None, ..., 0],
        (turn @ normals[..., None])[None, ..., 0],
        torch.tensor([FRAMES]),
    )
    inertia = points[:, :2].square().sum(-1).mean()
    torque = wanted_wrench(turned, FPS)[0][0, 2, 5] * GRAVITY
    assert torque.item() == pytest.approx(float(inertia) * speed, rel=0.02)
    assert turned.moves[0].tolist() == [True] * (FRAMES - 1) + [False]  # also about a point of it


def test_frames_after_the_end_do_not_count():
    surface = replace(moving(at_height(0.3)), length=torch.tensor([6]))
    frames = frames_of(pinching(surface), surface)
    assert frames[0].tolist() == [True] * 6 + [False] * 6


def together(*clips: SurfacePoints) -> SurfacePoints:
    """A batch of clips."""
    points, normals = zip(*((clip.points, clip.normals) for clip in clips), strict=True)
    return SurfacePoints(torch.cat(points), torch.cat(normals), torch.tensor([FRAMES] * len(clips)))


def test_each_clip_of_a_batch_has_its_own_value():
    both = together(moving(at_height(0.0)), moving(at_height(0.3)))
    touched = torch.zeros(both.points.shape[:3], dtype=torch.bool)
    assert (realistic_frames(touched, both, FPS).sum(1) / both.length).tolist() == [1, 0]


def test_forces_on_one_object_of_a_batch_do_not_hold_another():
    pushed = moving(torch.arange(FRAMES)[:, None] * torch.tensor([0.01, 0.0, 0.0]))
    lifted = moving(at_height(0.3))
    aside, tip = from_below(lifted)[:, :, -5:], pinching(lifted)[:, :, :1]
    skins = pinching(pushed), aside.repeat(1, 1, 2, 1), pinching(lifted), tip.repeat(1, 1, 10, 1)
    found = frames_of(torch.cat(skins), together(pushed, lifted, lifted, lifted))
    assert found.float().mean(1).tolist() == [1, 0, 1, 0]


def test_motion_without_contact_counts_moving_frames_without_a_keypoint_nearby():
    step = torch.tensor([0.01, 0.0, 0.0])
    path = torch.arange(FRAMES).clamp(min=3)[:, None] * step  # moves on from the frames 3 to 10
    surface = moving(path)
    joints = surface.points[:, :, :1] + torch.tensor([-0.019, 0.0, 0.0])
    joints[:, 7:] += torch.tensor([-0.01, 0.0, 0.0])
    assert moved_alone(joints, surface).item() == pytest.approx(4 / 8)
    assert moved_alone(joints * torch.nan, surface).item() == 1


def test_motion_without_contact_is_undefined_for_an_object_that_rests():
    surface = moving(at_height(0.0))
    assert moved_alone(surface.points[:, :, :1], surface).isnan().item()


@pytest.mark.parametrize("frames", [1, 2, 3, 4, 5])
def test_short_clips_that_move_evenly_ask_for_their_weight(frames: int):
    path = torch.arange(FRAMES)[:, None] * torch.tensor([0.0, 0.0, 0.02])
    clip = replace(moving(path), length=torch.tensor([frames]))
    force = wanted_wrench(clip, FPS)[0][0, :frames, :3]
    torch.testing.assert_close(force, torch.tensor([[0.0, 0.0, 1.0]]).expand(frames, 3))
