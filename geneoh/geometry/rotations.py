"""Rotations in three dimensions: axis-angle, matrices, the 6D form of networks, fits to points.

Conventions: matrices act on column vectors (p_to = R @ p_from); axis-angle vectors are in radians,
turning counter-clockwise around their direction; any leading batch axes. All mappings have finite
gradients everywhere unless they say otherwise.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.choices import AXES, Axis

SMALL_ANGLE_SQUARED = 1e-6  # below it, the next term of the power series vanishes in float32
ROTATION_TOLERANCE = 1e-2
"""Largest entry of R^T R - I of a rotation; half precision causes about 1e-3."""
TO_Z = {
    "x": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
    "y": ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "z": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "-x": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)),
    "-y": ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)),
    "-z": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
}
"""Rotations by which each axis comes to point along z."""


def axis_angle_to_matrix(axis_angle: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B 3 3"]:
    """Rotation matrix of an axis-angle vector (Rodrigues' formula), any length of the vector."""
    squared = (axis_angle * axis_angle).sum(-1)[..., None, None]
    small = squared < SMALL_ANGLE_SQUARED
    # Both branches of `where` are differentiated, so the unused one must be finite too.
    angle = torch.where(small, 1.0, squared).sqrt()
    sine = torch.where(small, 1 - squared / 6, angle.sin() / angle)
    # 1 - cos as a square of the half angle's sine keeps its digits at small angles.
    cosine = torch.where(small, 0.5 - squared / 24, 2 * ((angle / 2).sin() / angle) ** 2)
    cross = skew(axis_angle)
    eye = torch.eye(3, dtype=axis_angle.dtype, device=axis_angle.device)
    return eye + sine * cross + cosine * (cross @ cross)


def shortest_turn(
    start: Float[Tensor, "*#B 3"], end: Float[Tensor, "*#B 3"]
) -> Float[Tensor, "*B 3 3"]:
    """The rotation by the smallest angle that takes one direction to another; no zero vectors.

    Between opposite directions it is one of many. It has no gradient at equal directions.
    """
    # in double precision, because the cross product of nearly opposite directions cancels digits
    pair = torch.broadcast_tensors(start, end)
    before, after = (normalize(each.double(), dim=-1) for each in pair)
    across, cosine = torch.linalg.cross(before, after), (before * after).sum(-1)
    sine = across.norm(dim=-1)
    other = torch.linalg.cross(before, torch.eye(3).to(before)[before.abs().argmin(-1)])
    opposite = (sine < 1e-12) & (cosine < 0)
    axis = normalize(torch.where(opposite[..., None], other, across), dim=-1)
    return axis_angle_to_matrix(torch.atan2(sine, cosine)[..., None] * axis).to(start)


def skew(vector: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B 3 3"]:
    """The matrix of the cross product with a vector: skew(v) @ p = v x p."""
    x, y, z = vector.unbind(-1)
    zero = torch.zeros_like(x)
    rows = [zero, -z, y, z, zero, -x, -y, x, zero]
    return torch.stack(rows, dim=-1).unflatten(-1, (3, 3))


def is_rotation(matrix: Float[Tensor, "*B 3 3"]) -> Bool[Tensor, "*B"]:
    """Whether R^T R differs from I by at most ROTATION_TOLERANCE, and R is no reflection.

    False where a number is NaN or infinite.
    """
    eye = torch.eye(3, dtype=matrix.dtype, device=matrix.device)
    error = (matrix.transpose(-1, -2) @ matrix - eye).abs().amax((-1, -2))
    return (error <= ROTATION_TOLERANCE) & (torch.linalg.det(matrix) > 0)


def matrix_to_quat_wxyz(rotation: Float[Tensor, "*B 3 3"]) -> Float[Tensor, "*B 4"]:
    """Unit quaternion (w, x, y, z) of a rotation matrix, with w >= 0.

    The matrix gives 4 q q^T without any root; its row with the largest diagonal entry is q up to
    scale and never small (Bar-Itzhack 2000, the noise-free case).
    """
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = rotation.flatten(-2).unbind(-1)
    x, y, z, xy, xz, yz = m21 - m12, m02 - m20, m10 - m01, m01 + m10, m02 + m20, m12 + m21
    rows = [
        *(1 + m00 + m11 + m22, x, y, z),
        *(x, 1 + m00 - m11 - m22, xy, xz),
        *(y, xy, 1 - m00 + m11 - m22, yz),
        *(z, xz, yz, 1 - m00 - m11 + m22),
    ]
    outer = torch.stack(rows, dim=-1).unflatten(-1, (4, 4))
    # the same as argmax, which is ten times slower on a diagonal
    best = outer.diagonal(dim1=-2, dim2=-1).max(-1).indices[..., None, None]
    quat = outer.gather(-2, best.expand(*best.shape[:-1], 4))[..., 0, :]
    quat = normalize(quat, dim=-1)
    return torch.where(quat[..., :1] < 0, -quat, quat)


def matrix_to_axis_angle(rotation: Float[Tensor, "*B 3 3"]) -> Float[Tensor, "*B 3"]:
    """Axis-angle vector of a rotation matrix, angle in [0, pi]; accurate at both ends.

    At exactly pi the axis is known up to its sign, and the gradient is that of the branch taken.
    """
    quat = matrix_to_quat_wxyz(rotation)
    w, xyz = quat[..., :1], quat[..., 1:]
    squared = (xyz * xyz).sum(-1, keepdim=True)
    small = squared < SMALL_ANGLE_SQUARED
    sine = torch.where(small, 1.0, squared).sqrt()
    # angle / sin(angle / 2), by its series around the identity.
    scale = torch.where(small, 2 + squared / 3, 2 * torch.atan2(sine, w) / sine)
    return scale * xyz


def matrix_to_rotation_6d(rotation: Float[Tensor, "*B 3 3"]) -> Float[Tensor, "*B 6"]:
    """First and second column of the matrix, a continuous representation for networks.

    Source: Zhou et al., On the Continuity of Rotation Representations in Neural Networks, 2019.
    """
    return rotation[..., :2].transpose(-1, -2).flatten(-2)


def rotation_6d_to_matrix(rotation_6d: Float[Tensor, "*B 6"]) -> Float[Tensor, "*B 3 3"]:
    """Rotation matrix by Gram-Schmidt from two columns, which must not be parallel."""
    return axes_along(*rotation_6d.unflatten(-1, (2, 3)).unbind(-2))


def axes_along(
    first: Float[Tensor, "*B 3"], second: Float[Tensor, "*B 3"]
) -> Float[Tensor, "*B 3 3"]:
    """Axes as columns, by Gram-Schmidt: `first`, the part of `second` across it, their normal."""
    x = normalize(first, dim=-1)
    y = normalize(second - (x * second).sum(-1, keepdim=True) * x, dim=-1)
    return torch.stack([x, y, torch.linalg.cross(x, y)], dim=-1)


def interpolate_rotations(
    start: Float[Tensor, "*#B 3 3"],
    end: Float[Tensor, "*#B 3 3"],
    fraction: Float[Tensor, "*#B"],
) -> Float[Tensor, "*B 3 3"]:
    """Spherical interpolation along the shorter arc: `start` at fraction 0, `end` at 1."""
    turn = matrix_to_axis_angle(start.transpose(-1, -2) @ end)
    return start @ axis_angle_to_matrix(fraction[..., None] * turn)


def nearest_rotations(matrices: Float[Tensor, "*B 3 3"]) -> Float[Tensor, "*B 3 3"]:
    """The rotation nearest to each matrix in the Frobenius norm, never a reflection.

    Applied to the mean of rotation matrices it gives their mean rotation (Moakher 2002). Computed
    in float64.
    """
    left, _, right = torch.linalg.svd(matrices.double())
    sign = torch.ones_like(left[..., 0])
    sign[..., 2] = torch.linalg.det(left @ right).sign()
    return (left * sign[..., None, :] @ right).to(matrices.dtype)


def kabsch(
    points_from: Float[Tensor, "*#B P 3"],
    points_to: Float[Tensor, "*#B P 3"],
    weights: Float[Tensor, "*#B P"] | None = None,
) -> tuple[Float[Tensor, "*B 3 3"], Float[Tensor, "*B 3"]]:
    """Rigid motion (R, t) with the least weighted squared error of R @ from + t against `to`.

    Never a reflection. Not for backpropagation: the gradient of the SVD is infinite for symmetric
    point sets. Computed in float64, returned in the points' own dtype.

    The points must not all lie on one line. Weights must not be negative and need a positive sum;
    by default all are equal.

    Source: Kabsch 1976, with Umeyama's sign (1991).
    """
    start, goal = torch.broadcast_tensors(points_from.double(), points_to.double())
    weight = torch.ones_like(start[..., 0]) if weights is None else weights.double()
    weight = (weight / weight.sum(-1, keepdim=True))[..., None]
    start_mean, goal_mean = (weight * start).sum(-2), (weight * goal).sum(-2)
    start, goal = start - start_mean[..., None, :], goal - goal_mean[..., None, :]
    rotation = nearest_rotations((weight * goal).transpose(-1, -2) @ start)
    translation = goal_mean - (rotation @ start_mean[..., None])[..., 0]
    return rotation.to(points_from.dtype), translation.to(points_from.dtype)


def turn_up(up: Axis, to: Axis = "z") -> Float[Tensor, "3 3"]:
    """The rotation from a world in which axis `up` points up to one in which axis `to` does."""
    return torch.tensor(TO_Z[to]).T @ torch.tensor(TO_Z[up])


def nearest_axis(direction: Float[Tensor, " 3"]) -> Axis:
    """The signed coordinate axis nearest to a direction."""
    index = int(direction.abs().argmax())
    return AXES[index + 3 * bool(direction[index] < 0)]
