"""Per-frame weight of the object in cleaning: reliability of its poses, and the hand's interaction.

Cleaning removes white noise from the object's poses, but not slowly varying errors. A pose error
larger than contact distances makes contact uninformative.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64
from scipy.ndimage import distance_transform_edt, gaussian_filter1d, minimum_filter1d
from torch import Tensor

from geneoh.errors import numbered
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.objects.examination import ObjectExamination
from geneoh.objects.facing import at_palm
from geneoh.objects.left_behind import left_behind, moving_parts
from geneoh.sequence.keypoints import palm_axes
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import blocks

TOLERATED, TOLERATED_BY_RAY = 0.012, 0.03
"""Noise of the object's surface at which its reliability is 0.5, metres; and the same for a hand
with a known ray from the camera, beside whose error along this ray such noise is small."""
FEW, ENOUGH = 0.3, 0.6
"""Share of the seen poses that agree with one another: reliability is 0 up to the first bound, and
not reduced from the second on."""
# durations are in frames at 30 frames a second
BRIDGED_FRAMES = 8.0  # decay of the reliability with the distance to the nearest frame that agrees
ACCELERATION_FRAMES = 4.0
"""Standard deviation of the Gaussian that averages accelerations around a frame."""
FADE_FRAMES = 3.0  # standard deviation of the filter that smooths reliability over time
SHIFT_FRAMES = 30.0  # standard deviation of the Gaussian that averages the shift of the hand
POSE_NOISE_FRAMES = 15.0  # correlation time of the noise of poses
NEAR, AWAY = 0.05, 0.09
"""Least distance over all frames between keypoints and surface, metres: up to the first bound the
hand interacts with the object, from the second on it does not. Keypoints lie 10 mm inside the
hand."""
BESIDE, APART = 0.1, 0.25
"""Distance in each frame, metres: up to the first bound the hand may approach or leave the object,
from the second on it moves independently."""

TOUCHING, NOT_TOUCHING = 0.02, 0.04
"""Distance of the nearest keypoint to the surface, metres: up to the first bound the hand may touch
the object, from the second on it does not. Noisy hands that hold are within 2 cm in 95 of 100
clips, except under camera noise, for which shifts along the camera ray are tried."""
RAY_ERROR = 0.1  # largest error along a camera ray, metres
SMOOTHED = 3.0
"""Standard deviation of the filter of keypoints before their distance is measured."""
TOUCH_FRAMES = 30.0  # frames around each one in which a touch counts
GONE, GONE_FRAMES = 0.08, 15.0
"""Distance from which on an object that moves has left the hand, metres, and frames around each one
in which that counts."""
WITH_IT, LEFT_BEHIND = 0.45, 0.6
"""Share of the object's motion near the hand that the hand does not share (`left_behind`): up to
the first bound the hand may move the object, from the second on something else does. Noisy hands
that hold are within 0.38, and within 0.51 where they are late by four frames; beside an object that
swings or passes they have 0.45 to 0.85."""
CLEAR, UNCLEAR = 0.016, 0.020
"""Standard deviation of SpatialDiff's shift, metres: up to the first bound the hand touches the
object, from the second on contact does not determine its position."""
SPUN, WHEEL = 0.75, 1.0
"""Full turns of the object in the palm within about `TOUCH_FRAMES`: up to the first bound fingers
may turn it, from the second on it spins like a wheel, over which even a hand at its axle slides."""
UNPROVEN_FRAMES = 3.0  # prior weight, in frames, of a touch while the object moves


def evidence_of_poses(
    examined: ObjectExamination,
    motion: ObjectTrack,
    fps: float,
    error: Float[Tensor, "T Q"] | None = None,
    tolerated: float = TOLERATED,
) -> Float[Tensor, "T Q"]:
    """Reliability, 0 to 1, of each pose of an examined track; 1 if a part is exact or never seen.

    `motion` is the track after cleaning, and `error` the expected one of poses by other causes than
    noise, metres. `tolerated` is `TOLERATED` or `TOLERATED_BY_RAY`."""
    found = torch.ones_like(examined.confidence)
    lost = examined.confidence == 0
    doubtful = examined.is_noisy | (lost.any(0) & ~lost.all(0))
    for part in torch.nonzero(doubtful)[:, 0].tolist():
        noise = examined.translation_noise + examined.rotation_noise * radius(motion.meshes[part])
        size = 3**0.5 * noise[:, part].double().cpu().numpy()
        sure = (examined.confidence > 0) & ~examined.doubted
        kept = sure[:, part].cpu().numpy()
        away = np.asarray(distance_transform_edt(~kept))  # with none kept, `share` is 0
        # interpolation over unseen frames misses the object's acceleration there
        missed = 0.5 * acceleration_around(motion, part, kept, fps) * np.square(away)
        # frames without a pose count neither as agreement nor as contradiction
        agree = kept.sum() / max((kept | examined.left_out[:, part].cpu().numpy()).sum(), 1)
        share = min(max((agree - FEW) / (ENOUGH - FEW), 0.0), 1.0)
        relied = share / (1 + np.square(size / tolerated) + np.square(missed / TOLERATED))
        relied = relied * np.exp(-np.square(away * 30 / fps / BRIDGED_FRAMES))
        relied = gaussian_filter1d(relied, FADE_FRAMES * fps / 30, mode="nearest")
        found[:, part] = torch.from_numpy(relied).to(found)
    return found if error is None else found / (1 + (error / TOLERATED).square())


def evidence_at_hand(
    poses: Float[Tensor, "T Q"], joints: Float[Tensor, "T 21 3"], surface: MovingSurface
) -> Float[Tensor, " T"]:
    """Reliability of each frame: the least among the parts near the hand. Parts that are apart from
    the hand, such as another object, are ignored.
    """
    if poses.shape[1] == 1 or bool((poses == 1).all()):
        return poses.amin(1)
    beside = share_between(distance_of_parts(joints, surface), BESIDE, APART).to(poses)
    return torch.maximum(poses, 1 - beside).amin(1)


def acceleration_around(
    motion: ObjectTrack, part: int, kept: Bool[np.ndarray, " T"], fps: float
) -> Float64[np.ndarray, " T"]:
    """Acceleration of a part's surface around each frame, metres per frame²: the root mean square
    over some vertices and over the seen frames, with Gaussian weights."""
    placed = placed_vertices(motion, part).cpu().numpy()
    squares = np.zeros(len(kept))
    squares[1:-1] = np.square(np.diff(placed, n=2, axis=0)).sum(-1).mean(1)
    seen = kept.copy()
    seen[[0, -1]] = False
    seen[1:-1] &= kept[:-2] & kept[2:]
    around = partial(gaussian_filter1d, sigma=ACCELERATION_FRAMES * fps / 30, mode="constant")
    return np.sqrt(around(seen * squares) / around(seen.astype(float)).clip(1e-9))


def placed_vertices(motion: ObjectTrack, part: int) -> Float64[Tensor, "T V 3"]:
    """Some of a part's vertices in each frame, world frame, metres."""
    verts = motion.meshes[part].some_verts(16).to(motion.rotation.device).double()
    rotation, translation = motion.rotation[:, part].double(), motion.translation[:, part].double()
    return verts @ rotation.mT + translation[:, None]


def radius(mesh: Mesh) -> float:
    """Root mean square distance of a mesh's vertices from their mean, metres."""
    return float((mesh.verts - mesh.verts.mean(0)).square().sum(-1).mean().sqrt())


def evidence_of_nearness(
    joints: Float[Tensor, "T 21 3"],
    surface: MovingSurface,
    fps: float,
    ray: Float[Tensor, "T 3"] | None = None,
) -> Float[Tensor, " T"]:
    """Interaction of a hand with its object in each frame, 0 to 1.

    It is 0 in all frames if the hand never comes near; and in frames in which the hand is apart,
    moves beside the object without a touch, has it at its back, or all parts spin in the hand. It
    is a right hand. `ray` is the unit direction from the camera to the hand, along which the hand
    may have a large error.
    """
    nearest = distance_of_nearest(joints, surface).cpu()
    deals = share_between(nearest.min(), NEAR, AWAY)
    beside = share_between(nearest, BESIDE, APART).numpy()
    fade = FADE_FRAMES * fps / 30
    # exactly zero in frames apart, because the object may be metres away a moment later
    least = minimum_filter1d(beside, 2 * round(2 * fade) + 1, mode="nearest")
    smooth = gaussian_filter1d(least, fade, mode="nearest")
    near = float(deals) * torch.from_numpy(smooth).to(joints)
    facing = at_palm(joints, surface, SMOOTHED * fps / 30, TOUCH_FRAMES * fps / 30)
    return near * facing * touching(joints, surface, fps, ray) * gripping(joints, surface, fps)


def touching(
    joints: Float[Tensor, "T 21 3"],
    surface: MovingSurface,
    fps: float,
    ray: Float[Tensor, "T 3"] | None,
) -> Float[Tensor, " T"]:
    """Whether the hand may touch the object around each frame, from 1 to 0 (it moves beside it).

    A hand that holds has a keypoint near the surface even if it is noisy. A hand farther off would
    be taken for one with a position error and be pulled to the object. A hand that moves the object
    must be near the surface while the object moves, and move with it; an object at rest may be
    touched within a second before or after. An object that moves far from the hand, as one that
    was thrown or dropped, tells little of the time before and after.
    """
    filtered = gaussian_filter1d(joints.cpu().numpy(), SMOOTHED * fps / 30, axis=0, mode="nearest")
    points = torch.from_numpy(filtered).to(joints)
    away = distance_of_nearest(points, surface)
    if ray is not None and float(away.max()) > TOUCHING:
        shifts = [0.0, *torch.linspace(-RAY_ERROR, RAY_ERROR, 9).tolist()]
        moved = (points + shift * ray[:, None] for shift in shifts[1:])
        every = torch.stack([away, *(distance_of_nearest(each, surface) for each in moved)])
        best = int(every.mean(1).argmin())
        away, joints = every[best], joints + shifts[best] * ray[:, None]
    nearest, parts = away.cpu().double().numpy(), moving_parts(surface, fps)
    moves, gone = parts.any(1).cpu().double().numpy(), nearest > GONE
    wide, narrow = TOUCH_FRAMES * fps / 30, GONE_FRAMES * fps / 30
    frames, sums = UNPROVEN_FRAMES * fps / 30, 0.0
    for counted, sigma in ((moves * ~gone, wide), (moves * gone, narrow)):
        around = partial(gaussian_filter1d, sigma=sigma, mode="constant")
        scale = (2 * math.pi) ** 0.5 * sigma
        frames, sums = frames + scale * around(counted), sums + scale * around(counted * nearest)
    least = minimum_filter1d(nearest, 2 * round(wide) + 1, mode="nearest")
    distance = torch.from_numpy(np.maximum(sums / frames, least))
    behind = torch.from_numpy(left_behind(joints, surface, parts, fps, wide))
    with_it = share_between(behind, WITH_IT, LEFT_BEHIND)
    return (share_between(distance, TOUCHING, NOT_TOUCHING) * with_it).to(joints)


def gripping(
    joints: Float[Tensor, "T 21 3"], surface: MovingSurface, fps: float
) -> Float[Tensor, " T"]:
    """1 where some part may be gripped, 0 where every part spins continuously in the palm."""
    around, wide = partial(gaussian_filter1d, axis=0, mode="constant"), TOUCH_FRAMES * fps / 30
    frames, palm = (2 * math.pi) ** 0.5 * wide, palm_axes(joints[:, None])
    found = torch.zeros(len(joints))
    for _, pose in surface.parts:
        seen = palm.mT @ pose.rotation
        steps = matrix_to_axis_angle(seen[:-1].mT @ seen[1:]).cpu().double().numpy()
        turns = np.zeros((len(joints), 3))
        turns[1:] = frames * around(steps, wide) / (2 * math.pi)
        share = share_between(torch.from_numpy(turns).norm(dim=-1), SPUN, WHEEL).numpy()
        least = minimum_filter1d(share, 2 * round(wide) + 1, mode="nearest")
        found = torch.maximum(found, torch.from_numpy(least).to(found))
    return found.to(joints)


def evidence_of_place(width: Float[Tensor, " T"]) -> Float[Tensor, " T"]:
    """1 where contact determines the position of the hand, 0 where many positions are equally
    probable, as for a hand near the object without a touch. `width` is the standard deviation of
    SpatialDiff's shift, metres."""
    return share_between(width, CLEAR, UNCLEAR).to(width)


def distance_of_nearest(
    points: Float[Tensor, "T P 3"], surface: MovingSurface
) -> Float[Tensor, " T"]:
    """Distance of the nearest point to the surface in each frame, metres, clamped to 0..`APART`."""
    surface = replace(surface, within=APART)
    found = [surface.at(some).query(points[some]).distance for some in blocks(len(points))]
    return torch.cat(found).nan_to_num(math.inf).amin(-1).clamp(0, APART)


def distance_of_parts(
    points: Float[Tensor, "T P 3"], surface: MovingSurface
) -> Float[Tensor, "T Q"]:
    """`distance_of_nearest` to each part of the object."""
    parts = (surface.of_parts([part]) for part in range(len(surface.fields)))
    return torch.stack([distance_of_nearest(points, part) for part in parts], dim=1)


def share_between(
    distance: Float[Tensor, "*N"], whole: float, none: float
) -> Float64[Tensor, "*N"]:
    """Linear ramp: 1 up to `whole`, 0 from `none` on."""
    return ((none - distance.double()) / (none - whole)).clamp(0, 1)


def blended(
    alone: Float[Tensor, "S T 21 3"],
    held: Float[Tensor, "S T 21 3"],
    poses: Float[Tensor, " T"],
    near: Float[Tensor, " T"],
    fps: float,
) -> Float[Tensor, "S T 21 3"]:
    """Blend samples that were cleaned with and without the object, by the object's reliability.

    The slowly varying part of the shift between them is more certain than that of a single frame,
    because the noise of poses averages out over seconds: it gets an additional weight, from its
    ratio to the error of that average.

    `alone` and `held` are the same samples, metres, cleaned without and with the object. `poses` is
    the reliability of each frame's poses, and `near` the interaction of the hand with the object,
    both from 0 to 1.
    """
    shift = (held - alone).mean((0, 2)).cpu().double().numpy()
    relied, wide = poses.cpu().double().numpy(), SHIFT_FRAMES * fps / 30
    around = partial(gaussian_filter1d, sigma=wide, axis=0, mode="constant")
    mean = around(relied[:, None] * shift) / around(relied).clip(1e-9)[:, None]
    # reliability e means noise of variance (1 / e - 1) TOLERATED^2, see `evidence_of_poses`
    frames = (2 * math.pi) ** 0.5 * wide / (POSE_NOISE_FRAMES * fps / 30)
    precision = frames * around(relied / (1 - relied).clip(1e-3))
    signal = (mean**2).sum(1) * precision / TOLERATED**2
    more = (signal / (1 + signal) - relied).clip(0)
    lasting = near[:, None] * torch.from_numpy(more[:, None] * mean).to(alone)
    return alone.lerp(held, (near * poses)[:, None, None]) + lasting[:, None]


def doubt(evidence: Float[Tensor, " T"]) -> Iterator[str]:
    """A sentence for the user about frames in which the object has little weight."""
    if count := int((evidence < 0.5).sum()):
        yield (
            f"in {numbered(count, 'frame')} the object is too noisy, too long unseen or too far "
            "away to rely on, does not seem to be touched, moves without the hand, is at the back "
            "of the hand or spins in it: there the hand is cleaned mostly by the prior of hand "
            "motion alone"
        )
