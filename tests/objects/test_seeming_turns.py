"""A can and a ball whose tracker turns them as nothing moves them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial.transform import Rotation

from geneoh.geometry.mesh import Mesh
from geneoh.objects.palms import RigidMotion
from geneoh.objects.seeming_turns import without_seeming_turns
from geneoh.pipeline.examination.examined import examined
from geneoh.sequence.sequence import HandTrack, ObjectTrack

FRAMES, FPS = 120, 30.0
SEEN = np.ones(FRAMES, dtype=bool)


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    """A mesh whose origin is beside its centre."""
    verts = torch.from_numpy(np.array(shape.vertices + (0.02, 0.01, 0.05), dtype=np.float32))
    return Mesh(verts, torch.from_numpy(np.array(shape.faces)))


CAN = mesh_of(trimesh.creation.cylinder(0.03, 0.12, sections=64))
BALL = mesh_of(trimesh.creation.icosphere(3, 0.04))
BOX = mesh_of(trimesh.creation.box((0.05, 0.05, 0.1)))


def carried(mesh: Mesh) -> tuple[ObjectTrack, RigidMotion]:
    """An object that rests, and is then lifted and turned by a palm."""
    phase = np.clip((np.arange(FRAMES) - 40) / 60, 0, 1)
    ease = (1 - np.cos(np.pi * phase)) / 2
    turns = Rotation.from_rotvec(np.outer(ease, [0.5, -0.8, 1.1]))
    places = np.outer(ease, [0.1, 0.2, 0.3])
    palm = RigidMotion(turns, turns.apply([0.06, 0.0, 0.05]) + places, SEEN)
    return track_of(mesh, turns.as_matrix(), places), palm


def track_of(mesh: Mesh, rotation: np.ndarray, translation: np.ndarray) -> ObjectTrack:
    rotation, translation = torch.from_numpy(rotation), torch.from_numpy(translation)
    return ObjectTrack((mesh,), rotation.float()[:, None], translation.float()[:, None])


def turned(motion: ObjectTrack, vectors: np.ndarray) -> ObjectTrack:
    """The track turned about the object's centre, in its own frame."""
    middle = motion.meshes[0].center().double().numpy()
    rotation = motion.rotation[:, 0].double().numpy()
    new = rotation @ Rotation.from_rotvec(vectors).as_matrix()
    places = motion.translation[:, 0].double().numpy() + (rotation - new) @ middle
    return track_of(motion.meshes[0], new, places)


def spin(degrees: float) -> np.ndarray:
    return np.outer(np.radians(degrees) * np.arange(FRAMES) / FPS, [0, 0, 1.0])


def jitter(degrees: float) -> np.ndarray:
    return np.outer(
        np.radians(degrees) * np.random.default_rng(0).standard_normal(FRAMES), [0, 0, 1]
    )


def apart(one: ObjectTrack, other: ObjectTrack) -> float:
    """Change of the rotation from one track to the other over the frames, degrees."""
    between = (one.rotation[:, 0].double().mT @ other.rotation[:, 0].double()).numpy()
    change = Rotation.from_matrix(between[0].T @ between)
    return float(np.degrees(change.magnitude().max()))


@pytest.mark.parametrize("mesh", [CAN, BALL])
def test_an_object_that_moves_with_the_hand_keeps_its_track(mesh):
    motion, palm = carried(mesh)
    assert without_seeming_turns(motion, (palm,), FPS) == (motion, ())


@pytest.mark.parametrize("vectors", [spin(60), jitter(30)])
@pytest.mark.parametrize("mesh", [CAN, BALL])
def test_turns_that_nothing_explains_are_left_out(mesh, vectors):
    motion, palm = carried(mesh)
    clean, notes = without_seeming_turns(turned(motion, vectors), (palm,), FPS)
    assert apart(clean, motion) < 5
    assert len(notes) == 1
    middle = mesh.center()
    for track in (clean, turned(motion, vectors)):
        places = track.rotation[:, 0] @ middle + track.translation[:, 0]
        wanted = motion.rotation[:, 0] @ middle + motion.translation[:, 0]
        torch.testing.assert_close(places, wanted, atol=1e-5, rtol=0)


def test_a_can_that_is_upside_down_in_some_frames_keeps_its_axis():
    motion, palm = carried(CAN)
    vectors = spin(60)
    vectors[50:55] = [np.pi, 0, 0]
    clean, _ = without_seeming_turns(turned(motion, vectors), (palm,), FPS)
    assert apart(clean, motion) < 5


def test_an_object_of_another_shape_is_turned_as_it_is_seen():
    motion, palm = carried(BOX)
    spun = turned(motion, spin(60))
    assert without_seeming_turns(spun, (palm,), FPS)[0] is spun


def test_frames_without_a_pose_or_a_hand_do_not_count():
    motion, palm = carried(CAN)
    valid = torch.ones(FRAMES, 1, dtype=torch.bool)
    valid[60:70] = False
    spun = replace(turned(motion, spin(60)), valid=valid)
    palm = replace(palm, seen=SEEN & (np.arange(FRAMES) > 20))
    clean, _ = without_seeming_turns(spun, (palm,), FPS)
    assert apart(clean, motion) < 8
    assert clean.valid is not None
    assert clean.valid.equal(valid)


def test_the_hand_is_cleaned_against_an_object_that_does_not_spin():
    motion, palm = carried(CAN)
    points = 0.04 * np.random.default_rng(0).standard_normal((21, 3))
    joints = np.stack([turn.apply(points) for turn in palm.turns]) + palm.places[:, None]
    hand = HandTrack(
        "right", torch.ones(FRAMES, dtype=torch.bool), torch.from_numpy(joints).float()
    )
    found = examined((hand,), turned(motion, spin(60)), FPS)
    assert apart(found.object, motion) < 5
    assert any("turned about its axis" in note for note in found.notes)
