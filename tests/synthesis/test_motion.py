from dataclasses import fields

import pytest
import torch
from torch import Tensor

from geneoh.hand.library import load_hand
from geneoh.synthesis.grasps import NATURAL_MEAN, Grasps
from geneoh.synthesis.motion import Interactions, _object_path, animate
from geneoh.synthesis.objects import Solids, draw_objects

BATCH, FRAMES, POINTS = 24, 60, 16


def grasps_and_solids() -> tuple[Grasps, Solids]:
    """Hands at some place on boxes; whether they touch is not what moves them."""
    generator = torch.Generator().manual_seed(0)
    orient = torch.randn(BATCH, 1, 3, generator=generator)
    pose = torch.cat([orient, NATURAL_MEAN.expand(BATCH, 15, 3)], dim=1)
    wrist = 0.1 * torch.randn(BATCH, 3, generator=generator)
    offsets = load_hand("right").shaped(torch.zeros(BATCH, 10)).offsets
    kept = torch.ones(BATCH, dtype=torch.bool)
    return Grasps(pose, wrist, offsets, kept), draw_objects(["box"] * BATCH, generator=generator)


def interactions(seed: int = 1, frames: int = FRAMES) -> Interactions:
    generator = torch.Generator().manual_seed(seed)
    return animate(*grasps_and_solids(), frames, POINTS, generator=generator)


@pytest.fixture(scope="module")
def made() -> Interactions:
    return interactions()


def object_moves(made: Interactions) -> Tensor:
    """Frame pairs (B, T - 1) in which the object moves by more than 0.1 mm or 0.1 degrees."""
    shift = made.translation.diff(dim=1).norm(dim=-1) > 1e-4
    turn = (made.rotation.diff(dim=1)).flatten(2).norm(dim=-1) > 2e-3
    return shift | turn


def wrist_in_object(made: Interactions) -> Tensor:
    away = made.wrist - made.translation
    return (made.rotation.mT @ away[..., None])[..., 0]


def test_interactions_are_finite_and_of_the_frames_asked_for(made):
    for field in fields(Interactions):
        assert bool(getattr(made, field.name).isfinite().all()), field.name
    assert made.pose.shape == (BATCH, FRAMES, 16, 3)
    assert made.points.shape == (BATCH, POINTS, 3)


def test_object_rotations_are_rotations(made):
    square = made.rotation @ made.rotation.mT
    torch.testing.assert_close(square, torch.eye(3).expand_as(square), atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.linalg.det(made.rotation), torch.ones(BATCH, FRAMES))


def test_the_object_moves_only_in_a_hand_that_holds_it_still(made):
    grasps, _ = grasps_and_solids()
    away = (wrist_in_object(made) - grasps.wrist[:, None]).norm(dim=-1)
    moving = object_moves(made)
    assert float(moving.float().mean()) > 0.15, "objects should move"
    # the wrist slides about its grasp by a millimetre of deviation per axis
    held = torch.maximum(away[:, 1:], away[:, :-1])
    assert float(held[moving].max()) < 0.006
    assert float(away.max()) > 0.05, "hands should come and go"


def test_the_object_rests_before_it_is_lifted_and_after_it_is_released():
    lift, release = torch.full((200,), 10.0), torch.linspace(22.0, 50.0, 200)
    generator = torch.Generator().manual_seed(0)
    rotation, translation = _object_path(lift, release, FRAMES, generator=generator)
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
    held = NATURAL_MEAN[:12, 2]
    trembling = 5 * (0.004 + 0.04)
    assert float((flexion - held).max()) < trembling
    assert float((held - flexion).amax((1, 2)).max()) > 0.3, "and some do open"


def test_people_open_their_hands_in_their_own_ways(made):
    opened = made.pose[:, :, 1:13, 2].mean(2).amin(1)
    assert float(opened.std()) > 0.05


def test_hands_move_smoothly(made):
    jump = made.wrist.diff(n=2, dim=1).norm(dim=-1)
    assert float(jump.max()) < 0.03
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
