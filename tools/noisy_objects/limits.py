"""How near solvers come to the true track if they know what only the ground truth tells."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.spatial.transform import Rotation

from geneoh.choices import ObjectNoise
from geneoh.objects.cleaning import clean_object
from geneoh.objects.drift import DRIFT_SECONDS
from geneoh.objects.holding import Frame
from geneoh.objects.palms import world_path
from geneoh.objects.refine import fading_differences, poses_of, refine_object, solve
from geneoh.objects.symmetry import Symmetry
from geneoh.sequence.object_noise import DEGREES, METRES_PER_DEGREE
from geneoh.sequence.sequence import ObjectTrack, Sequence
from tools.noisy_objects.cases import off
from tools.noisy_objects.clips import MADE, RECORDING, clip_of, symmetry_of, with_noisy_object

FILTERS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0)
"""Standard deviations in frames of Gaussian filters, of which the ground truth chooses the best."""
STILL = 0.0003
"""True step in metres up to which the object is known to rest."""
WINDOW = 5
"""Frames over which the true accelerations are averaged."""

Poses = tuple[Rotation, np.ndarray]
SHAKY: tuple[ObjectNoise, ...] = ("shaky_2", "shaky_10")


def lines_of_limits(seeds: int) -> Iterator[str]:
    """The remaining error of an object after each solver, as a share of the input's error."""
    names = ("smoothed", "refined with the true hand", "best filter")
    names += ("true accelerations and rests", "true motion, one lasting error")
    yield f"| clip | noise | input, mm | {' | '.join(names)} |"
    yield "|---" * (3 + len(names)) + "|"
    for name in (RECORDING, *MADE):
        clean, symmetry = clip_of(name), symmetry_of(name)
        for kind in SHAKY:
            noisy = [with_noisy_object(clean, kind, seed, symmetry) for seed in range(seeds)]
            found = np.mean([limits_of(clean, n.object, kind, symmetry) for n in noisy], axis=0)
            cells = " | ".join(f"{value / found[0]:.2f}" for value in found[1:])
            yield f"| {name} | {kind} | {found[0]:.1f} | {cells} |"


def limits_of(
    clean: Sequence, given: ObjectTrack, kind: ObjectNoise, symmetry: Symmetry
) -> list[float]:
    """Errors in mm of a noisy track and of what each solver makes of it."""
    smooth, examined = clean_object(given, clean.fps)
    refined = refine_object(smooth, examined, clean.hands, clean.fps)
    truth, seen, start = (poses_of(track, 0) for track in (clean.object, given, smooth))
    filtered = [track_of(given, along(start, seen, size)) for size in FILTERS]
    lasting = (truth[0].inv() * seen[0]).as_rotvec().mean(0), (seen[1] - truth[1]).mean(0)
    moved = truth[0] * Rotation.from_rotvec(lasting[0]), truth[1] + lasting[1]
    informed = told_motion(truth, seen, start, kind, clean.fps)

    def error(track: ObjectTrack) -> float:
        return float(off(track, clean.object, symmetry).mean())

    best = min(map(error, filtered))
    return [
        *map(error, (given, smooth, refined)),
        best,
        *(error(track_of(given, poses)) for poses in (informed, moved)),
    ]


def track_of(given: ObjectTrack, poses: Poses) -> ObjectTrack:
    """A track with other poses of its one part."""
    rotation = torch.from_numpy(poses[0].as_matrix()).to(given.rotation)[:, None]
    translation = torch.from_numpy(poses[1]).to(rotation)[:, None]
    return replace(given, rotation=rotation, translation=translation)


def along(start: Poses, seen: Poses, size: float) -> Poses:
    """A noisy track after a Gaussian filter; rotations are filtered along a path close to them."""
    gap = world_path(start[0]) + (seen[0] * start[0].inv()).as_rotvec()
    turned, places = (gaussian_filter1d(x, size, axis=0, mode="nearest") for x in (gap, seen[1]))
    return Rotation.from_rotvec(turned - world_path(start[0])) * start[0], places


def told_motion(truth: Poses, seen: Poses, start: Poses, kind: ObjectNoise, fps: float) -> Poses:
    """The solver of `refine_object`, given the noise, true sizes of accelerations, and rests."""
    count = len(seen[1])
    noise = np.array([np.radians(DEGREES[kind]), METRES_PER_DEGREE * DEGREES[kind]]) / 6**0.5
    steps = np.linalg.norm(np.diff(truth[1], axis=0), axis=1)
    steps += 0.05 * np.linalg.norm(np.diff(world_path(truth[0]), axis=0), axis=1)
    rest = (steps < STILL) / (STILL / 3) ** 2
    turn, shift = Frame.of_world(count).step(np.arange(count - 1))
    bends = [np.square(np.diff(x, n=2, axis=0)).mean(1) for x in (world_path(truth[0]), truth[1])]
    stiff = [
        1 / (uniform_filter1d(b, WINDOW) + (0.02 * n) ** 2)
        for b, n in zip(bends, noise, strict=True)
    ]
    stay, ones, none = np.exp(-1 / (DRIFT_SECONDS * fps)), np.ones(count), np.zeros((count - 2, 3))
    loose, sizes = 0 * ones, [(n, n) for n in noise]
    second = fading_differences(ones > 0)
    moves = [(turn, shift, rest)]
    bend = second, none, stiff[1]
    places = solve(seen[1], ones, sizes[1], stay, loose, [], moves, bend)
    turns = start[0]
    for _ in range(4):
        gap, steps = (seen[0] * turns.inv()).as_rotvec(), np.diff(world_path(turns), axis=0)
        moves, bend = [(turn, -steps, rest / 36)], (second, -np.diff(steps, axis=0), stiff[0])
        change = solve(gap, ones, sizes[0], stay, loose, [], moves, bend)
        turns = Rotation.from_rotvec(change) * turns
    return turns, places
