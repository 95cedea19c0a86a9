"""Measures of each clip that need no classifier: physics and contact."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle, concatenated
from geneoh.choices import SIDES
from geneoh.geometry.oriented_points import signed_to_points
from geneoh.hand.library import mean_hand
from geneoh.metrics.realism import SurfacePoints, moved_alone, realistic_frames, touched_points
from geneoh.metrics.report import measure_frames
from geneoh.metrics.smoothness import mean_over_frames
from geneoh.progress import OnStep, steps
from geneoh.synthesis.actions.action import FPS, Actions


@dataclass(frozen=True)
class PosedActions(Bundle):
    """B actions over T frames in the world, metres; absent hands are NaN."""

    joints: Float[Tensor, "B 2 T 21 3"]  # left, then right
    skin: Float[Tensor, "B 2 T V 3"]
    surface: SurfacePoints


def posed_actions(actions: Actions) -> PosedActions:
    """The embedded hands with mean shape, and the object's points, in every frame."""
    made = [
        mean_hand(side).posed(actions.pose[:, number], actions.wrist[:, number])
        for number, side in enumerate(SIDES)
    ]
    absent = ~actions.hands[:, :, None, None, None]
    joints, skin = (
        torch.stack([getattr(each, name) for each in made], 1).masked_fill(absent, torch.nan)
        for name in ("joints", "verts")
    )
    points = actions.posed_points() @ actions.rotation.mT + actions.translation[:, :, None]
    normals = actions.posed_normals() @ actions.rotation.mT
    return PosedActions(joints, skin, SurfacePoints(points, normals, actions.length))


WITHIN = 0.05  # distance to the object's points beyond which vertices are not measured, metres


@dataclass(frozen=True)
class ClipMeasures(Bundle):
    """Measures of B clips; NaN where there is nothing to measure."""

    realism: Float[Tensor, " B"]  # share of the frames that are realistic
    moved_alone: Float[Tensor, " B"]  # share of the moving frames without a hand at the object
    depth_mm: Float[Tensor, " B"]  # penetration depth of both hands' deepest vertex, mean of frames
    deepest_mm: Float[Tensor, " B"]  # the same, largest over frames
    contact: Float[Tensor, " B"]  # share of the frames in which a hand touches
    acceleration_mm: Float[Tensor, " B"]  # of the keypoints, in millimetres per frame squared


def measure_clips(actions: Actions, on_step: OnStep | None = None) -> ClipMeasures:
    """Measure every clip over its frames, with hand meshes of the mean shape."""
    clips = range(len(actions.verb))
    return concatenated(
        [measure_clip(actions.take(slice(i, i + 1), "B")) for i in steps(clips, on_step)], "B"
    )


def measure_clip(clip: Actions) -> ClipMeasures:
    """The measures of a batch of one clip."""
    clip = clip[: int(clip.length)]
    posed = posed_actions(clip)
    surface, hands = posed.surface, clip.hands[0]
    skin = posed.skin[0, hands]
    points, normals = surface.points[0], surface.normals[0]
    found = [signed_to_points(each, points, normals, within=WITHIN) for each in skin]
    touched = torch.stack([touched_points(*each, points.shape[1]) for each in found]).any(0)
    every = torch.ones_like(touched[:, 0])
    measured = [
        measure_frames(distance, verts, joints, FPS, every)
        for (distance, _), verts, joints in zip(found, skin, posed.joints[0, hands], strict=True)
    ]
    depth = torch.stack([hand.depth for hand in measured]).amax(0)
    accelerated = torch.stack([hand.acceleration for hand in measured])
    return ClipMeasures(
        realism=realistic_frames(touched[None], surface, FPS).sum(1) / surface.length,
        moved_alone=moved_alone(posed.joints.transpose(1, 2).flatten(2, 3), surface),
        depth_mm=1000 * depth.mean()[None],
        deepest_mm=1000 * depth.amax()[None],
        contact=torch.stack([hand.touching for hand in measured]).any(0).float().mean()[None],
        acceleration_mm=mean_over_frames(accelerated).mean()[None],
    )
