"""The stage context of a hand without an object. MotionDiff treats it as a hand far from any
surface, where all its object features are zero. The canonical frame is fixed in the world, at the
centre of the hand's path, or moves with a hand that travels, as that of someone who walks: the
networks learned hands that stay within reach of one place, and would pull one that covers metres in
a window back toward the window's centre."""

import math
from dataclasses import dataclass, fields

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d
from torch import Tensor

from geneoh.fitting.subject import Subject
from geneoh.fitting.terms import HandState
from geneoh.geometry.distance import MovingSurface
from geneoh.hand.model import ShapedHand
from geneoh.metrics.contact import TOUCH
from geneoh.metrics.report import InteractionReport, measure_posed
from geneoh.metrics.smoothness import (
    acceleration,
    in_mm_per_frame_squared,
    mean_over_frames,
    valid_differences,
)
from geneoh.pipeline.stages.context import StageContext
from geneoh.pipeline.touch import verts_of_fingers
from geneoh.representation.region import ContactRegion
from geneoh.sequence.keypoints import palm_axes
from geneoh.sequence.windows import WINDOW

DUMMY_DISTANCE = 1.0  # of the dummy surface, metres: closeness decays over centimetres
PATH_FRAMES = 15.0
"""Standard deviation of the Gaussian that smooths the hand's path, frames at 30 a second."""
WITHIN_REACH, TRAVELLING = 0.8, 1.2
"""Extent of the path in the frames of a window around each one, metres: up to the first bound the
hand stays in the given frame, from the second on its frame moves with it. Made hands that reach for
an object cover up to 0.7 m, and someone who walks 2.6 m."""


@dataclass(frozen=True)
class HandAlone(StageContext):
    """The context of a hand without an object."""

    def region(self, joints: Float[Tensor, "S T 21 3"]) -> ContactRegion:
        """The canonical frame of each window, without contact points."""
        windows = self.windows(joints)
        none = windows[:, :, :0]
        axes = self.rotation[0, 0].expand(*windows.shape[:2], 3, 3)
        middle = windows.mean((1, 2))[:, None].expand(*windows.shape[:2], 3)
        return ContactRegion(none, none, axes, middle)

    def nearest_surface(
        self, joints: Float[Tensor, "T 21 3"]
    ) -> tuple[Float[Tensor, "T 21 3"], Float[Tensor, "T 21 3"]]:
        """A dummy surface `DUMMY_DISTANCE` away, with zero closeness features."""
        up = joints.new_tensor([0.0, 0.0, 1.0]).expand_as(joints)
        return joints + DUMMY_DISTANCE * up, -up


def hand_alone(subject: Subject, fps: float) -> HandAlone:
    """The context of a hand in a frame that is fixed in the world, with the axes of the mean palm,
    which makes the result independent of the scene's orientation."""
    joints = subject.joints
    axes, middle = palm_axes(joints[None])[0], joints.mean((0, 1))
    return HandAlone(
        points=joints.new_zeros(0, 3),
        normals=joints.new_zeros(0, 3),
        part=torch.zeros(0, dtype=torch.long, device=joints.device),
        rotation=axes.expand(len(joints), 1, 3, 3),
        translation=middle.expand(len(joints), 1, 3),
        trust=subject.trust,
        fps=fps,
    )


def travelled(joints: Float[Tensor, "T 21 3"], fps: float) -> Float[Tensor, "T 3"]:
    """Position of the frame that moves with a hand where it travels, from its first one, metres;
    zero for a hand that stays within reach."""
    middle, more = joints.mean(1).cpu().double().numpy(), min(WINDOW, len(joints) - 1)
    own = slice(more, more + len(middle))
    # it goes on as it begins and ends
    longer = np.pad(middle, ((more, more), (0, 0)), mode="reflect", reflect_type="odd")
    path = gaussian_filter1d(longer, PATH_FRAMES * fps / 30, axis=0, mode="nearest")
    bounds = (each(path, WINDOW + 1, axis=0) for each in (maximum_filter1d, minimum_filter1d))
    extent = np.linalg.norm(np.subtract(*bounds), axis=1)[own]
    share = ((extent - WITHIN_REACH) / (TRAVELLING - WITHIN_REACH)).clip(0, 1)
    steps = 0.5 * (share[:-1] + share[1:])[:, None] * np.diff(path[own], axis=0)
    moved = np.concatenate([np.zeros((1, 3)), steps.cumsum(0)])
    return torch.from_numpy(moved).to(joints)


def measure_hand(
    state: HandState,
    shaped: ShapedHand,
    joints: Float[Tensor, "T 21 3"],
    surface: MovingSurface | None,
    fps: float,
    valid: Bool[Tensor, " T"],
    *,
    within: float = TOUCH,
) -> tuple[InteractionReport, Float[Tensor, "T 5"] | None]:
    """Metrics over the valid frames, with NaN for those that need an object if there is none; and
    the signed distance of each finger's skin to the object in all frames, metres, exact up to
    `within`."""

    def verts_of(frames: slice) -> Float[Tensor, "N V 3"]:
        return state[frames].verts(shaped)[0]

    if surface is not None:
        model = shaped.model
        return measure_posed(
            *(verts_of, joints, surface, fps, valid),
            faces=model.faces,
            groups=verts_of_fingers(model),
            within=within,
        )
    bends = in_mm_per_frame_squared(acceleration(joints, fps), fps)
    nothing = {
        field.name: math.nan for field in fields(InteractionReport) if field.name != "frames"
    }
    mean = float(mean_over_frames(bends, valid_differences(valid, 2)))
    return InteractionReport(int(valid.sum()), **{**nothing, "acceleration_mm": mean}), None
