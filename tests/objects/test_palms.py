"""What an object does together with a hand is motion, and its noise is still found."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial.transform import Rotation

from geneoh.geometry.mesh import Mesh
from geneoh.objects.cleaning import clean_object
from geneoh.objects.palms import RigidMotion, own_noise, palm_at, palm_of
from geneoh.objects.smoothing import noise_level
from geneoh.readers.npz.files import load
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import ObjectTrack

FRAMES, FPS = 120, 30.0
IN_THE_HAND = 0.05 * torch.randn(21, 3, generator=torch.Generator().manual_seed(0))
"""Keypoints in the frame of the object."""


def bottle(hertz: float, degrees: float) -> ObjectTrack:
    """A bottle that is shaken about a point 25 cm away from it in the middle of the track."""
    time = np.arange(FRAMES) / FPS
    share = np.clip(np.minimum(time, time[-1] - time) - 0.5, 0, 0.2) / 0.2
    angle = share * np.radians(degrees) * np.sin(2 * np.pi * hertz * time)
    rotation = Rotation.from_rotvec(np.outer(angle, [1.0, 0.0, 0.0]))
    shape = trimesh.creation.cylinder(0.03, 0.2, sections=32)
    mesh = Mesh(torch.tensor(shape.vertices).float(), torch.tensor(shape.faces))
    places = rotation.apply([0.0, 0.0, 0.25])
    return ObjectTrack(
        (mesh,),
        torch.from_numpy(rotation.as_matrix()).float()[:, None],
        torch.from_numpy(places).float()[:, None],
    )


def palm_on(motion: ObjectTrack, noise: float = 0.0) -> RigidMotion:
    """The palm of a hand that holds the object, with noise on each keypoint, metres."""
    joints = IN_THE_HAND @ motion.rotation[:, 0].mT + motion.translation
    joints = joints + noise * torch.randn(joints.shape, generator=torch.Generator().manual_seed(1))
    return palm_at(joints, torch.ones(FRAMES, 21, dtype=torch.bool))


def noisy(motion: ObjectTrack, degrees: float, metres: float) -> ObjectTrack:
    draws = np.random.default_rng(2)
    turn = np.radians(degrees) * draws.standard_normal((FRAMES, 3))
    rotation = Rotation.from_matrix(motion.rotation[:, 0].double().numpy())
    rotation = (rotation * Rotation.from_rotvec(turn)).as_matrix()
    shift = metres * torch.from_numpy(draws.standard_normal((FRAMES, 1, 3))).float()
    turned = torch.from_numpy(rotation).float()[:, None]
    return replace(motion, rotation=turned, translation=motion.translation + shift)


@pytest.mark.parametrize(("hertz", "degrees"), [(4.0, 25.0), (5.0, 20.0), (5.0, 30.0)])
def test_an_object_that_a_hand_shakes_stays_as_it_is(hertz, degrees):
    motion = bottle(hertz, degrees)
    assert clean_object(motion, FPS)[1].is_noisy.all()  # nothing else tells it from noise
    for noise in (0.0, 0.0005):
        clean, found = clean_object(motion, FPS, (palm_on(motion, noise),))
        assert clean is motion
        assert not list(found.sentences())
    clean, _ = clean_object(motion, FPS, (palm_on(motion, 0.002),))
    torch.testing.assert_close(clean.translation, motion.translation, atol=0.004, rtol=0)
    torch.testing.assert_close(clean.rotation, motion.rotation, atol=0.04, rtol=0)


def seen_by_a_shaking_camera(motion: ObjectTrack, palm: RigidMotion) -> tuple:
    """Object and palm, both with the noise of the camera's pose, 0.01 rad and 10 mm."""
    draws = np.random.default_rng(3)
    turn = Rotation.from_rotvec(0.01 * draws.standard_normal((FRAMES, 3)))
    shift = 0.01 * draws.standard_normal((FRAMES, 3))
    rotation = torch.from_numpy(turn.as_matrix()).float()[:, None]
    places = turn.apply(motion.translation[:, 0].double().numpy()) + shift
    palm = replace(palm, turns=turn * palm.turns, places=turn.apply(palm.places) + shift)
    translation = torch.from_numpy(places).float()[:, None]
    return replace(motion, rotation=rotation @ motion.rotation, translation=translation), palm


@pytest.mark.parametrize("noise", [0.0005, 0.004])
def test_jitter_of_the_camera_that_the_hand_shares_is_no_noise_of_the_object(noise):
    motion = bottle(0.5, 20.0)
    given, palm = seen_by_a_shaking_camera(motion, palm_on(motion, noise))
    assert clean_object(given, FPS)[1].is_noisy.all()
    clean, found = clean_object(given, FPS, (palm,))
    assert clean is given
    assert not list(found.sentences())


def test_noise_beside_the_jitter_of_the_camera_is_found():
    motion = bottle(0.5, 20.0)
    given, palm = seen_by_a_shaking_camera(noisy(motion, 5.0, 0.01), palm_on(motion, 0.004))
    found = clean_object(given, FPS, (palm,))[1].white_noise
    want = torch.tensor([np.radians(5.0), 0.01]).float()
    torch.testing.assert_close(found, want, rtol=0.3, atol=0)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_noise_of_an_object_is_found_whether_a_hand_holds_it_or_not(noise):
    motion = bottle(0.5, 20.0)
    given = noisy(motion, 5.0, 0.01)
    alone, found = (clean_object(given, FPS, palms)[1] for palms in ((), (palm_on(motion, noise),)))
    torch.testing.assert_close(found.white_noise, alone.white_noise, rtol=0.15, atol=0)
    torch.testing.assert_close(
        found.white_noise, torch.tensor([np.radians(5.0), 0.01]).float(), rtol=0.3, atol=0
    )


def test_flips_and_jumps_are_found_beside_a_hand_that_shakes():
    motion = bottle(4.0, 25.0)
    rotation, translation = motion.rotation.clone(), motion.translation.clone()
    rotation[50:53] = rotation[50:53] @ torch.diag(torch.tensor([1.0, -1.0, -1.0]))
    rotation[70:73] = rotation[70:73] @ torch.tensor([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    translation[80:84] += 0.3
    given = replace(motion, rotation=rotation, translation=translation)
    clean, found = clean_object(given, FPS, (palm_on(motion),))
    assert found.symmetric[:, 0].nonzero()[:, 0].tolist() == [50, 51, 52]
    assert found.left_out[:, 0].nonzero()[:, 0].tolist() == [70, 71, 72, 80, 81, 82, 83]
    right = ~found.left_out[:, 0] & ~found.symmetric[:, 0]
    torch.testing.assert_close(clean.rotation[right], motion.rotation[right], atol=1e-5, rtol=0)
    torch.testing.assert_close(
        clean.translation[right], motion.translation[right], atol=1e-5, rtol=0
    )


@pytest.mark.parametrize("ratio", [1.0, 10.0])
def test_noise_of_an_object_is_its_own_beside_a_hand_of_any_noise(ratio):
    """Beside a hand with ten times its noise, chance made it seem shared in one of 15 tracks."""
    draws, seen = np.random.default_rng(3), np.ones(60, dtype=bool)
    found = []
    for _ in range(100):
        track, other = draws.standard_normal((2, 60, 3)) * [[[0.002]], [[0.002 * ratio]]]
        found.append(own_noise(track, other, seen, np.median) == noise_level(track, seen))
    assert sum(found) >= 97


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_half_a_turn_in_one_frame_is_found_beside_a_noisy_hand(axis):
    """Half a turn and back were sometimes taken for motion that the palm shares, so that the whole
    track counted as exact, and the object was relied on in no frame."""
    clip = load("examples/taco_clean.npz", obj="examples/taco_object.obj")[40:80]
    generator = torch.Generator().manual_seed(0)
    palm = palm_of(corrupt_sequence(clip, "gauss", generator=generator).hands[0])
    over = -torch.eye(3)
    over[axis, axis] = 1.0
    for frame in range(3, 37):
        rotation = clip.object.rotation.clone()
        rotation[frame, 0] = rotation[frame, 0] @ over
        _, found = clean_object(replace(clip.object, rotation=rotation), FPS, (palm,))
        assert torch.nonzero(found.left_out[:, 0])[:, 0].tolist() == [frame]


def test_a_hand_that_is_hardly_seen_tells_nothing():
    motion = bottle(5.0, 20.0)
    palm = palm_on(motion)
    seen = np.arange(FRAMES) % 8 < 6  # never so many frames in a row that noise shows
    given = clean_object(motion, FPS, (replace(palm, seen=seen),))[1].white_noise
    assert given.tolist() == clean_object(motion, FPS)[1].white_noise.tolist()


def test_keypoints_that_are_not_trusted_tell_nothing():
    motion = bottle(5.0, 20.0)
    joints = IN_THE_HAND @ motion.rotation[:, 0].mT + motion.translation
    joints[40:50, 9] = torch.nan
    joints[70, :] = 0.0
    trust = torch.ones(FRAMES, 21)
    trust[40:50, 9] = trust[70] = 0
    palm = palm_at(joints, trust > 0)
    assert np.flatnonzero(~palm.seen).tolist() == [*range(40, 50), 70]
    assert np.isfinite(palm.places).all()
    assert clean_object(motion, FPS, (palm,))[0] is motion
    unknown = palm_at(torch.zeros(FRAMES, 21, 3), torch.zeros(FRAMES, 21, dtype=torch.bool))
    found, alone = (clean_object(motion, FPS, each)[1].white_noise for each in ((unknown,), ()))
    assert found.tolist() == alone.tolist()
