"""The motion of a camera by its given poses, and what it saw in the world's frame.

Poses of a camera are noisy, leap at cuts of the video, and repeat where they come from a slower
sensor. Any smooth motion near them will do, as the result is given back by the same motion.
"""

from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Bool, Float64
from scipy.ndimage import maximum_filter
from scipy.spatial.transform import Rotation

from geneoh.geometry.rigid import Rigid
from geneoh.objects.smoothing import (
    LEAST_FRAMES,
    increments,
    noise_level,
    path_of,
    smooth_points,
    smooth_rotations,
)
from geneoh.sequence.placing import camera_of, in_world
from geneoh.sequence.repeats import repeated_poses, without_repeats
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.sequence.validation import FARTHEST_SCENE

LEAST_NOISE = 1e-5  # floor of the noise of a camera, metres and radians
CAMERA_LEAP, CAMERA_RATIO = 0.1, 3.0
"""Least leap of a camera, radians plus metres (larger below 30 frames a second), and its least
ratio to every step around it."""
AROUND_LEAP = np.array([1, 1, 1, 1, 1, 0, 1, 1, 1, 1, 1])  # steps that are compared with a leap


def steady_camera(sequence: Sequence) -> Rigid | None:
    """The poses of the moving camera of a sequence, camera to world, without their white noise;
    poses without noise hardly change, and fewer than `LEAST_FRAMES` between leaps not at all. None
    where the sequence is in the world. A world whose origin is far away gets one near the camera,
    because single precision has too few digits there."""
    poses = camera_of(sequence.camera_to_world)
    if poses is None:
        return None
    track = ObjectTrack((), poses.rotation[:, None], poses.translation[:, None])
    repeats = repeated_poses(track)
    known = ~repeats[:, 0].cpu().numpy()
    places, found = (x.double().cpu().numpy() for x in (poses.translation, poses.rotation))
    origin = places.mean(0)
    if np.linalg.norm(origin) <= FARTHEST_SCENE:
        origin = np.zeros(3)
    leaps = leaps_of_camera(places, Rotation.from_matrix(found), known, sequence.fps)
    for start, stop in pairwise([0, *leaps, len(places)]):
        part, _ = without_repeats(track[start:stop], repeats[start:stop])
        moved, turned = (x[:, 0].double().cpu().numpy() for x in (part.translation, part.rotation))
        path, turns, trusted = moved - origin, Rotation.from_matrix(turned), known[start:stop]
        if stop - start >= LEAST_FRAMES:
            noise = max(noise_level(path), LEAST_NOISE)
            path, _ = smooth_points(path, trusted, noise)
            noise = max(noise_level(path_of(turns)), LEAST_NOISE)
            turned = smooth_rotations(turns, trusted, noise)[0].as_matrix()
        places[start:stop], found[start:stop] = path, turned
    return Rigid(*(torch.from_numpy(values).to(poses.rotation) for values in (found, places)))


def in_steady_world(sequence: Sequence) -> Sequence:
    """The sequence of a moving camera in the world's frame, by its `steady_camera`; one that is in
    the world as it is."""
    camera = steady_camera(sequence)
    return sequence if camera is None else in_world(sequence, camera)


def leaps_of_camera(
    places: Float64[np.ndarray, "T 3"], turns: Rotation, known: Bool[np.ndarray, " T"], fps: float
) -> list[int]:
    """The first frames after leaps, as at a cut of the video or where a lost track starts again;
    poses that are not `known` repeat those before."""
    frames = np.flatnonzero(known)
    shifts = np.diff(places[frames], axis=0)
    turned = increments(turns[frames])  # pyright: ignore[reportArgumentType]  # scipy's stubs
    steps = np.linalg.norm(shifts, axis=1) + np.linalg.norm(turned, axis=1)
    around = maximum_filter(steps, footprint=AROUND_LEAP, mode="constant")
    least = CAMERA_LEAP * max(1.0, 30 / (fps * known.mean()))
    leaps = (steps > least) & (steps > CAMERA_RATIO * around)
    return frames[1:][leaps].tolist()
