"""A box that a palm carries, rests or passes on, and its track with faults."""

from dataclasses import replace

import numpy as np
import torch
import trimesh
from scipy.spatial.transform import Rotation

from geneoh.geometry.mesh_files import from_trimesh
from geneoh.objects.palms import RigidMotion
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import ObjectTrack

FRAMES, LOST = 60, slice(25, 37)
MESH = from_trimesh(trimesh.creation.box((0.05, 0.1, 0.2)).apply_translation((0.3, 0.0, 0.0)))
IN_PALM = np.array([0.02, 0.05, 0.08])  # of the object's centre, metres
TIME = np.linspace(0, 2 * np.pi, FRAMES)
PLACES = 0.2 * np.stack([np.sin(TIME), np.cos(TIME), 0.3 * np.sin(2 * TIME)], axis=1)
TURNS = Rotation.from_rotvec(np.stack([np.sin(TIME), 0 * TIME, np.cos(2 * TIME)], axis=1))


def palm(noise: float = 0.0, turned: float = 0.0) -> RigidMotion:
    """A palm on its way, with white noise in metres and radians per axis."""
    generator = np.random.default_rng(0)
    shift, turn = generator.normal(size=(2, FRAMES, 3))
    turns = TURNS * Rotation.from_rotvec(turned * turn)
    return RigidMotion(turns, PLACES + noise * shift, np.ones(FRAMES, dtype=bool))


AT_REST = replace(palm(), turns=Rotation.identity(FRAMES), places=0 * PLACES)


def track(turns: Rotation, places: np.ndarray) -> ObjectTrack:
    """The object with its centre at these places."""
    rotation = torch.from_numpy(turns.as_matrix()).float()[:, None]
    translation = torch.from_numpy(places).float()[:, None] - rotation @ MESH.center()
    return ObjectTrack((MESH,), rotation, translation)


def lost(motion: ObjectTrack, frames: slice = LOST) -> ObjectTrack:
    """The same without poses in some frames, filled on straight lines as they are read."""
    valid = torch.ones(FRAMES, 1, dtype=torch.bool)
    valid[frames] = False
    return fill_object(motion, valid)


def off(motion: ObjectTrack, truth: ObjectTrack, frames: slice = LOST) -> float:
    """Mean distance of the vertices from the true ones, metres."""
    placed = (
        MESH.verts @ each.rotation[frames, 0].mT + each.translation[frames]
        for each in (motion, truth)
    )
    one, other = placed
    return float((one - other).norm(dim=-1).mean())


HELD = track(TURNS, PLACES + TURNS.apply(IN_PALM))


def passed(first: ObjectTrack, last: ObjectTrack, frame: int) -> ObjectTrack:
    """The object moves as the first track up to a frame, and as the last one from there on."""
    both = zip((first.rotation, first.translation), (last.rotation, last.translation), strict=True)
    rotation, translation = (torch.cat([one[:frame], other[frame:]]) for one, other in both)
    return replace(first, rotation=rotation, translation=translation)


def resting(frame: int) -> ObjectTrack:
    """The object at rest where the palm has it in a frame."""
    return HELD[torch.full((FRAMES,), frame)]
