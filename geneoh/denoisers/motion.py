"""MotionDiff: the denoiser of canonical hand trajectories (paper 3.2; appendices A.2, C.4, C.5).

The diffused variable is the change of the hand's pose parameters from the observed ones, with the
person's own bone lengths; the network also sees the object's surface near the hand. The paper's
form, on keypoints alone, is `geneoh.denoisers.trajectory`.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.bundle import Bundle
from geneoh.denoisers.base import HAND_SCALE, object_rates
from geneoh.denoisers.candidate_corrections import CANDIDATES, candidate_corrections
from geneoh.diffusion.precondition import preconditioned
from geneoh.geometry.rotations import matrix_to_rotation_6d
from geneoh.hand.skeleton import bone_lengths
from geneoh.nn.blocks import FrameTransformer, NetworkConfig, zeroed
from geneoh.representation.parameters import UNIT, HandParameters, turned
from geneoh.representation.region import ContactRegion
from geneoh.sequence.keypoints import palm_axes

SURFACE_SCALE, CONTACT_CUE_SCALE = 0.02, 0.04  # decay of closeness in features and cues, metres
CONTACT_CUES = 63 + 45  # width of `ObservedMotion.contact_cues`
MOTION_FEATURES = 3 + 60 + 6 + 45 + 54 + 63 + 21 + 21 + 6 + 20 + 1
"""Width of `ObservedMotion.features`."""


@dataclass(frozen=True)
class MotionConfig(NetworkConfig):
    """Size of the network; one token per frame."""

    width: int = 160
    depth: int = 6
    heads: int = 4
    rank: int = 96  # channels of the linear map from candidates and contact cues to a change


@dataclass(frozen=True)
class NetworkInput(Bundle):
    """Network input computed from an observation, all in the axes of the palm."""

    axes: Float[Tensor, "B 3 3"]  # axes of the palm as columns, canonical frame
    candidates: Float[Tensor, "B T K 51"]
    contact_cues: Float[Tensor, "B T C"]
    features: Float[Tensor, "B T F"]

    def repeated(self, times: int) -> "NetworkInput":
        """The batch repeated for several samples, samples outermost."""
        return self.map(lambda value: value.repeat(times, *[1] * (value.ndim - 1)))


@dataclass(frozen=True)
class ObservedMotion(Bundle):
    """MotionDiff's condition: the noisy hand, the surface near it and the object's motion."""

    hand: HandParameters  # canonical frame, gaps filled
    trust: Float[Tensor, "B T"]  # 0 where a frame was filled in, else its mean confidence, <= 1
    nearest: Float[Tensor, "B T 21 3"]  # surface point nearest to each keypoint, canonical
    normals: Float[Tensor, "B T 21 3"]  # outward normals there
    rotation: Float[Tensor, "B T 3 3"]  # R_k of the canonical frame, to world: the object's motion
    center: Float[Tensor, "B T 3"]  # origin of the canonical frame, world

    @classmethod
    def of(
        cls,
        hand: HandParameters,
        trust: Float[Tensor, "B T"],
        nearest: Float[Tensor, "B T 21 3"],
        normals: Float[Tensor, "B T 21 3"],
        region: ContactRegion,
    ) -> "ObservedMotion":
        """The condition from a hand and the surface near it, both passed in the world frame."""
        near = region.to_canon(nearest), normals @ region.rotation
        return cls(hand.to_canon(region), trust, *near, region.rotation, region.center)

    @property
    def joints(self) -> Float[Tensor, "B T 21 3"]:
        """The observed keypoints, canonical frame."""
        return self.hand.joints

    @cached_property
    def network_input(self) -> NetworkInput:
        """The network's input; cached, because it is the same at every noise level."""
        axes = palm_axes(self.joints)  # makes the output rotation equivariant
        offset = (self.nearest - self.joints) @ axes[:, None]
        return NetworkInput(
            axes, self.candidates(axes), self.contact_cues(offset), self.features(axes, offset)
        )

    def features(
        self, axes: Float[Tensor, "B 3 3"], offset: Float[Tensor, "B T 21 3"]
    ) -> Float[Tensor, "B T F"]:
        """Features per frame in the given axes, which `offset` (keypoint to surface) is also in."""
        hand, joints = self.hand, self.joints @ axes[:, None]
        wrist, turn = joints[:, :, :1], axes[:, None].transpose(-1, -2) @ hand.turn
        six = matrix_to_rotation_6d(turn)
        fingers = hand.fingers.flatten(2)
        apart = offset.norm(dim=-1)
        near = torch.exp(-apart / SURFACE_SCALE)
        height = -(offset * (self.normals @ axes[:, None])).sum(-1)
        parts = [
            wrist.flatten(2) / HAND_SCALE,
            ((joints - wrist)[:, :, 1:] / 0.06).flatten(2),
            six,
            fingers / 0.5,
            jitter_of(torch.cat([wrist[:, :, 0] / 0.02, six / 0.1, fingers / 0.5], dim=-1)),
            (offset * near[..., None] / 0.01).flatten(2),
            near,
            (height * near / 0.01).clamp(-3, 3),
            self._object_motion(axes),
            ((bone_lengths(joints[:, :1]) - 0.03) / 0.03).expand(-1, joints.shape[1], -1),
            self.trust[..., None],
        ]
        return torch.cat(parts, dim=-1)

    def candidates(self, axes: Float[Tensor, "B 3 3"]) -> Float[Tensor, "B T K 51"]:
        """Candidate corrections of the observed hand, with the wrist's change in the given axes."""
        changes = candidate_corrections(
            self.hand, self.trust, self.nearest, self.normals, self.rotation
        )
        return turned(changes, axes[:, None, None])

    def contact_cues(self, offset: Float[Tensor, "B T 21 3"]) -> Float[Tensor, "B T C"]:
        """Offset from each keypoint to the surface in cm, decaying with distance, then the finger
        pose in units of `UNIT`."""
        near = torch.exp(-offset.norm(dim=-1, keepdim=True) / CONTACT_CUE_SCALE)
        fingers = self.hand.fingers.flatten(2) / UNIT[-1]
        return torch.cat([(offset * near / 0.01).flatten(2), fingers], dim=-1)

    def _object_motion(self, axes: Float[Tensor, "B 3 3"]) -> Float[Tensor, "B T 6"]:
        """Motion of the canonical frame to the next frame; see `object_rates`."""
        rotation, center = self.rotation, self.center
        turn = rotation[:, :-1].transpose(-1, -2) @ rotation[:, 1:]
        move = (center.diff(dim=1)[..., None, :] @ rotation[:, :-1])[..., 0, :]
        return object_rates(move, turn, axes)


def jitter_of(values: Float[Tensor, "B T D"]) -> Float[Tensor, "B T D"]:
    """Second difference over time; zero in the first and the last frame."""
    if values.shape[1] < 3:
        return torch.zeros_like(values)
    return torch.nn.functional.pad(values.diff(n=2, dim=1), (0, 0, 1, 1))


class MotionDenoiser(nn.Module):
    """A transformer over frames that maps a noisy change of the observed hand to the clean one."""

    def __init__(self, config: MotionConfig) -> None:
        """Build the network; its last layers start at zero, which leaves the skip path alone."""
        super().__init__()
        self.config = config
        self.embed = nn.Linear(51 + 51 * CANDIDATES + MOTION_FEATURES, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, 51))
        self.gate = zeroed(nn.Linear(config.width, 51))
        self.mix = zeroed(nn.Linear(config.width, 51 * CANDIDATES))
        # a low-rank linear map of candidates and contact cues together, whose channels the tokens
        # weight in each frame
        self.read = nn.Linear(51 * CANDIDATES + CONTACT_CUES, config.rank)
        self.open = zeroed(nn.Linear(config.width, config.rank))
        self.write = nn.Linear(config.rank, 51, bias=False)

    def forward(
        self, x: Float[Tensor, "B T 51"], sigma: Float[Tensor, " B"], observed: ObservedMotion
    ) -> Float[Tensor, "B T 51"]:
        """The change from the observed to the clean hand, from `x` = clean + sigma * noise.

        Changes are in units of `UNIT`, the wrist's in canonical axes. `x` may hold several samples
        of each observed window, samples outermost.
        """
        network_input = observed.network_input.repeated(len(x) // len(observed.trust))
        axes, candidates = network_input.axes, network_input.candidates
        features = torch.cat([candidates.flatten(2), network_input.features], dim=-1)
        channels = self.read(torch.cat([candidates.flatten(2), network_input.contact_cues], dim=-1))

        def network(scaled: Tensor, level: Tensor) -> Tensor:
            tokens = self.embed(torch.cat([scaled, features], dim=-1))
            tokens = self.trunk(tokens, level.flatten())
            # the gate scales the noisy sample, and so sets how far the observation is trusted
            mix = self.mix(tokens).unflatten(-1, candidates.shape[2:])
            own = self.head(tokens) + self.write(self.open(tokens) * channels)
            return own + self.gate(tokens) * scaled + (mix * candidates).sum(2)

        sigma = sigma[:, None, None]
        anchor, scale = torch.zeros_like(x), torch.ones_like(sigma)
        clean = preconditioned(network, turned(x, axes[:, None]), anchor, sigma, scale)
        return turned(clean, axes[:, None].mT)
