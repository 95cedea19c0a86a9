"""Energy terms of the hand fit as linearised residuals: normal equations per frame.

The unknowns of a frame are 51: an increment w of each joint's local rotation (R <- R exp(w),
16 x 3) and of the wrist position (3). Turning joint j by w in its own frame moves a point p below
it by (G_j w) x (p - p_j), with G_j the joint's global rotation and p_j its centre.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.model import HandModel, ShapedHand
from geneoh.hand.skeleton import (
    MANO_FROM_OPENPOSE,
    OPENPOSE_FROM_MANO,
    PARENTS,
    TIP_PARENTS,
    forward_kinematics,
)
from geneoh.hand.spheres import (
    PAIRS_OF_FINGERS,
    finger_clearance,
    hand_scale,
    hand_spheres,
    sphere_centers,
)

UNKNOWNS = 51


@dataclass(frozen=True)
class HandState(Bundle):
    """Hand parameters of S samples over T frames, the unknowns of the fit, world frame."""

    rotations: Float[Tensor, "S T 16 3 3"]
    wrist: Float[Tensor, "S T 3"]

    def moved(self, step: Float[Tensor, "S T 51"]) -> "HandState":
        """The state after an increment of all unknowns."""
        turn = axis_angle_to_matrix(step[..., :48].unflatten(-1, (16, 3)))
        return HandState(self.rotations @ turn, self.wrist + step[..., 48:])

    def joints(self, shaped: ShapedHand) -> Float[Tensor, "S T 21 3"]:
        """Keypoints of a hand in this state."""
        return shaped.joints_from_rotations(self.rotations, self.wrist)

    def verts(self, shaped: ShapedHand) -> Float[Tensor, "S T V 3"]:
        """Vertices of a hand in this state."""
        return shaped.verts_from_rotations(self.rotations, self.wrist).verts

    @property
    def pose(self) -> Float[Tensor, "S T 16 3"]:
        """Axis-angle of every joint."""
        return matrix_to_axis_angle(self.rotations)


@dataclass(frozen=True)
class Equations(Bundle):
    """Normal equations of squared residuals: energy, half gradient and Gauss-Newton matrix."""

    energy: Float[Tensor, "S T"]
    gradient: Float[Tensor, "S T 51"]
    matrix: Float[Tensor, "S T 51 51"]

    def __add__(self, other: "Equations") -> "Equations":
        """Normal equations of the sum of two energy terms."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Equations(*(mine + theirs for mine, theirs in pairs))


def normal_equations(
    residual: Float[Tensor, "S T R"], jacobian: Float[Tensor, "S T R 51"]
) -> Equations:
    """Normal equations of R squared residuals in each frame."""
    return Equations(
        residual.square().sum(-1),
        torch.einsum("...ru,...r->...u", jacobian, residual),
        jacobian.transpose(-1, -2) @ jacobian,
    )


def _below() -> Float[Tensor, "16 16"]:
    """Matrix with 1 at (a, j) where joint j is joint a or a descendant of it."""
    table = torch.eye(16, dtype=torch.float32)
    for joint in range(1, 16):
        parent = PARENTS[joint]
        while parent >= 0:
            table[parent, joint] = 1
            parent = PARENTS[parent]
    return table


BELOW = _below()
MOVES_KEYPOINT = torch.cat(
    [BELOW.T - torch.eye(16, dtype=torch.float32), BELOW.T[list(TIP_PARENTS)]]
)[list(OPENPOSE_FROM_MANO)].nonzero()
"""Pairs (k, j): turning joint j moves keypoint k."""
MOST_OVERLAPS = 12
"""Pairs of spheres of different fingers that are pushed apart in a frame, the deepest ones."""


@dataclass(frozen=True)
class MovingKeypoints:
    """The keypoints of a hand and their derivatives by the unknowns, with its posed joints."""

    points: Float[Tensor, "S T 21 3"]
    slope: Float[Tensor, "S T 21 3 51"]
    turn: Float[Tensor, "S T 16 3 3"]  # global rotations of the joints
    centers: Float[Tensor, "S T 16 3"]  # their centres, in MANO order


def moving_keypoints(state: HandState, shaped: ShapedHand) -> MovingKeypoints:
    """The keypoints of a hand in this state, with their derivatives."""
    offsets = shaped.offsets.expand(*state.wrist.shape[:-1], 20, 3)
    joints, turn = forward_kinematics(state.rotations, state.wrist, offsets)
    centers = joints[..., list(MANO_FROM_OPENPOSE[:16]), :]
    moved, by = MOVES_KEYPOINT.to(joints.device).unbind(1)
    arm = joints[..., moved, :] - centers[..., by, :]
    axes = turn[..., by, :, :].mT  # row c: the world direction of the joint's local axis c
    columns = joints.new_zeros(*joints.shape[:-1], 16, 3, 3)  # (S, T, 21, joint, axis, xyz)
    columns[..., moved, by, :, :] = torch.linalg.cross(
        axes, arm[..., None, :].expand_as(axes), dim=-1
    )
    rotate = columns.permute(0, 1, 2, 5, 3, 4).flatten(-2)  # (S, T, 21, xyz, 16 * 3)
    eye = torch.eye(3).to(arm).expand(*rotate.shape[:-1], 3)
    return MovingKeypoints(joints, torch.cat([rotate, eye], dim=-1), turn, centers)


def keypoint_term(
    keypoints: MovingKeypoints,
    target: Float[Tensor, "S T 21 3"],
    weight: Float[Tensor, "S T 21"],
) -> Equations:
    """Squared distance to target keypoints; `weight` is 1 / standard deviation, 1/m."""
    residual = (keypoints.points - target) * weight[..., None]
    jacobian = keypoints.slope * weight[..., None, None]
    return normal_equations(residual.flatten(-2), jacobian.flatten(-3, -2))


def finger_term(keypoints: MovingKeypoints, shaped: ShapedHand, weight: float) -> Equations:
    """Overlap of spheres of different fingers (see `geneoh.hand.spheres`), metres, times `weight`,
    1/m: the `MOST_OVERLAPS` deepest ones of each frame."""
    joints = keypoints.points
    gap = finger_clearance(*hand_spheres(joints, hand_scale(shaped.offsets)))
    gap, index = gap.topk(MOST_OVERLAPS, dim=-1, largest=False)
    weights = BETWEEN_FINGERS.to(joints)[index]  # each difference of centres, by the keypoints
    apart = torch.nn.functional.normalize(weights @ joints, dim=-1)
    overlapping = (gap < 0).to(gap) * weight
    along = weights[..., None] * apart[..., None, :] * overlapping[..., None, None]
    rows = along.flatten(-2) @ keypoints.slope.flatten(-3, -2)
    return normal_equations(gap * overlapping, rows)


def _between_fingers() -> Float[Tensor, "C 21"]:
    """For each pair of spheres of different fingers, how far each keypoint moves the first sphere,
    less how far it moves the second one."""
    centers = sphere_centers(torch.eye(21, dtype=torch.float32))
    first, second = PAIRS_OF_FINGERS
    return centers[first] - centers[second]


BETWEEN_FINGERS = _between_fingers()


def pose_term(state: HandState, model: HandModel, prior: float, limit: float) -> Equations:
    """Pose prior and joint limits: deviation from the relaxed pose in units of `pose_std`, times
    `prior`, and overshoot of the joint limits in radians, times `limit` (1/rad)."""
    pose = state.pose[..., 1:, :]
    toward = (pose - model.pose_mean[1:]) / model.pose_std[1:] * prior
    over = (pose - model.pose_high[1:]).clamp(min=0) + (pose - model.pose_low[1:]).clamp(max=0)
    slope = (prior / model.pose_std[1:]).expand_as(pose)
    hit = (over != 0).to(pose) * limit
    # d(axis-angle)/dw is the identity for small rotations only, but the steps are damped
    gradient = torch.zeros(*pose.shape[:-2], UNKNOWNS).to(pose)
    diagonal = torch.zeros_like(gradient)
    gradient[..., 3:48] = (toward * slope + over * limit * hit).flatten(-2)
    diagonal[..., 3:48] = (slope.square() + hit.square()).flatten(-2)
    energy = toward.square().sum((-1, -2)) + (over * limit).square().sum((-1, -2))
    return Equations(energy, gradient, torch.diag_embed(diagonal))


@dataclass(frozen=True)
class Planes:
    """Tangent planes that K hand vertices per sample and frame should lie on, world frame."""

    verts: Int[Tensor, "S T K"]  # indices of the vertices
    closest: Float[Tensor, "S T K 3"]  # a point of each plane
    normal: Float[Tensor, "S T K 3"]  # unit normal of each plane
    weight: Float[Tensor, "S T K"]  # 1 / standard deviation, 1/m; 0 ignores a vertex


def surface_term(
    state: HandState, shaped: ShapedHand, keypoints: MovingKeypoints, planes: Planes
) -> Equations:
    """Signed height of the vertices over their planes, with target zero. The Jacobian neglects the
    derivative of the pose correctives, which are about a millimetre. `keypoints` are those of the
    state."""
    verts, normal = planes.verts, planes.normal
    turn, centers = keypoints.turn, keypoints.centers
    model = shaped.model
    frames = state.wrist.shape[:-1]
    rest = shaped.corrected(state.rotations).expand(*frames, 3, -1)
    rest = rest.gather(-1, verts[..., None, :].expand(*frames, 3, -1))
    skin = model.skin_weights.T[:, verts].movedim(0, -2)[..., None, :]  # (S, T, joint, 1, vertex)
    shift = centers - (turn @ shaped.joints[..., None])[..., 0]
    each = skin * (turn @ rest[..., None, :, :] + shift[..., None])  # (S, T, joint, xyz, vertex)
    below = BELOW.to(skin)
    carried = (below @ each.flatten(-2)).unflatten(-1, (3, -1))
    share = below @ skin[..., 0, :]
    arm = carried - share[..., None, :] * centers[..., None]
    across = torch.linalg.cross(arm, normal.mT[..., None, :, :].expand_as(arm), dim=-2)
    rotate = (turn.mT @ across).flatten(-3, -2)
    jacobian = torch.cat([rotate, normal.mT], dim=-2) * planes.weight[..., None, :]
    height = ((each.sum(-3).mT - planes.closest) * normal).sum(-1) * planes.weight
    return normal_equations(height, jacobian.mT)


def steadiness(
    state: HandState, weight: Float[Tensor, " 51"]
) -> tuple[Float[Tensor, "S T"], Float[Tensor, "S T 51"]]:
    """Energy and half gradient of the change between neighbouring frames; for rotations, of the
    axis-angle of R_t^T R_{t+1}. `solve_coupled_frames` adds the matrix of this term."""
    rotations, wrist = state.rotations, state.wrist
    change = matrix_to_axis_angle(rotations[:, :-1].transpose(-1, -2) @ rotations[:, 1:])
    change = torch.cat([change.flatten(-2), wrist.diff(dim=1)], dim=-1)
    pull = weight.square() * change
    energy = torch.zeros_like(wrist[..., 0])
    gradient = change.new_zeros(*wrist.shape[:-1], UNKNOWNS)
    energy[:, 1:] += (pull * change).sum(-1)
    gradient[:, 1:] += pull
    gradient[:, :-1] -= pull
    return energy, gradient
