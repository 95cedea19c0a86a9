"""The motion of a camera by its given poses, and what it saw in the world's frame.

Poses of a camera are noisy, leap at cuts of the video, and repeat where they come from a slower
sensor. Any smooth motion near them will do, as the result is given back by the same motion.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Float64
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
from geneoh.sequence.repeats import without_repeats
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
    track, _ = without_repeats(track)
    known = track.observed[:, 0].cpu().numpy()
    poses = Rigid(track.rotation[:, 0], track.translation[:, 0])
    places, found = (x.double().cpu().numpy() for x in (poses.translation, poses.rotation))
    turns = Rotation.from_matrix(found)
    if np.linalg.norm(middle := places.mean(0)) > FARTHEST_SCENE:
        places = places - middle
    for start, stop in pairwise([0, *leaps_of_camera(places, turns, sequence.fps), len(places)]):
        if stop - start >= LEAST_FRAMES:
            path, turned, trusted = places[start:stop], turns[start:stop], known[start:stop]
            noise = max(noise_level(path), LEAST_NOISE)
            places[start:stop], _ = smooth_points(path, trusted, noise)
            noise = max(noise_level(path_of(turned)), LEAST_NOISE)
            found[start:stop] = smooth_rotations(turned, trusted, noise)[0].as_matrix()
    return Rigid(*(torch.from_numpy(values).to(poses.rotation) for values in (found, places)))


def in_steady_world(sequence: Sequence) -> Sequence:
    """The sequence of a moving camera in the world's frame, by its `steady_camera`; one that is in
    the world as it is."""
    camera = steady_camera(sequence)
    return sequence if camera is None else in_world(sequence, camera)


def leaps_of_camera(
    places: Float64[np.ndarray, "T 3"], turns: Rotation, fps: float
) -> Iterator[int]:
    """The first frames after leaps, as at a cut of the video or where a lost track starts again."""
    shifts, turned = np.diff(places, axis=0), increments(turns)
    steps = np.linalg.norm(shifts, axis=1) + np.linalg.norm(turned, axis=1)
    around = maximum_filter(steps, footprint=AROUND_LEAP, mode="constant")
    leaps = (steps > CAMERA_LEAP * max(1.0, 30 / fps)) & (steps > CAMERA_RATIO * around)
    yield from (np.flatnonzero(leaps) + 1).tolist()
