"""Clips of bodies with hands and sentences, the training data of the generator BOTH2Hands."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int, Shaped
from torch import Tensor

from geneoh.body.motion import BodyMotion
from geneoh.body.skeleton import Skeleton
from geneoh.bundle import Bundle
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.synthesis.actions.action import VERBS
from geneoh.synthesis.gestures.one_handed import ONE_HANDED
from geneoh.synthesis.gestures.two_handed import TWO_HANDED

REST = "rest"
NAMES: tuple[str, ...] = (REST, *ONE_HANDED, *TWO_HANDED, *VERBS)
"""Rest, gestures and verbs of a hand; `Gestures.gesture` is an index here."""


@dataclass(frozen=True)
class Gestures(Bundle):
    """B clips of T frames of a body with fingers, at 30 frames a second; y up.

    The pelvis is above the origin in the first frame, and the body faces +z. Frames from `length`
    on repeat the last one.
    """

    gesture: Int[Tensor, "B 2"]  # of the left and the right hand; two equal ones are made together
    variant: Int[Tensor, "B 2"]  # of the gesture; -1 where there is none
    body: Int[Tensor, " B"]  # index of the body's proportions
    length: Int[Tensor, " B"]
    root: Float[Tensor, "B T 3"]  # position of the pelvis, metres
    pose: Float[Tensor, "B T 52 3"]  # axis-angle of each joint in its parent's frame, radians
    offsets: Float[Tensor, "B 52 3"]  # of the skeleton, metres
    left: Shaped[np.ndarray, " B"]  # a sentence about the left hand
    right: Shaped[np.ndarray, " B"]
    joined: Shaped[np.ndarray, "B S"]  # sentences about both hands, the plainest first

    @property
    def motion(self) -> BodyMotion:
        """Rotations of all joints as matrices."""
        return BodyMotion(self.root, axis_angle_to_matrix(self.pose))

    @property
    def before_end(self) -> Bool[Tensor, "B T"]:
        """Whether each frame is before the end of its clip; later ones repeat the last frame."""
        frames = torch.arange(self.root.shape[1], device=self.length.device)
        return frames < self.length[:, None]

    @property
    def skeleton(self) -> Skeleton:
        """The skeleton of each clip."""
        return Skeleton(self.offsets)
