"""Whether a hand moves with the object that moves near it.

A hand that somebody waves an object at, or that stays where it is while the object swings past, is
near what moves without holding it. The networks would pull it after the object.
"""

import math
from functools import partial

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from geneoh.geometry.distance import MovingSurface

CARRIED_SPEED = 0.1
"""Speed of the object's surface above which something moves it, metres per second."""
CLOSE = 0.03  # decay of the weight of a keypoint with its distance from the surface, metres
SMOOTHED = 3.0
"""Standard deviation, in frames at 30 a second, of the filter of keypoints seen from the object."""
UNPROVEN_FRAMES = 5.0  # prior weight, in frames, of a hand that moves with the object


def moving_parts(surface: MovingSurface, fps: float) -> Bool[Tensor, "T Q"]:
    """Frames in which the surface of each part moves, by its displacement from a tenth of a second
    before to a tenth after."""
    frames, apart = len(surface.rotation), tenth_of_a_second(fps)
    found = torch.zeros(
        surface.rotation.shape[:2], dtype=torch.bool, device=surface.rotation.device
    )
    for part, (field, pose) in enumerate(surface.parts):
        verts = field.mesh.some_verts(32).to(surface.rotation)
        placed = pose.apply(verts.expand(frames, -1, -1))
        speed = (placed[2 * apart :] - placed[: -2 * apart]).norm(dim=-1).mean(-1)
        found[apart:-apart, part] = speed * fps / (2 * apart) > CARRIED_SPEED
    return found


def tenth_of_a_second(fps: float) -> int:
    """A tenth of a second in frames, one at least."""
    return max(1, round(fps / 10))


def left_behind(
    joints: Float[Tensor, "T 21 3"],
    surface: MovingSurface,
    moving: Bool[Tensor, "T Q"],
    fps: float,
    around: float,
) -> Float64[np.ndarray, " T"]:
    """Share of the object's motion near the hand that the hand does not share, around each frame.

    0 for a hand that moves with all that moves near it or turns it in its place, 1 for one that
    stays where it is. `moving` are the `moving_parts`, and `around` is the standard deviation of
    the filter over time, frames.
    """
    apart = tenth_of_a_second(fps)
    middle, wide = slice(apart, len(joints) - apart), 2 * apart
    smooth = partial(gaussian_filter1d, sigma=SMOOTHED * fps / 30, axis=0, mode="nearest")
    near, shares = [], []
    for part, (field, pose) in enumerate(surface.parts):
        seen = smooth(pose.inverse().apply(joints).cpu().double().numpy())
        places = torch.from_numpy(seen).to(joints)
        away = surface.of_parts([part]).query(pose.apply(places)).distance.nan_to_num(math.inf)
        weight = torch.exp(-(away.clamp(min=0) / CLOSE).square())[middle]
        over = (places[wide:] - places[:-wide]).square().sum(-1)
        centre = pose.apply(field.mesh.center().to(joints).expand(len(joints), 1, 3))[:, 0]
        offset = torch.from_numpy(smooth((centre - joints.mean(1)).cpu().double().numpy()))
        left = (offset[wide:] - offset[:-wide]).square().sum(-1, keepdim=True).to(joints)
        before, after = (
            pose.at(some).apply(places[middle]) for some in (slice(None, -wide), slice(wide, None))
        )
        moved = (after - before).square().sum(-1)
        missed = (weight * over.minimum(left).minimum(moved)).sum(-1)
        share = missed / (weight * moved).sum(-1).clamp(min=1e-12)
        near.append(weight.amax(-1))
        shares.append(torch.where(moving[middle, part], share, torch.inf))
    closest, which = torch.stack(near, -1).max(-1)
    counted = closest * moving[middle].gather(1, which[:, None])[:, 0]
    least = torch.stack(shares, -1).amin(-1).nan_to_num(posinf=0.0)
    values = np.zeros((len(joints), 2))
    values[middle] = torch.stack([counted, counted * least], -1).cpu().double().numpy()
    values = gaussian_filter1d(values, around, axis=0, mode="constant")
    weight, missed = (2 * math.pi) ** 0.5 * around * values.T
    return missed / (weight + UNPROVEN_FRAMES * fps / 30)
