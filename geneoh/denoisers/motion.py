"""MotionDiff: the denoiser of canonical hand trajectories (paper 3.2; appendices A.2, C.4, C.5).

The trajectory is denoised as the hand's parameters with the person's own bones, anchored at the
observed ones, and the network is shown how the observed hand stands to the surface. The paper's own
form, keypoints alone, is `geneoh.denoisers.trajectory`.
"""

from dataclasses import dataclass, fields
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.denoisers.base import HAND_SCALE, palm_axes
from geneoh.denoisers.candidate_corrections import ANSWERS, simple_answers
from geneoh.diffusion.precondition import denoised
from geneoh.geometry.rotations import matrix_to_axis_angle, matrix_to_rotation_6d
from geneoh.hand.skeleton import bone_lengths
from geneoh.nn.blocks import FrameTransformer, zeroed
from geneoh.representation.parameters import UNIT, HandParameters, turned

TOUCH_SCALE, GAP_SCALE = 0.02, 0.04
"""Distances over which closeness to the surface decays in the network's eyes, and gaps do in what
it maps linearly, metres."""


@dataclass(frozen=True)
class MotionConfig:
    """Size of the network; one token per frame."""

    width: int = 160
    depth: int = 6
    heads: int = 4
    rank: int = 96
    """Channels of the linear map from answers to change."""


@dataclass(frozen=True)
class ObservedMotion:
    """What MotionDiff is shown: the noisy hand, the surface near it and the object's motion."""

    hand: HandParameters
    """Canonical frame, gaps filled."""
    trust: Float[Tensor, "B T"]
    """1 where the frame was seen, 0 where it was filled in, between by confidence."""
    nearest: Float[Tensor, "B T 21 3"]
    """The object's surface point nearest to each observed keypoint, canonical frame."""
    normals: Float[Tensor, "B T 21 3"]
    """Outward normals there."""
    rotation: Float[Tensor, "B T 3 3"]
    """R_k, canonical to world, with the centres `center`: how the object moves."""
    center: Float[Tensor, "B T 3"]

    def repeated(self, times: int) -> "ObservedMotion":
        """The same batch several times over, for as many samples."""

        def tiled(value: Tensor) -> Tensor:
            return value.repeat(times, *[1] * (value.ndim - 1))

        rest = (tiled(getattr(self, f.name)) for f in fields(self)[1:])
        return ObservedMotion(self.hand.map(tiled), *rest)

    @property
    def joints(self) -> Float[Tensor, "B T 21 3"]:
        """The observed keypoints, canonical frame."""
        return self.hand.joints

    @cached_property
    def shown(self) -> "Shown":
        """What the network reads, in the palm's axes: the same at every noise level."""
        axes = palm_axes(self.joints)  # so that a hand looks the same however it is turned
        offset = (self.nearest - self.joints) @ axes[:, None]
        return Shown(axes, self.answers(axes), self.gaps(offset), self.features(axes, offset))

    def features(
        self, axes: Float[Tensor, "B 3 3"], offset: Float[Tensor, "B T 21 3"]
    ) -> Float[Tensor, "B T F"]:
        """Input per frame in the given axes (columns): hand, jitter, surface, object, trust.

        `offset` goes from the keypoints to the surface, in these axes.
        """
        hand, joints = self.hand, self.joints @ axes[:, None]
        wrist, turn = joints[:, :, :1], axes[:, None].transpose(-1, -2) @ hand.turn
        six = matrix_to_rotation_6d(turn)
        fingers = hand.fingers.flatten(2)
        apart = offset.norm(dim=-1)
        near = torch.exp(-apart / TOUCH_SCALE)
        height = -(offset * (self.normals @ axes[:, None])).sum(-1)
        parts = [
            wrist.flatten(2) / HAND_SCALE,
            ((joints - wrist)[:, :, 1:] / 0.06).flatten(2),
            six,
            fingers / 0.5,
            _bends(torch.cat([wrist[:, :, 0] / 0.02, six / 0.1, fingers / 0.5], dim=-1)),
            (offset * near[..., None] / 0.01).flatten(2),
            near,
            (height * near / 0.01).clamp(-3, 3),
            self._object_motion(axes),
            ((bone_lengths(joints[:, :1]) - 0.03) / 0.03).expand(-1, joints.shape[1], -1),
            self.trust[..., None],
        ]
        return torch.cat(parts, dim=-1)

    def answers(self, axes: Float[Tensor, "B 3 3"]) -> Float[Tensor, "B T K 51"]:
        """Simple answers to the observed hand, the wrist's change in the given axes."""
        changes = simple_answers(self.hand, self.trust, self.nearest, self.normals, self.rotation)
        return turned(changes, axes[:, None, None])

    def gaps(self, offset: Float[Tensor, "B T 21 3"]) -> Float[Tensor, "B T G"]:
        """From each keypoint to the surface (cm), less the farther it is, and the fingers' pose."""
        near = torch.exp(-offset.norm(dim=-1, keepdim=True) / GAP_SCALE)
        fingers = self.hand.fingers.flatten(2) / UNIT[-1]
        return torch.cat([(offset * near / 0.01).flatten(2), fingers], dim=-1)

    def _object_motion(self, axes: Float[Tensor, "B 3 3"]) -> Float[Tensor, "B T 6"]:
        """Velocity and turn rate of the object between frames, 0.1 m/s and 1 rad/s as units."""
        rotation, center = self.rotation, self.center
        turn = rotation[:, :-1].transpose(-1, -2) @ rotation[:, 1:]
        move = (center.diff(dim=1)[..., None, :] @ rotation[:, :-1])[..., 0, :]
        rate = torch.cat([move @ axes / 0.003, matrix_to_axis_angle(turn) @ axes / 0.03], -1)
        return torch.nn.functional.pad(rate, (0, 0, 0, 1)).clamp(-10, 10)


@dataclass(frozen=True)
class Shown:
    """An observation as the network reads it."""

    axes: Float[Tensor, "B 3 3"]
    """Of the palm, as columns; everything else is in them."""
    answers: Float[Tensor, "B T K 51"]
    gaps: Float[Tensor, "B T G"]
    features: Float[Tensor, "B T F"]


GAPS = 63 + 45
"""Width of `ObservedMotion.gaps`."""
FEATURES = 3 + 60 + 6 + 45 + 54 + 63 + 21 + 21 + 6 + 20 + 1
"""Width of `ObservedMotion.features`."""


def _bends(values: Float[Tensor, "B T D"]) -> Float[Tensor, "B T D"]:
    """Second difference over time, zero at both ends: how much the input jitters."""
    if values.shape[1] < 3:
        return torch.zeros_like(values)
    return torch.nn.functional.pad(values.diff(n=2, dim=1), (0, 0, 1, 1))


class MotionDenoiser(nn.Module):
    """A transformer over frames that maps noisy changes of the observed hand to the clean one."""

    def __init__(self, config: MotionConfig) -> None:
        """Build the network; its last layers start at zero, so it starts as the skip path."""
        super().__init__()
        self.config = config
        self.embed = nn.Linear(51 + 51 * ANSWERS + FEATURES, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, 51))
        self.gate = zeroed(nn.Linear(config.width, 51))
        self.mix = zeroed(nn.Linear(config.width, 51 * ANSWERS))
        # a linear map whose channels the tokens open: what answers and gaps say only together
        self.read = nn.Linear(51 * ANSWERS + GAPS, config.rank)
        self.open = zeroed(nn.Linear(config.width, config.rank))
        self.write = nn.Linear(config.rank, 51, bias=False)

    def forward(
        self, x: Float[Tensor, "B T 51"], sigma: Float[Tensor, " B"], seen: ObservedMotion
    ) -> Float[Tensor, "B T 51"]:
        """The change from the observed to the clean hand seen in `x` = clean + sigma * noise.

        Units are those of `geneoh.representation.parameters.UNIT`, the wrist's axes canonical.
        """
        shown = seen.shown
        axes, answers = shown.axes, shown.answers
        features = torch.cat([answers.flatten(2), shown.features], dim=-1)
        channels = self.read(torch.cat([answers.flatten(2), shown.gaps], dim=-1))

        def network(scaled: Tensor, level: Tensor) -> Tensor:
            tokens = self.embed(torch.cat([scaled, features], dim=-1))
            tokens = self.trunk(tokens, level.flatten())
            # the gate scales the sample itself: how far this input's observation is to be trusted
            mix = self.mix(tokens).unflatten(-1, answers.shape[2:])
            own = self.head(tokens) + self.write(self.open(tokens) * channels)
            return own + self.gate(tokens) * scaled + (mix * answers).sum(2)

        sigma = sigma[:, None, None]
        anchor, scale = torch.zeros_like(x), torch.ones_like(sigma)
        clean = denoised(network, turned(x, axes[:, None]), anchor, sigma, scale)
        return turned(clean, axes[:, None].mT)
