"""An object that its hands carry, or that rests, is nearer to the truth than a smooth one."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.objects.cleaning import clean_object
from geneoh.objects.holding import RADIANS_PER_METRE
from geneoh.objects.refine import refine_object, stillness
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.noise import ornstein_uhlenbeck
from geneoh.sequence.object_noise import draw_object_noise
from geneoh.sequence.sequence import HandTrack, ObjectTrack

FRAMES, LIFT = 150, 70
WEDGE = Mesh(
    0.1 * torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 0.6, 0], [0, 0, 0.4]]),
    torch.tensor([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


def carried() -> tuple[torch.Tensor, torch.Tensor]:
    """A rigid motion, rotations (T, 3, 3) and places (T, 3), that begins at `LIFT`."""
    time = (torch.arange(FRAMES) - LIFT).clamp(min=0) / 30
    turn = torch.stack([0.8 * torch.sin(time), 0.5 * time, 0.3 * torch.sin(2 * time)], dim=-1)
    place = torch.stack([0.2 * torch.sin(time), 0.1 * time, 0.15 * (1 - torch.cos(time))], dim=-1)
    return axis_angle_to_matrix(turn), place


def scene(parts: int = 1) -> tuple[ObjectTrack, HandTrack]:
    """A hand that comes near an object, which rests until the hand carries it."""
    turn, place = carried()
    track = ObjectTrack(
        (WEDGE,) * parts,
        turn[:, None].repeat(1, parts, 1, 1),
        place[:, None] + 0.2 * torch.arange(parts)[:, None] * torch.eye(3)[0],
    )
    away = (LIFT - torch.arange(FRAMES)).clamp(min=0)[:, None] * torch.tensor([0.0, 0.0, 0.004])
    grip = 0.05 * torch.rand(21, 3, generator=torch.Generator().manual_seed(0))
    joints = grip @ turn.mT + (place + away)[:, None]
    pose = torch.zeros(FRAMES, 16, 3)
    pose[:, 0] = matrix_to_axis_angle(turn)
    valid = torch.ones(FRAMES, dtype=torch.bool)
    return track, HandTrack("right", valid, joints=joints, pose=pose, wrist=joints[:, 0])


def shaken(track: ObjectTrack, noise: str, seed: int) -> ObjectTrack:
    """The track with noise of its own on each part."""
    generator = torch.Generator().manual_seed(seed)
    drawn = [draw_object_noise(noise, FRAMES, generator=generator) for _ in track.meshes]
    turns = torch.stack([axis_angle_to_matrix(turn) for turn, _ in drawn], dim=1)
    shifts = torch.stack([shift for _, shift in drawn], dim=1)
    moved = replace(track, rotation=track.rotation @ turns, translation=track.translation + shifts)
    return fill_object(moved)


def off(track: ObjectTrack, truth: ObjectTrack) -> float:
    """Mean distance in mm of the vertices of all parts from where they are."""
    verts = torch.stack([mesh.verts for mesh in truth.meshes])
    places = [
        torch.einsum("tqij,qvj->tqvi", t.rotation, verts) + t.translation[:, :, None]
        for t in (track, truth)
    ]
    return 1000 * float((places[0] - places[1]).norm(dim=-1).mean())


@pytest.mark.parametrize(("noise", "least"), [("shaky_2", 0.9), ("shaky_10", 0.9), ("flips", 1)])
def test_a_carried_object_is_nearer_to_the_truth_than_a_smooth_one(noise, least):
    truth, hand = scene()
    errors = []
    for seed in range(3):
        given = shaken(truth, noise, seed)
        smooth, examined = clean_object(given, 30.0)
        refined = refine_object(smooth, examined, [hand], 30.0)
        errors.append([off(track, truth) for track in (given, smooth, refined)])
    given, smooth, refined = torch.tensor(errors).mean(0)
    assert refined < least * smooth
    assert refined < 0.66 * given


def test_a_hand_that_holds_an_object_loosely_tells_drift_of_many_times_its_play():
    truth, hand = scene()
    play = ornstein_uhlenbeck(
        torch.randn(FRAMES, 3, generator=torch.Generator().manual_seed(3)), 4.0
    )
    loose = replace(hand, joints=hand.joints + 0.003 * play[:, None])
    errors = []
    for seed in range(3):
        smooth, examined = clean_object(shaken(truth, "shaky_10", seed), 30.0)
        refined = refine_object(smooth, examined, [loose], 30.0)
        errors.append([off(smooth, truth), off(refined, truth)])
    smooth, refined = torch.tensor(errors).mean(0)
    assert refined < 0.75 * smooth


def test_frames_without_a_pose_follow_the_hand():
    truth, hand = scene()
    seen = torch.ones(FRAMES, 1, dtype=torch.bool)
    seen[100:115] = False
    smooth, examined = clean_object(fill_object(truth, seen), 30.0)
    refined = refine_object(smooth, examined, [hand], 30.0)
    gap = ~seen[:, 0]
    assert off(refined[gap], truth[gap]) < 0.5 * off(smooth[gap], truth[gap])
    assert torch.equal(refined.rotation[~gap], truth.rotation[~gap])


def test_an_object_that_is_lost_to_the_end_in_no_hand_does_not_go_on_for_ever():
    """As where a tracker slides away from its object before it loses it."""
    track, hand = scene()
    noisy = shaken(track, "shaky_2", 0)[:100]
    noisy.translation[30:60] += 0.014 * torch.arange(30)[:, None, None] * torch.eye(3)[0]
    noisy.translation[60:] = torch.nan
    noisy = fill_object(noisy)
    away = replace(hand, joints=hand.joints + 1.0, wrist=hand.wrist + 1.0)[:100]
    refined = refine_object(*clean_object(noisy, 30.0), [away], 30.0)
    gone = (refined.translation[60:] - refined.translation[59]).norm(dim=-1)
    assert float(gone.max()) < 0.08


def test_an_object_that_is_lost_while_it_is_taken_rests_and_then_follows_the_hand():
    truth, hand = scene()
    seen = torch.ones(FRAMES, 1, dtype=torch.bool)
    seen[LIFT - 10 : LIFT + 30] = False
    gap = ~seen[:, 0]
    for noise in (None, "shaky_2"):
        given = truth if noise is None else shaken(truth, noise, 0)
        smooth, examined = clean_object(fill_object(given, seen), 30.0)
        refined = refine_object(smooth, examined, [hand], 30.0)
        assert off(refined[gap], truth[gap]) < 0.15 * off(smooth[gap], truth[gap])
        assert bool(refined.observed.all())


@pytest.mark.parametrize("known", [0, 1, 5])
def test_hardly_any_pose_tells_no_motion(known):
    truth, hand = scene()
    seen = (torch.arange(FRAMES) - 60).abs()[:, None] <= known // 2
    given = fill_object(truth, seen) if known else replace(truth, valid=seen & False)
    smooth, examined = clean_object(given, 30.0)
    refined = refine_object(smooth, examined, [hand], 30.0)
    assert refined.rotation.equal(smooth.rotation)
    assert refined.translation.equal(smooth.translation)


def test_an_object_that_is_swung_unseen_is_still_held():
    truth, hand = scene()
    swing = 0.3 * torch.exp(-((torch.arange(FRAMES) - 107) / 3.0).square())[:, None]
    swing = swing * torch.eye(3)[2]
    truth = replace(truth, translation=truth.translation + swing[:, None])
    hand = replace(hand, joints=hand.joints + swing[:, None])
    seen = torch.ones(FRAMES, 1, dtype=torch.bool)
    seen[101:113] = False
    smooth, examined = clean_object(fill_object(truth, seen), 30.0)
    refined = refine_object(smooth, examined, [hand], 30.0)
    gap = ~seen[:, 0]
    assert off(smooth[gap], truth[gap]) > 60
    assert off(refined[gap], truth[gap]) < 12


def test_each_part_follows_the_hand_that_holds_it_and_exact_ones_stay():
    truth, hand = scene(parts=2)
    other = replace(hand, side="left", joints=hand.joints + 0.2 * torch.eye(3)[0])
    noisy = shaken(truth, "shaky_2", 0)
    half = torch.stack([truth.rotation[:, 0], noisy.rotation[:, 1]], dim=1)
    places = torch.stack([truth.translation[:, 0], noisy.translation[:, 1]], dim=1)
    given = replace(truth, rotation=half, translation=places)
    smooth, examined = clean_object(given, 30.0)
    refined = refine_object(smooth, examined, [hand, other], 30.0)
    assert torch.equal(refined.rotation[:, 0], truth.rotation[:, 0])
    assert off(refined, truth) < off(smooth, truth)


def test_no_pose_is_taken_farther_than_noise_explains():
    truth, hand = scene()
    smooth, examined = clean_object(shaken(truth, "shaky_10", 1), 30.0)
    strange = replace(hand, joints=hand.joints + 0.01 * torch.arange(FRAMES)[:, None, None])
    refined = refine_object(smooth, examined, [strange], 30.0)
    center = (WEDGE.verts.amax(0) + WEDGE.verts.amin(0)) / 2
    moved = (refined.rotation - smooth.rotation) @ center + refined.translation - smooth.translation
    assert moved.norm(dim=-1).max() < 3.01 * 3**0.5 * float(examined.translation_noise.max())


def white(track: ObjectTrack, degrees: float, metres: float, seed: int) -> ObjectTrack:
    """The track with white noise of these deviations per axis, which does not drift."""
    turn, shift = torch.randn(2, FRAMES, 3, generator=torch.Generator().manual_seed(seed))
    turns = axis_angle_to_matrix(math.radians(degrees) * turn)
    return replace(
        track,
        rotation=track.rotation @ turns[:, None],
        translation=track.translation + metres * shift[:, None],
    )


@pytest.mark.parametrize(("degrees", "metres"), [(0.0, 0.01), (10.0, 0.0), (10.0, 0.01)])
def test_what_an_object_moves_in_the_hand_is_no_drift_where_its_noise_is_white(degrees, metres):
    truth, hand = scene()
    play = ornstein_uhlenbeck(
        torch.randn(FRAMES, 3, generator=torch.Generator().manual_seed(3)), 15.0
    )
    moving = (torch.arange(FRAMES) > LIFT)[:, None]
    truth = replace(truth, translation=truth.translation + (0.005 * play * moving)[:, None])
    errors = []
    for seed in range(2):
        smooth, examined = clean_object(white(truth, degrees, metres, seed), 30.0)
        refined = refine_object(smooth, examined, [hand], 30.0)
        errors.append([off(smooth, truth), off(refined, truth)])
    smooth, refined = torch.tensor(errors).mean(0)
    assert refined < smooth + 0.2


def test_the_weight_of_rest_falls_with_the_steps_in_units_of_their_size():
    rest, steps = np.zeros((20, 3)), np.full((20, 3), 0.002)
    assert stillness(rest, rest, 0.002) == pytest.approx(1.0)
    assert stillness(rest, steps, 0.002) == pytest.approx(0.25)
    assert stillness(RADIANS_PER_METRE * steps, rest, 0.002) == pytest.approx(0.25)
