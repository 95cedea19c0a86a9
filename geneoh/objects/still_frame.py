"""The still frame of a scene that a moving camera sees, such as one on a head.

The networks learned from clips whose world is at rest, where an object that moves is held. In the
frame of a moving camera an object at rest moves too, and a hand that reaches for it would be
corrected as if it held it. So the camera's motion is estimated by the object's motion while no hand
moves with it. While a hand does, the motions of camera and object cannot be distinguished, and the
camera counts as still.
"""

from functools import partial
from itertools import accumulate

import numpy as np
import torch
from jaxtyping import Float, Float64
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation
from torch import Tensor

from geneoh.geometry.rigid import Rigid
from geneoh.objects.evidence import distance_of_parts, placed_vertices, share_between
from geneoh.sequence.gaps import filled_keypoints
from geneoh.sequence.keypoints import PALM
from geneoh.sequence.sequence import HandTrack, ObjectTrack

NEAR, AWAY = 0.05, 0.10
"""Distance of the nearest keypoint to a part, metres: up to the first bound the hand may move with
it, from the second on it does not. Keypoints lie 10 mm inside the hand."""
WITH, OVER = 0.03, 0.10
"""The same for the speed of the palm over the part, metres per second."""
ALONG_RAY = 0.3
"""Share of that speed that counts along the hand's camera ray, where it is known: errors of an
estimator along it drift by centimetres while the hand holds the object."""
SLOW = 0.5
"""Speed of a part up to which those bounds tell whether the camera moves, metres per second. They
grow with that of faster ones: what noise moves a hand over the object that it walks with is not the
camera's motion."""
RATE_FRAMES = 4.0
"""Standard deviation, in frames at 30 a second, of the Gaussian that smooths tracks for their
speeds: of 10 mm of white noise it leaves 14 mm per second."""
KNOWN = 0.95
"""Share of the smoothing of a track that observed frames have at least where its speed is known."""
RESTING, MOVING = 0.03, 0.06
"""Speed of a part's surface up to which it rests, and from which it moves, metres per second."""
SELDOM = 0.1
"""Share of the frames in which an object rests from which on the camera stands still."""
FREE_SECONDS = 1 / 3
"""Least time in which no hand moves with the object, for an estimate of the camera's motion."""
CALM = 0.5
"""Ratio of a palm's speed to that over the object, while no hand moves with it, below which the
hand is calm and something else moves the object, such as a hand without a track."""
RELIED = 0.4
"""Least mean reliability of the poses of each part: noise looks like motion of the camera too."""


def still_frame(
    hands: tuple[HandTrack, ...], motion: ObjectTrack, fps: float, relied: Float[Tensor, "T Q"]
) -> Rigid | None:
    """The pose of the given frame in the still frame, in each video frame; None where the given one
    seems to be still, or the object does not show its motion.

    An object that rests now and then shows that the camera is still; else `camera_moves` decides.
    The still frame is that of the first video frame. `motion` is the cleaned track, and `relied`
    the reliability of its poses, 0 to 1 (`geneoh.objects.evidence`).
    """
    parts = range(motion.rotation.shape[1])
    speeds = np.stack([speed_of(placed_vertices(motion, part), fps) for part in parts], 1)
    rests = (speeds < RESTING).any(1).mean() > SELDOM
    if rests or bool((relied.mean(0) < RELIED).any()):
        return None
    tracks = [filled_keypoints(hand) for hand in hands]
    fast = np.maximum(speeds / SLOW, 1.0)
    held = held_shares(hands, tracks, motion, fps, fast)
    if not camera_moves(tracks, motion, held, speeds, fps):
        return None
    return stilled(motion, held_shares(hands, tracks, motion, fps))


def camera_moves(
    tracks: list[Float[Tensor, "T 21 3"]],
    motion: ObjectTrack,
    held: Float64[np.ndarray, "T Q"],
    speeds: Float64[np.ndarray, "T Q"],
    fps: float,
) -> bool:
    """Whether the object moves while no hand moves with it, but not beside a hand that keeps calm.

    `tracks` are the keypoints of the hands, `held` their `held_shares`, and `speeds` those of the
    object's parts, metres per second.
    """
    is_free = held.min(1) < 0.5
    least = held[is_free].argmin(1)[:, None]
    free = partial(np.take_along_axis, indices=least, axis=1)
    if is_free.sum() < FREE_SECONDS * fps or np.median(free(speeds[is_free])) < MOVING:
        return False
    for joints in tracks:
        own = speed_of(joints[:, list(PALM)], fps)[is_free]
        over = free(palm_speeds(joints, motion, fps)[is_free])
        if np.median(own) < CALM * np.median(over):
            return False
    return True


def held_shares(
    hands: tuple[HandTrack, ...],
    tracks: list[Float[Tensor, "T 21 3"]],
    motion: ObjectTrack,
    fps: float,
    fast: Float64[np.ndarray, "T Q"] | float = 1.0,
) -> Float64[np.ndarray, "T Q"]:
    """Degree, 0 to 1, to which some hand is at each part and moves with it, by its keypoints in
    `tracks`; while a hand is not observed, as before and after. `fast` scales the bounds of speeds.
    """
    surface, found = motion.surface(), np.zeros(motion.rotation.shape[:2])
    smooth = partial(gaussian_filter1d, sigma=RATE_FRAMES * fps / 30, axis=0, mode="nearest")
    times = np.arange(len(found))
    for hand, joints in zip(hands, tracks, strict=True):
        points = torch.from_numpy(smooth(joints.cpu().numpy())).to(joints)
        near = share_between(distance_of_parts(points, surface), NEAR, AWAY).cpu().numpy()
        over = torch.from_numpy(palm_speeds(joints, motion, fps, hand.camera_ray) / fast)
        share = near * share_between(over, WITH, OVER).numpy()
        weight = smooth(hand.observed.cpu().double().numpy())
        known = weight >= min(KNOWN, weight.max())
        each = [np.interp(times, times[known], part[known]) for part in share.T]
        found = np.maximum(found, np.stack(each, 1))
    return found


def palm_speeds(
    joints: Float[Tensor, "T 21 3"],
    motion: ObjectTrack,
    fps: float,
    ray: Float[Tensor, "T 3"] | None = None,
) -> Float64[np.ndarray, "T Q"]:
    """Speed of the palm over each part, metres per second, less of it along a `ray`."""
    poses = map(Rigid, motion.rotation.unbind(1), motion.translation.unbind(1))
    palm, speeds = joints[:, list(PALM)], []
    for pose in poses:
        there = pose.inverse()
        along = None if ray is None else (there.rotation @ ray[..., None])[..., 0]
        speeds.append(speed_of(there.apply(palm), fps, along))
    return np.stack(speeds, 1)


def speed_of(
    points: Float[Tensor, "T P 3"], fps: float, along: Float[Tensor, "T 3"] | None = None
) -> Float64[np.ndarray, " T"]:
    """Mean speed of some points, metres per second, of their smoothed tracks. In the direction
    `along` the share `ALONG_RAY` of it counts."""
    tracks, sigma = points.cpu().double().numpy(), RATE_FRAMES * fps / 30
    rates = gaussian_filter1d(tracks, sigma, axis=0, order=1, mode="nearest")
    if along is not None:
        ray = along.cpu().double().numpy()[:, None]
        rates -= (1 - ALONG_RAY) * (rates * ray).sum(-1, keepdims=True) * ray
    return np.linalg.norm(rates, axis=-1).mean(-1) * fps


def stilled(motion: ObjectTrack, held: Float64[np.ndarray, "T Q"]) -> Rigid:
    """The pose of the given frame in the one in which the least held part moves, from each frame to
    the next, by the share of its motion to which it is held."""
    frames, least = len(held), np.minimum(held[:-1], held[1:])
    part, share = least.argmin(1), least.min(1)
    given = Rigid(motion.rotation.double(), motion.translation.double())
    steps, poses = np.arange(frames - 1), given.matrices().cpu().numpy()
    before, after = poses[steps, part], poses[steps + 1, part]
    step = np.linalg.inv(before) @ after
    turn = Rotation.from_matrix(step[:, :3, :3]).as_rotvec()
    step[:, :3, :3] = Rotation.from_rotvec(share[:, None] * turn).as_matrix()
    step[:, :3, 3] *= share[:, None]
    changes = before @ step @ np.linalg.inv(after)
    still = np.stack(list(accumulate(changes, np.matmul, initial=np.eye(4))))
    turns = Rotation.from_matrix(still[:, :3, :3]).as_matrix()
    return Rigid(*(torch.from_numpy(x).to(motion.rotation) for x in (turns, still[:, :3, 3])))
