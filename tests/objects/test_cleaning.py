"""An object's track that shakes, flips or is exact."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial.transform import Rotation

from geneoh.errors import numbered
from geneoh.geometry.mesh import Mesh
from geneoh.objects.cleaning import clean_object
from geneoh.objects.evidence import evidence_of_poses
from geneoh.objects.palms import RigidMotion
from geneoh.sequence.sequence import ObjectTrack

FRAMES, FPS = 150, 30.0


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    verts = torch.from_numpy(np.array(shape.vertices, dtype=np.float32))
    return Mesh(verts, torch.from_numpy(np.array(shape.faces)))


CAN = mesh_of(trimesh.creation.cylinder(0.03, 0.12, sections=64))
WEDGE = mesh_of(trimesh.convex.convex_hull(np.random.default_rng(0).random((12, 3)) * 0.1))


def lifted(mesh: Mesh) -> ObjectTrack:
    """An object that rests, is lifted and turned, and rests."""
    phase = np.clip((np.arange(FRAMES) - 40) / 60, 0, 1)
    ease = (1 - np.cos(np.pi * phase)) / 2
    rotation = Rotation.from_rotvec(np.outer(ease, [0.5, -0.8, 1.1])).as_matrix()
    translation = np.outer(ease, [0.1, 0.2, 0.3])
    return track_of(mesh, rotation, translation)


def track_of(mesh: Mesh, rotation: np.ndarray, translation: np.ndarray) -> ObjectTrack:
    return ObjectTrack(
        (mesh,),
        torch.from_numpy(rotation).float()[:, None],
        torch.from_numpy(translation).float()[:, None],
    )


def shaken(motion: ObjectTrack, degrees: float, metres: float, seed: int = 0) -> ObjectTrack:
    generator = np.random.default_rng(seed)
    turn = np.radians(degrees) * generator.standard_normal((FRAMES, 3))
    rotation = motion.rotation[:, 0].double().numpy() @ Rotation.from_rotvec(turn).as_matrix()
    shift = metres * generator.standard_normal((FRAMES, 3))
    return track_of(motion.meshes[0], rotation, motion.translation[:, 0].numpy() + shift)


def angles(one: ObjectTrack, other: ObjectTrack) -> np.ndarray:
    """Degrees between the rotations of two tracks in each frame."""
    between = one.rotation[:, 0].double().mT @ other.rotation[:, 0].double()
    return np.degrees(Rotation.from_matrix(between.numpy()).magnitude())


def test_an_exact_track_comes_back_as_the_same_object():
    motion = lifted(WEDGE)
    clean, found = clean_object(motion, FPS)
    assert clean is motion
    assert not found.is_noisy.any()
    assert not list(found.sentences())


@pytest.mark.parametrize("every", [2, 4])
def test_an_exact_track_of_few_frames_a_second_stays_exact(every):
    motion = lifted(WEDGE)
    slow = replace(
        motion, rotation=motion.rotation[::every], translation=motion.translation[::every]
    )
    assert clean_object(slow, FPS / every)[0] is slow


@pytest.mark.parametrize(("degrees", "metres"), [(1.0, 0.002), (5.0, 0.01)])
def test_a_shaky_track_is_calmed_and_its_noise_told(degrees, metres):
    motion = lifted(WEDGE)
    noisy = shaken(motion, degrees, metres)
    clean, found = clean_object(noisy, FPS)
    assert np.degrees(float(found.rotation_noise.max())) == pytest.approx(degrees, rel=0.25)
    assert float(found.translation_noise.max()) == pytest.approx(metres, rel=0.25)
    assert angles(motion, clean).mean() < 0.4 * angles(motion, noisy).mean()
    off = (clean.translation - motion.translation).norm(dim=-1).mean()
    assert off < 0.4 * (noisy.translation - motion.translation).norm(dim=-1).mean()
    assert "shakes" in next(found.sentences())


@pytest.mark.parametrize(("degrees", "metres"), [(0.0, 0.01), (5.0, 0.0)])
def test_noise_of_the_place_or_of_the_rotation_alone_is_noise(degrees, metres):
    assert clean_object(shaken(lifted(WEDGE), degrees, metres), FPS)[1].is_noisy.all()


@pytest.mark.parametrize(("degrees", "metres"), [(1.0, 0.002), (1.5, 0.002), (5.0, 0.005)])
def test_a_track_that_shakes_at_its_start_alone_is_calmed_there(degrees, metres):
    motion = lifted(WEDGE)
    given = shaken(motion, degrees, metres)
    given.rotation[60:], given.translation[60:] = motion.rotation[60:], motion.translation[60:]
    clean, found = clean_object(given, FPS)
    before, after = slice(0, 60), slice(80, None)
    assert angles(motion, clean)[before].mean() < 0.5 * angles(motion, given)[before].mean()
    assert angles(motion, clean)[after].max() < 0.1
    assert (clean.translation - motion.translation)[after].norm(dim=-1).max() < 0.0005
    noise = found.rotation_noise[:, 0].rad2deg()
    assert float(noise.max()) == pytest.approx(degrees, rel=0.3)
    assert float(noise[-1]) < 0.2
    assert "shakes by up to" in next(found.sentences())


def test_a_track_that_shakes_at_its_start_as_little_as_motion_capture_is_exact():
    motion = lifted(WEDGE)
    given = shaken(motion, 0.3, 0.0003)
    given.rotation[60:], given.translation[60:] = motion.rotation[60:], motion.translation[60:]
    assert clean_object(given, FPS)[0] is given


def test_motion_of_few_frames_a_second_is_not_uneven_noise():
    motion = lifted(WEDGE)
    given = shaken(motion, 1.0, 0.0)
    given.rotation[60:] = motion.rotation[60:]
    given.rotation[100:108] @= torch.tensor([[-1.0, 0, 0], [0, -1, 0], [0, 0, 1]])
    assert float(np.ptp(clean_object(given, FPS)[1].rotation_noise.numpy())) > 0
    assert float(np.ptp(clean_object(given, FPS / 3)[1].rotation_noise.numpy())) == 0


@pytest.mark.parametrize("start", [50, 0, FRAMES - 8])
def test_flips_are_left_out_and_the_frames_around_them_stay_exact(start):
    motion, flipped = lifted(WEDGE), slice(start, start + 8)
    rotation = motion.rotation.clone()
    rotation[flipped] = rotation[flipped] @ torch.tensor([[-1.0, 0, 0], [0, -1, 0], [0, 0, 1]])
    clean, found = clean_object(replace(motion, rotation=rotation), FPS)
    assert found.left_out[flipped].all()
    assert int(found.left_out.sum()) == 8
    assert angles(motion, clean).max() < 3
    assert np.delete(angles(motion, clean), range(start, start + 8)).max() < 0.1


def test_the_place_of_an_exact_track_does_not_follow_a_flip_about_a_point_beside_it():
    motion, point = lifted(WEDGE), torch.tensor([0.02, 0.03, 0.0])
    rotation, translation = motion.rotation.clone(), motion.translation.clone()
    flip = torch.diag(torch.tensor([-1.0, -1.0, 1.0]))
    translation[70:78] += rotation[70:78] @ (point - flip @ point)
    rotation[70:78] = rotation[70:78] @ flip
    clean, _ = clean_object(replace(motion, rotation=rotation, translation=translation), FPS)
    assert float((clean.translation - motion.translation).norm(dim=-1).max()) < 0.004


def test_a_flip_of_a_second_is_left_out():
    motion = lifted(WEDGE)
    rotation, flipped = motion.rotation.clone(), slice(50, 80)
    rotation[flipped] = rotation[flipped] @ torch.diag(torch.tensor([-1.0, -1.0, 1.0]))
    clean, found = clean_object(replace(motion, rotation=rotation), FPS)
    assert found.left_out[flipped].all()
    assert int(found.left_out.sum()) == 30
    assert np.delete(angles(motion, clean), range(50, 80)).max() < 0.1


def test_a_can_that_spins_about_its_axis_from_frame_to_frame_is_turned_back():
    motion = lifted(CAN)
    spin = np.random.default_rng(1).uniform(-np.pi, np.pi, FRAMES) * (np.arange(FRAMES) % 3 > 0)
    onto = Rotation.from_rotvec(np.outer(spin, [0, 0, 1])).as_matrix()
    rotation = motion.rotation[:, 0].double().numpy() @ onto
    clean, found = clean_object(track_of(CAN, rotation, motion.translation[:, 0].numpy()), FPS)
    axis = clean.rotation[:, 0, :, 2] - motion.rotation[:, 0, :, 2]
    assert float(axis.norm(dim=-1).max()) < 0.02
    steps = np.linalg.norm(
        Rotation.from_matrix(
            (clean.rotation[:-1, 0].mT @ clean.rotation[1:, 0]).double().numpy()
        ).as_rotvec(),
        axis=1,
    )
    assert np.degrees(steps.max()) < 6
    assert bool(found.symmetric.any())


def test_an_object_off_its_origin_stays_in_its_place_when_it_is_turned_back():
    cone = trimesh.creation.cone(0.04, 0.12, sections=64)
    askew = np.eye(4)
    askew[:3, :3] = Rotation.from_rotvec([0.4, -0.9, 0.2]).as_matrix()
    askew[:3, 3] = 0.1, -0.2, 0.05
    motion = lifted(mesh_of(cone.apply_transform(askew)))
    spin = np.random.default_rng(1).uniform(-np.pi, np.pi, FRAMES) * (np.arange(FRAMES) % 3 > 0)
    onto = Rotation.from_rotvec(np.outer(spin, askew[:3, 2])).as_matrix()
    turns = motion.rotation[:, 0].double().numpy()
    fixed = askew[:3, 3]
    shift = np.einsum("tij,tj->ti", turns, fixed - onto @ fixed)
    places = motion.translation[:, 0].numpy() + shift
    clean, _ = clean_object(track_of(motion.meshes[0], turns @ onto, places), FPS)
    apex = torch.tensor(fixed + 0.12 * askew[:3, 2], dtype=torch.float32)

    def seen(track: ObjectTrack) -> torch.Tensor:
        return track.rotation[:, 0] @ apex + track.translation[:, 0]

    assert float((seen(clean) - seen(motion)).norm(dim=-1).max()) < 0.004


def test_a_mesh_that_is_changed_in_place_is_looked_at_again():
    mesh = mesh_of(trimesh.creation.cylinder(0.04, 0.1, sections=64))
    shaky = shaken(lifted(mesh), 3.0, 0.002)
    first, _ = clean_object(shaky, FPS)
    aside = torch.tensor([0.3, 0.0, 0.1])
    mesh.verts.add_(aside)
    off = (shaky.rotation @ aside[:, None])[..., 0]
    again, _ = clean_object(replace(shaky, translation=shaky.translation - off), FPS)
    off = (again.rotation @ aside[:, None])[..., 0]
    torch.testing.assert_close(again.translation + off, first.translation, atol=1e-4, rtol=0)


def test_an_orientation_that_lasts_is_believed():
    motion = lifted(WEDGE)
    rotation = motion.rotation.clone()
    rotation[70:] = rotation[70:] @ torch.tensor([[-1.0, 0, 0], [0, -1, 0], [0, 0, 1]])
    noisy = replace(motion, rotation=rotation)
    clean, found = clean_object(noisy, FPS)
    assert not found.left_out.any()
    assert angles(noisy, clean).max() < 0.1


@pytest.mark.parametrize(("start", "end"), [(60, 0), (110, 130)])
def test_an_object_is_relied_on_in_the_orientation_of_most_frames(start, end):
    motion = lifted(WEDGE)
    rotation = motion.rotation.clone()
    rotation[start:] = rotation[start:] @ torch.diag(torch.tensor([-1.0, -1.0, 1.0]))
    clean, found = clean_object(replace(motion, rotation=rotation), FPS)
    evidence = evidence_of_poses(found, clean, FPS)
    assert evidence[end:].max() < 0.05
    assert end == 0 or evidence[:80].min() > 0.95
    assert any("turns faster than it can move" in words for words in found.sentences())


def test_fast_motion_is_no_jump():
    phase = np.clip((np.arange(FRAMES) - 40) / 60, 0, 1)
    turn = 6 * np.pi * (phase - np.sin(2 * np.pi * phase) / (2 * np.pi))
    rotation = Rotation.from_rotvec(np.outer(turn, [0.6, 0.0, 0.8])).as_matrix()
    spun = track_of(WEDGE, rotation, np.zeros((FRAMES, 3)))
    assert np.degrees(np.diff(turn).max()) > 30
    assert clean_object(spun, FPS)[0] is spun


def test_short_tracks_are_taken_as_exact():
    motion = shaken(lifted(WEDGE), 5.0, 0.01)
    short = replace(motion, rotation=motion.rotation[:10], translation=motion.translation[:10])
    assert clean_object(short, FPS)[0] is short


def test_the_place_is_followed_while_the_part_flips_about_another_point_than_its_middle():
    phase = np.clip((np.arange(FRAMES) - 60) / 12, 0, 1)
    path = np.outer((1 - np.cos(np.pi * phase)) / 2, [0.1, 0.2, 0.1])
    motion = track_of(WEDGE, np.tile(np.eye(3), (FRAMES, 1, 1)), path)
    noisy = shaken(motion, 1.0, 0.002)
    rotation = noisy.rotation.clone()
    rotation[57:75] = rotation[57:75] @ torch.tensor([[-1.0, 0, 0], [0, -1, 0], [0, 0, 1]])
    clean, found = clean_object(replace(noisy, rotation=rotation), FPS)
    assert found.left_out[57:75].all()
    assert float((clean.translation - motion.translation).norm(dim=-1).max()) < 0.02


def test_left_out_poses_are_given_as_they_were_beside_others_that_are_turned_back():
    motion = lifted(CAN)
    spin = np.random.default_rng(1).uniform(-np.pi, np.pi, FRAMES) * (np.arange(FRAMES) % 3 > 0)
    onto = Rotation.from_rotvec(np.outer(spin, [0, 0, 1])).as_matrix()
    rotation = (motion.rotation[:, 0].double().numpy() @ onto)[:, None]
    rotation[50:54] = rotation[50:54] @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    noisy = replace(motion, rotation=torch.from_numpy(rotation).float())
    _, found = clean_object(noisy, FPS)
    assert found.left_out[50:54].all()
    assert torch.allclose(found.aligned.rotation[50:54], noisy.rotation[50:54], atol=1e-6)


@pytest.mark.parametrize("fps", [60.0, 120.0])
def test_flips_of_a_third_of_a_second_are_left_out_at_any_frame_rate(fps):
    still = np.tile(np.eye(3), (round(3 * fps), 1, 1))
    rotation, flipped = still.copy(), slice(round(fps), round(fps) + round(fps / 3))
    rotation[flipped] = Rotation.from_rotvec([0.0, 0.0, 2.0]).as_matrix()
    place = np.zeros((len(still), 3))
    clean, found = clean_object(track_of(WEDGE, rotation, place), fps)
    assert found.left_out[flipped].all()
    assert angles(track_of(WEDGE, still, place), clean).max() < 1


@pytest.mark.parametrize("frames", [1, 5, 15])
@pytest.mark.parametrize("shake", [0.0, 0.004])
def test_places_that_no_motion_reaches_are_left_out(frames, shake):
    motion = lifted(WEDGE)
    given = shaken(motion, 10 * shake / 0.04, shake) if shake else motion
    translation = given.translation.clone()
    translation[70 : 70 + frames] += torch.tensor([0.3, 0.0, 0.0])
    clean, found = clean_object(replace(given, translation=translation), FPS)
    assert np.flatnonzero(found.left_out[:, 0].numpy()).tolist() == [*range(70, 70 + frames)]
    assert found.confidence[70 : 70 + frames].max() == 0
    off = (clean.translation - motion.translation).norm(dim=-1)
    assert off[70 : 70 + frames].max() < 0.03
    assert not shake or "shakes" in next(found.sentences())
    jumps = f"{numbered(frames, 'frame')} in which the pose of the object jumps, left out"
    assert jumps in found.sentences()


@pytest.mark.parametrize("frames", [5, 15, 25])
@pytest.mark.parametrize("carried", [False, True])
def test_places_to_which_an_object_leaps_for_a_while_are_left_out(frames, carried):
    motion = lifted(WEDGE)
    time = np.arange(FRAMES) / FPS
    swung = 0.25 * np.stack([np.sin(4 * time), np.cos(4 * time), 0 * time], axis=1)
    motion = track_of(WEDGE, np.tile(np.eye(3), (FRAMES, 1, 1)), swung) if carried else motion
    hand = swung + 0.005 * np.random.default_rng(0).standard_normal((FRAMES, 3))
    palm = RigidMotion(Rotation.identity(FRAMES), hand, np.ones(FRAMES, dtype=bool))
    translation = motion.translation.clone()
    start = 60 if carried else 105  # where it rests
    translation[start : start + frames] += torch.tensor([0.04, 0.03, 0.0])
    given = replace(motion, translation=translation)
    found = clean_object(given, FPS, (palm,) if carried else ())[1]
    assert np.flatnonzero(found.left_out[:, 0].numpy()).tolist() == [*range(start, start + frames)]


@pytest.mark.parametrize("seed", range(6))
def test_an_object_does_not_leap_where_the_hand_leaps_by_a_gross_error(seed):
    time = np.arange(FRAMES) / FPS
    swung = 0.25 * np.stack([np.sin(time), np.cos(time), 0 * time], axis=1)
    motion = track_of(WEDGE, np.tile(np.eye(3), (FRAMES, 1, 1)), swung)
    hand = swung + 0.002 * np.random.default_rng(seed).standard_normal((FRAMES, 3))
    hand[60:63] += [0.035, 0.025, 0.04]
    palm = RigidMotion(Rotation.identity(FRAMES), hand, np.ones(FRAMES, dtype=bool))
    cleaned, found = clean_object(motion, FPS, (palm,))
    assert not found.left_out.any()
    assert cleaned.translation.equal(motion.translation)


def test_a_place_that_lasts_is_believed():
    motion = lifted(WEDGE)
    translation = motion.translation.clone()
    translation[60:100] += torch.tensor([0.3, 0.0, 0.0])
    clean, found = clean_object(replace(motion, translation=translation), FPS)
    assert not found.left_out.any()
    torch.testing.assert_close(clean.translation, translation)


def test_an_object_that_is_thrown_and_one_that_is_stopped_do_not_jump():
    time = np.arange(FRAMES) / FPS
    flying = np.stack([3.0 * time, 0 * time, 2.0 * time - 4.9 * time**2], 1)
    struck = np.minimum(3.5 * time, 5.0)[:, None] * np.array([1.0, 0.0, 0.0])
    for place in (flying, struck):
        motion = track_of(WEDGE, np.tile(np.eye(3), (FRAMES, 1, 1)), place)
        clean, found = clean_object(motion, FPS)
        assert clean is motion
        assert not found.left_out.any()


def test_an_object_whose_position_and_rotation_are_possible_in_other_frames_is_not_relied_on():
    generator, after = np.random.default_rng(2), np.arange(45) >= 22
    places = np.where(after[:, None], 1.9, 0.0) + 0.004 * generator.standard_normal((45, 3))
    places[after] += 0.06 * generator.standard_normal((23, 3))
    turns = Rotation.from_rotvec(np.outer(after, [2.6, 0, 0]) + 0.01 * places)
    motion = track_of(WEDGE, turns.as_matrix(), places)
    clean, found = clean_object(motion, 120.0)
    assert bool(found.left_out.all())
    assert bool(clean.translation.isfinite().all())
    assert float(evidence_of_poses(found, clean, 120.0).max()) < 0.1
