"""Turns of a solid of revolution about its axis, and of a ball, that are an estimator's alone.

A bottle looks the same however it is turned about its axis, so an estimator of poses may let it
spin, jitter or leap about that. The hand that holds it then seems to slide around it. Turns that
neither a palm nor rest explains are replaced: the object turns about its axis as what it moves with
does, the world or a palm. Where fingers truly turn it, nothing is lost, because the surface is the
same.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Bool, Float64
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from geneoh.geometry.mesh import Mesh
from geneoh.objects.cleaning import symmetry_of
from geneoh.objects.examination import EXACT_ROTATION
from geneoh.objects.palms import RigidMotion
from geneoh.objects.smoothing import LEAST_FRAMES, smooth_points
from geneoh.objects.symmetry import Symmetry
from geneoh.sequence.sequence import ObjectTrack

UNEXPLAINED = np.radians(10.0)
"""Least turn within half a second, root mean square over frames, that is replaced. With cylinders
in place of their objects, synthetic clips have 0.2 degrees, with noisy hands up to 7; a bottle that
spins once in ten seconds has 18."""
TURN_SECONDS = 0.5
MOVE_SECONDS = 0.1  # time over which it is measured what an object moves with, seconds
REACH = 0.05  # distance from the centre of the points that show the motion of an axis, metres
CALM = 0.002  # motion in the world or in a palm that counts as none, metres

Turns = Float64[np.ndarray, "T 3 3"]


def without_seeming_turns(
    motion: ObjectTrack, palms: tuple[RigidMotion, ...], fps: float
) -> tuple[ObjectTrack, tuple[str, ...]]:
    """The track without unexplained turns of solids of revolution about their axes, and notes.

    The same track object if there are none. `palms` are those of the input hands."""
    if len(motion.rotation) < LEAST_FRAMES:
        return motion, ()
    smooth = tuple(palm.without_noise for palm in palms)
    rotation, translation, notes = motion.rotation.clone(), motion.translation.clone(), []
    for part in motion.seen_parts:
        mesh, seen = motion.meshes[part], motion.observed[:, part].cpu().numpy()
        turns, places = (
            each[:, part].double().cpu().numpy() for each in (motion.rotation, motion.translation)
        )
        found = calm_turns(turns, places, seen, mesh, smooth, fps)
        if found is None:
            continue
        calm, center, about = found
        places = places + (turns - calm) @ center
        rotation[:, part] = torch.from_numpy(calm).to(rotation)
        translation[:, part] = torch.from_numpy(places).to(translation)
        notes.append(
            f"{motion.name_of(part)} looks the same however it is turned about its {about}: its "
            "turns about that which neither the hand nor rest explains were left out"
        )
    if not notes:
        return motion, ()
    return replace(motion, rotation=rotation, translation=translation), tuple(notes)


def calm_turns(
    turns: Turns,
    places: Float64[np.ndarray, "T 3"],
    seen: Bool[np.ndarray, " T"],
    mesh: Mesh,
    palms: tuple[RigidMotion, ...],
    fps: float,
) -> tuple[Turns, Float64[np.ndarray, " 3"], str] | None:
    """Rotations of a part that show the same surfaces without unexplained turns; the point of it
    that stays; and what it turns about, in words. None if it shows no such turns."""
    part = RigidMotion(Rotation.from_matrix(turns), places, seen)
    if seen.sum() < LEAST_FRAMES or not turned_in_all(part, palms, fps) > UNEXPLAINED:
        return None
    symmetry = symmetry_of(mesh)
    if not symmetry.is_ball and symmetry.axis is None:
        return None
    part = replace(part, places=part.turns.apply(symmetry.center) + places)
    calm = moved_along(part, symmetry, palms, fps)
    if symmetry.axis is not None:
        calm = nearest_about(symmetry, turns, calm)
    change = Rotation.from_matrix(turns.swapaxes(1, 2) @ calm)
    lag = min(max(1, round(TURN_SECONDS * fps)), len(turns) - 1)
    apart = (change[:-lag].inv() * change[lag:]).magnitude()
    both = seen[:-lag] & seen[lag:]
    if not both.any() or np.sqrt(np.square(apart[both]).mean()) <= UNEXPLAINED:
        return None
    return calm, symmetry.center, "centre" if symmetry.is_ball else "axis"


def turned_in_all(part: RigidMotion, palms: Iterable[RigidMotion], fps: float) -> float:
    """The turn of a part within half a second that is seen from the world and from each palm, root
    mean square over frames, radians: the least of them in each frame."""
    lag = min(max(1, round(TURN_SECONDS * fps)), len(part.places) - 1)
    views = [part.turns, *(palm.turns.inv() * part.turns for palm in palms)]
    least = np.min([(turns[:-lag].inv() * turns[lag:]).magnitude() for turns in views], axis=0)
    return float(np.sqrt(np.square(least).mean()))


def moved_along(
    part: RigidMotion, symmetry: Symmetry, palms: tuple[RigidMotion, ...], fps: float
) -> Turns:
    """Rotations of a part that turns about its axis, a ball about its centre, as that does which it
    moves with: the world or a palm, weighted by how little it moves in their frames."""
    middle = part.without_noise.places
    points, axes = middle[:, None], None
    if symmetry.axis is not None:
        axes = directions(part, symmetry.axis)
        points = np.stack([middle + REACH * axes, middle - REACH * axes], axis=1)
    steps = [np.zeros((len(points) - 1, 3))]
    weights = [stillness(points, fps)]
    for palm in palms:
        steps.append((palm.turns[1:] * palm.turns[:-1].inv()).as_rotvec())
        back = palm.turns.inv().as_matrix()
        local = np.einsum("tij,tkj->tki", back, points - palm.places[:, None])
        weights.append(stillness(local, fps))
    share = np.stack(weights)[..., None]
    step = (share * np.stack(steps)).sum(0) / share.sum(0)
    found = part.turns[0].as_matrix()
    calm = [found]
    for at, turn in enumerate(step):
        if axes is not None:
            along = axes[at] + axes[at + 1]
            turn = (turn @ along) / (along @ along) * along
            turn = (Rotation.from_rotvec(turn) * between(axes[at], axes[at + 1])).as_rotvec()
        found = Rotation.from_rotvec(turn).as_matrix() @ found
        calm.append(found)
    return np.stack(calm)


def directions(part: RigidMotion, axis: Float64[np.ndarray, " 3"]) -> Float64[np.ndarray, "T 3"]:
    """The direction of the axis of a part in each frame, world frame, without white noise and
    without flips of its sign."""
    along = part.turns.apply(axis)
    turned = np.where((along[1:] * along[:-1]).sum(1) < 0, -1.0, 1.0)
    along[1:] *= np.cumprod(turned)[:, None]
    tip = RigidMotion(part.turns, along, part.seen)
    smooth, _ = smooth_points(along, part.seen, max(tip.place_noise(), EXACT_ROTATION / 4))
    return smooth / np.linalg.norm(smooth, axis=1, keepdims=True)


def stillness(points: Float64[np.ndarray, "T K 3"], fps: float) -> Float64[np.ndarray, " N"]:
    """Weight of each step in a frame in which these points move little."""
    lag = min(max(1, round(MOVE_SECONDS * fps)), len(points) - 1)
    squares = np.square(points[lag:] - points[:-lag]).sum(-1).mean(1)
    around = uniform_filter1d(
        np.pad(squares, (0, lag - 1), mode="edge"), lag, origin=(lag - 1) // 2
    )
    return (around + CALM**2) ** -2


def between(one: Float64[np.ndarray, " 3"], other: Float64[np.ndarray, " 3"]) -> Rotation:
    """The least rotation of one unit vector onto another."""
    across = np.cross(one, other)
    length = float(np.linalg.norm(across))
    return Rotation.from_rotvec(across * (np.arctan2(length, one @ other) / max(length, 1e-12)))


def nearest_about(symmetry: Symmetry, turns: Turns, wanted: Turns) -> Turns:
    """Each rotation, turned about the axis of revolution to come as near as possible to the wanted
    one; if need be, after a half turn across it."""
    assert symmetry.axis is not None, "only solids of revolution have one"
    found = []
    for turn, aim in zip(turns, wanted, strict=True):
        first = turn @ symmetry.nearest(turn, aim[None])[0][0]
        rest, axis = first.T @ aim, symmetry.axis
        sine = axis @ np.array(
            [rest[2, 1] - rest[1, 2], rest[0, 2] - rest[2, 0], rest[1, 0] - rest[0, 1]]
        )
        angle = np.arctan2(sine, np.trace(rest) - axis @ rest @ axis)
        found.append(first @ Rotation.from_rotvec(angle * axis).as_matrix())
    return np.stack(found)
