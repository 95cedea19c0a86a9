"""What the denoisers share: the observation as a condition, and the scales of their data."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.bundle import Bundle
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.hand.skeleton import bone_lengths

HAND_SCALE = 0.08
"""Deviation of canonical keypoints around the contact points, metres: the unit of the paper's
unit-variance schedule. It is fixed: each window's own, as in the paper, would lose bone lengths."""
NOISE_SCALE = 0.02  # how far a clean keypoint typically is from its observation, metres
POINTS = 32  # contact points K the networks are trained with
SELECT_EVERY = 4  # frames of which one decides which points these are


@dataclass(frozen=True)
class Observation(Bundle):
    """The noisy hand as a condition for a network."""

    joints: Float[Tensor, "B T 21 3"]  # keypoints in the canonical frame, metres, gaps filled
    trust: Float[Tensor, "B T 21"]  # 0 where a keypoint was filled in, else its confidence, <= 1
    given: Float[Tensor, " B"]
    """1 where the network is shown the observation, 0 for the paper's canonical denoiser."""

    @property
    def mask(self) -> Float[Tensor, "B 1 1 1"]:
        """`given` in the shape that multiplies keypoints."""
        return self.given[:, None, None, None]

    @property
    def anchor(self) -> Float[Tensor, "B T 21 3"]:
        """Expected place of the clean keypoints: the observation, else the frame's origin."""
        return self.joints * self.mask

    @property
    def scale(self) -> Float[Tensor, " B"]:
        """Expected distance of a clean keypoint coordinate from the anchor, metres."""
        return torch.where(self.given > 0, NOISE_SCALE, HAND_SCALE)

    def palm(self) -> Float[Tensor, "B 3 3"]:
        """Axes of the window's mean palm as columns, canonical frame; identity where withheld.

        Answers in these axes turn with the hand; elsewhere networks learn that by eq. (25).
        """
        axes = palm_axes(self.joints)
        return torch.where(self.given[:, None, None] > 0, axes, torch.eye(3).to(axes))

    def turned(self, axes: Float[Tensor, "B 3 3"]) -> "Observation":
        """The same observation in other axes, given as columns."""
        return replace(self, joints=self.joints @ axes[:, None])

    def features(self) -> Float[Tensor, "B T F"]:
        """Network input per frame: position, pose, jitter, trust, bone lengths; 0 if withheld."""
        joints, wrist = self.joints, self.joints[:, :, :1]
        jitter = torch.zeros_like(joints)
        if joints.shape[1] > 2:
            jitter[:, 1:-1] = joints.diff(n=2, dim=1)
        bones = bone_lengths(joints).median(dim=1, keepdim=True).values
        parts = [
            (joints / HAND_SCALE).flatten(2),
            ((joints - wrist)[:, :, 1:] / 0.04).flatten(2),
            (jitter / NOISE_SCALE).flatten(2),
            self.trust,
            ((bones - 0.03) / 0.03).expand(-1, joints.shape[1], -1),
            torch.ones_like(self.trust[..., :1]),
        ]
        return torch.cat(parts, dim=-1) * self.given[:, None, None]


def palm_axes(joints: Float[Tensor, "B T 21 3"]) -> Float[Tensor, "B 3 3"]:
    """Axes of the window's mean palm as columns: along the palm, across it, and its normal."""
    wrist, middle, index, pinky = (joints[:, :, i].mean(1) for i in (0, 9, 5, 17))
    first = normalize(middle - wrist, dim=-1)
    across = index - pinky
    second = normalize(across - (across * first).sum(-1, keepdim=True) * first, dim=-1)
    return torch.stack([first, second, torch.linalg.cross(first, second)], dim=-1)


def object_rates(
    move: Float[Tensor, "B N 3"], turn: Float[Tensor, "B N 3 3"], axes: Float[Tensor, "B 3 3"]
) -> Float[Tensor, "B N+1 6"]:
    """Steps (m) and turns of the object to the next frame as features, in the given axes.

    They are in 3 mm and 0.03 rad, at most ten of these, and zero in the last frame.
    """
    rates = torch.cat([move @ axes / 0.003, matrix_to_axis_angle(turn) @ axes / 0.03], dim=-1)
    return torch.nn.functional.pad(rates, (0, 0, 0, 1)).clamp(-10, 10)


OBSERVATION_FEATURES = 63 + 60 + 63 + 21 + 20 + 1  # width of `Observation.features`
