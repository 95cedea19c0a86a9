"""Actions as hands and surfaces in the world: what is measured and drawn of them."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import SIDES
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.model import ShapedHand
from geneoh.metrics.realism import SurfaceMotion
from geneoh.synthesis.actions import Actions


@dataclass(frozen=True)
class PosedActions(Bundle):
    """B actions over T frames in the world, metres; absent hands are NaN."""

    joints: Float[Tensor, "B 2 T 21 3"]  # left, then right
    skin: Float[Tensor, "B 2 T V 3"]
    surface: SurfaceMotion


def posed_actions(actions: Actions) -> PosedActions:
    """The embedded hands of the mean shape, and the object's points, in every frame."""
    made = [
        shaped.posed(actions.pose[:, side], actions.wrist[:, side])
        for side, shaped in enumerate(mean_hands())
    ]
    absent = ~actions.hands[:, :, None, None, None]
    joints, skin = (
        torch.stack([getattr(each, name) for each in made], 1).masked_fill(absent, torch.nan)
        for name in ("joints", "verts")
    )
    return PosedActions(joints, skin, surface_motion(actions))


def keypoints(actions: Actions) -> Float[Tensor, "B 2 T 21 3"]:
    """The keypoints of both hands in the world, left first; absent hands are NaN."""
    turns = axis_angle_to_matrix(actions.pose)
    made = [
        shaped.joints_from_rotations(turns[:, side], actions.wrist[:, side])
        for side, shaped in enumerate(mean_hands())
    ]
    return torch.stack(made, 1).masked_fill(~actions.hands[:, :, None, None, None], torch.nan)


def surface_motion(actions: Actions) -> SurfaceMotion:
    """The points of the objects in the world, their parts moved by the joint."""
    turned, _ = joint_pose(actions)
    local = actions.normals[:, None]
    on_joint = (actions.part > 0)[:, None, :, None]
    normals = torch.where(on_joint, local @ turned.mT, local)
    points = actions.posed_points() @ actions.rotation.mT + actions.translation[:, :, None]
    return SurfaceMotion(points, normals @ actions.rotation.mT, actions.length)


def joint_pose(actions: Actions) -> tuple[Float[Tensor, "B T 3 3"], Float[Tensor, "B T 3"]]:
    """Rotation and translation of the second part in the object's frame."""
    along = actions.joint[..., None] * actions.axis[:, None]
    slides = actions.slides[:, None, None]
    turn = axis_angle_to_matrix(torch.where(slides, 0.0, along))
    pivot = actions.pivot[:, None]
    turned = pivot - (turn @ pivot[..., None])[..., 0]
    return turn, torch.where(slides, along, turned)


def mean_hands() -> tuple[ShapedHand, ...]:
    """The left and the right embedded hand of the mean shape."""
    return tuple(load_hand(side).shaped(torch.zeros(10)) for side in SIDES)
