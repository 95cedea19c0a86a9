"""The hand model of one side: rest mesh, shape, skinning, joint limits, and how it is posed.

Three frozen stages, each a pure function of the previous one: `HandModel` (MANO's own fields),
`ShapedHand` (one shape, rest pose) and `PosedHand` (vertices and keypoints in the world).
Everything follows the device and dtype of its tensors, is differentiable, and broadcasts over any
batch axes.

Frame of the rest pose: fingers towards -x for the right hand (+x for the left), palm towards -y,
thumb towards +z. Linear blend skinning with pose correctives, as in MANO (Romero et al. 2017,
equations 1 to 3); the keypoints are the 16 joints and one surface vertex per fingertip, which moves
rigidly with the distal bone.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import OTHER_SIDE, Side
from geneoh.geometry.mirror import mirror_axis_angle, mirror_faces, mirror_points, mirror_signs
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import MANO_FROM_OPENPOSE, PARENTS, TIP_PARENTS, forward_kinematics


@dataclass(frozen=True)
class PosedHand(Bundle):
    """Hands in the world frame, metres."""

    verts: Float[Tensor, "*B V 3"]
    joints: Float[Tensor, "*B 21 3"]
    """Keypoints in OpenPose order."""


@dataclass(frozen=True, eq=False)
class HandModel(Bundle):
    """One side of a hand model in its rest pose, in MANO's fields and conventions."""

    name: str
    """Which model the betas belong to: "embedded", "mano" or "mano-as-shipped" (see `mano`)."""
    side: Side
    template: Float[Tensor, "V 3"]
    """Mean shape; the wrist joint is not at the origin (MANO's convention O)."""
    shape_dirs: Float[Tensor, "V 3 S"]
    """Displacement per unit of beta; betas are standard normal over people."""
    pose_dirs: Float[Tensor, "V 3 135"]
    """Displacement per unit of (local rotation minus identity), joints 1 to 15, row by row."""
    joint_regressor: Float[Tensor, "16 V"]
    skin_weights: Float[Tensor, "V 16"]
    faces: Int[Tensor, "F 3"]
    tip_verts: tuple[int, int, int, int, int]
    """Vertex at the tip of index, middle, pinky, ring, thumb (the order of `TIP_PARENTS`)."""
    pose_low: Float[Tensor, "16 3"]
    """Lower joint limits, per axis-angle component; the wrist's row is unbounded."""
    pose_high: Float[Tensor, "16 3"]
    pose_mean: Float[Tensor, "16 3"]
    """A relaxed natural hand, absolute (zero is the flat hand)."""
    pose_std: Float[Tensor, "16 3"]

    @cached_property
    def has_pose_dirs(self) -> bool:
        """Whether there are pose correctives; where all are zero they are skipped."""
        return bool(self.pose_dirs.any())

    @cached_property
    def pose_basis(self) -> Float[Tensor, "135 V3"]:
        """The pose correctives with coordinates before vertices, for one matrix product."""
        return self.pose_dirs.permute(2, 1, 0).flatten(1).contiguous()

    def shaped(self, betas: Float[Tensor, "*B S"]) -> "ShapedHand":
        """The rest pose of a person with these betas, with the wrist joint at the origin."""
        verts = self.template + torch.einsum("vcs,...s->...vc", self.shape_dirs, betas)
        joints = torch.einsum("jv,...vc->...jc", self.joint_regressor, verts)
        root = joints[..., :1, :]
        verts, joints = verts - root, joints - root
        bones = joints[..., 1:, :] - joints[..., list(PARENTS[1:]), :]
        tips = verts[..., list(self.tip_verts), :] - joints[..., list(TIP_PARENTS), :]
        return ShapedHand(self, verts, joints, torch.cat([bones, tips], dim=-2))

    def rest_wrist(self, betas: Float[Tensor, "*B S"]) -> Float[Tensor, "*B 3"]:
        """Wrist joint of the rest pose, MANO's J0(betas): the wrist's position (convention W) minus
        smplx's translation (convention O)."""
        dirs = torch.einsum("v,vcs->cs", self.joint_regressor[0], self.shape_dirs)
        mean = self.joint_regressor[0] @ self.template
        return mean + betas @ dirs[:, : betas.shape[-1]].T

    def mirrored(self) -> "HandModel":
        """The hand of the other side, by the reflection x -> -x; betas keep their meaning."""
        flip = mirror_signs(self.template)
        # R -> S R S: entry (r, c) of each rotation changes sign when exactly one index is x.
        feature = (flip[:, None] * flip).reshape(9).repeat(15)
        low, high = mirror_axis_angle(self.pose_low), mirror_axis_angle(self.pose_high)
        return replace(
            self,
            side=OTHER_SIDE[self.side],
            template=mirror_points(self.template),
            shape_dirs=self.shape_dirs * flip[:, None],
            pose_dirs=self.pose_dirs * flip[:, None] * feature,
            faces=mirror_faces(self.faces),
            pose_low=torch.minimum(low, high),
            pose_high=torch.maximum(low, high),
            pose_mean=mirror_axis_angle(self.pose_mean),
        )


@dataclass(frozen=True, eq=False)
class ShapedHand(Bundle):
    """A hand of one shape in the rest pose, wrist joint at the origin, metres."""

    model: HandModel
    verts: Float[Tensor, "*B V 3"]
    joints: Float[Tensor, "*B 16 3"]
    """Joint centres in MANO order."""
    offsets: Float[Tensor, "*B 20 3"]
    """Rest skeleton (see `geneoh.hand.skeleton`): 15 bones, then 5 tips."""

    def posed(self, pose: Float[Tensor, "*#B 16 3"], wrist: Float[Tensor, "*#B 3"]) -> PosedHand:
        """The hand in the world: `pose` is axis-angle, absolute; `wrist` is the wrist joint."""
        return self.verts_from_rotations(axis_angle_to_matrix(pose), wrist)

    def verts_from_rotations(
        self, rotations: Float[Tensor, "*#B 16 3 3"], wrist: Float[Tensor, "*#B 3"]
    ) -> PosedHand:
        """As `posed`, from local rotation matrices."""
        rotations, joints, turn = self._kinematics(rotations, wrist)
        centre = joints[..., list(MANO_FROM_OPENPOSE[:16]), :]
        shift = centre - (turn @ self.joints[..., None])[..., 0]
        return PosedHand(self._skin(self.corrected(rotations), turn, shift), joints)

    def joints_from_rotations(
        self, rotations: Float[Tensor, "*#B 16 3 3"], wrist: Float[Tensor, "*#B 3"]
    ) -> Float[Tensor, "*B 21 3"]:
        """The keypoints of `verts_from_rotations` alone, many times faster: no mesh is skinned."""
        return self._kinematics(rotations, wrist)[1]

    def rest_keypoints(self) -> Float[Tensor, "*B 21 3"]:
        """Keypoints of the rest pose, wrist at the origin."""
        origin = self.offsets.new_zeros(3)
        return self.joints_from_rotations(torch.eye(3).to(origin).expand(16, 3, 3), origin)

    def _kinematics(self, rotations: Tensor, wrist: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Local rotations expanded to all batch axes, keypoints, and joints' global rotations."""
        # torch has the same function and imports sympy on its first call, which takes seconds
        batch = np.broadcast_shapes(rotations.shape[:-3], wrist.shape[:-1], self.verts.shape[:-2])
        rotations, wrist = rotations.expand(*batch, 16, 3, 3), wrist.expand(*batch, 3)
        offsets = self.offsets.expand(*batch, 20, 3)
        return rotations, *forward_kinematics(rotations, wrist, offsets)

    def corrected(self, rotations: Float[Tensor, "*B 16 3 3"]) -> Float[Tensor, "*B2 3 V"]:
        """Rest vertices with the pose correctives, coordinates first for fast skinning."""
        rest = self.verts.transpose(-1, -2)
        if not self.model.has_pose_dirs:
            return rest
        bulge = pose_features(rotations) @ self.model.pose_basis
        return rest + bulge.unflatten(-1, rest.shape[-2:])

    def _skin(
        self,
        rest: Float[Tensor, "*B2 3 V"],
        turn: Float[Tensor, "*B 16 3 3"],
        shift: Float[Tensor, "*B 16 3"],
    ) -> Float[Tensor, "*B V 3"]:
        """Linear blend skinning, coordinates first: twice as fast as vertices first on a CPU."""
        rows = torch.cat([turn, shift[..., None]], dim=-1).movedim(-3, -1)
        # One flat matrix product takes a third of the time of a batch of small ones.
        blend = (rows.reshape(-1, 16) @ self.model.skin_weights.T).unflatten(0, rows.shape[:-1])
        verts = blend[..., 3, :]
        for axis in range(3):
            verts = torch.addcmul(verts, blend[..., axis, :], rest[..., None, axis, :])
        return verts.transpose(-1, -2)


def pose_features(rotations: Float[Tensor, "*B 16 3 3"]) -> Float[Tensor, "*B 135"]:
    """Coefficients of the pose correctives: local rotations of joints 1 to 15, minus identity."""
    eye = torch.eye(3, dtype=rotations.dtype, device=rotations.device)
    return (rotations[..., 1:, :, :] - eye).flatten(-3)
