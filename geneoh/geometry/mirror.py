"""The reflection x -> -x of tensors and arrays, which turns a left hand into a right one.

It is its own inverse, and exact in floating point, because only signs change.
"""

from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

MIRROR = (-1.0, 1.0, 1.0)  # signs of the coordinates of a mirrored point

Array = TypeVar("Array", Tensor, np.ndarray)


def mirror_signs(like: Array) -> Array:
    """`MIRROR` as a tensor or array (3,) with the dtype and device of another one."""
    if isinstance(like, Tensor):
        return like.new_tensor(MIRROR)
    return np.array(MIRROR, dtype=like.dtype)


def mirror_points(points: Array) -> Array:
    """Points or vectors (..., 3) in the mirror."""
    return points * mirror_signs(points)


def mirror_axis_angle(vectors: Array) -> Array:
    """Axis-angle vectors (..., 3) in the mirror, which reverses the sense of a rotation."""
    return vectors * -mirror_signs(vectors)


def mirror_axes(axes: Float[Tensor, "B 3"], slides: Bool[Tensor, " B"]) -> Float[Tensor, "B 3"]:
    """Axes of joints in the mirror; a rotation reverses its sense, a translation does not."""
    return torch.where(slides[:, None], mirror_points(axes), mirror_axis_angle(axes))


def mirror_rotations(rotation: Array) -> Array:
    """Rotation matrices (..., 3, 3) in the mirror: S R S with S the reflection."""
    signs = mirror_signs(rotation)
    return signs[:, None] * rotation * signs


def mirror_faces(faces: Array) -> Array:
    """Faces (F, 3) with their corners in the other order, so that they still look outward."""
    return faces[:, [0, 2, 1]]
