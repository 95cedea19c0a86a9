"""Actions as hands and surfaces in the world: what is measured and drawn of them."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import SIDES
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


def surface_motion(actions: Actions) -> SurfaceMotion:
    """The points of the objects in the world, their parts moved by the joint."""
    points = actions.posed_points() @ actions.rotation.mT + actions.translation[:, :, None]
    normals = actions.posed_normals() @ actions.rotation.mT
    return SurfaceMotion(points, normals, actions.length)


def mean_hands() -> tuple[ShapedHand, ...]:
    """The left and the right embedded hand of the mean shape."""
    return tuple(load_hand(side).shaped(torch.zeros(10)) for side in SIDES)
