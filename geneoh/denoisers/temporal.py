"""TemporalDiff: denoise the hand's motion relative to the object (paper 3.2; our form of it).

A step is the displacement of a keypoint to the next frame, relative to the one surface point that
is nearest to it, because a finger slides on what it touches. In one call, without diffusion, the
network predicts the clean step of every keypoint and a log weight of each step and each position.
`geneoh.fitting.align` finds the hand that agrees with both. The paper's form is
`geneoh.denoisers.latent`, over all contact points (`geneoh.representation.temporal`).
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import pad

from geneoh.bundle import Bundle
from geneoh.denoisers.base import CLOSE, object_rates
from geneoh.nn.blocks import FrameTransformer, NetworkConfig, zeroed
from geneoh.representation.nearest_surface import nearest_on_parts
from geneoh.representation.region import ObjectSurface
from geneoh.sequence.keypoints import palm_axes

STEP_UNIT = 0.003  # typical step of a keypoint over the surface between frames, metres
STEP_FILTERS = (1.0, 2.5, 6.0)  # standard deviations of the Gaussian filters of steps, frames
TEMPORAL_FEATURES = 3 + 60 + 5 * 63 + 2 * 21 + 6 + 1  # width of `TemporalEvidence.features`
CANDIDATES = 2 + len(STEP_FILTERS)  # candidate changes of each step that the network mixes
ANSWERS = 21 * (CANDIDATES + 3 + 2)  # network outputs per frame
SHAKING = 0.008  # input noise (standard deviation) at which positions get no extra weight, metres
LEAST_NOISE = 0.05  # lower bound of `TemporalEvidence.noisiness`
SURENESS = 6.0  # bound of the absolute log weight


@dataclass(frozen=True)
class TemporalConfig(NetworkConfig):
    """Size of the network; one token per frame."""

    width: int = 160
    depth: int = 4
    heads: int = 4


@dataclass(frozen=True)
class TemporalEvidence(Bundle):
    """The input of TemporalDiff over T frames, in the frame of the object's first part."""

    joints: Float[Tensor, "B T 21 3"]  # after SpatialDiff, metres
    nearest: Float[Tensor, "B T 21 3"]  # the surface point nearest to each keypoint
    normals: Float[Tensor, "B T 21 3"]  # outward, there
    carried: Float[Tensor, "B T 21 3"]
    """Step to the next frame of a point that is at the keypoint and moves rigidly with the nearest
    object part; zero for the first part. The last frame's step is unused."""
    rotation: Float[Tensor, "B T 3 3"]  # first part's frame to world
    translation: Float[Tensor, "B T 3"]
    observed: Float[Tensor, "B T 21 3"]  # the input, gaps filled
    trust: Float[Tensor, "B T"]  # 0 where a frame was filled in, else its mean confidence, <= 1

    @classmethod
    def at(
        cls,
        surface: ObjectSurface,
        joints: Float[Tensor, "B T 21 3"],
        observed: Float[Tensor, "B T 21 3"],
        trust: Float[Tensor, "B T"],
    ) -> "TemporalEvidence":
        """The evidence of world-frame hands: `joints` after SpatialDiff, `observed` the input."""
        near = nearest_on_parts(joints, surface)
        rotation, translation = surface.rotation[:, :, 0], surface.translation[:, :, 0]
        own, nearest, seen = (
            (points - translation[:, :, None]) @ rotation
            for points in (joints, near.points, observed)
        )
        carried = torch.zeros_like(joints)
        for part in range(1, surface.rotation.shape[2]):
            turn, shift = surface.rotation[:, :, part], surface.translation[:, :, part, None]
            local = (joints - shift) @ turn
            after = local[:, :-1] @ turn[:, 1:].mT + shift[:, 1:]
            after = (after - translation[:, 1:, None]) @ rotation[:, 1:]
            step = pad(after - own[:, :-1], (0, 0, 0, 0, 0, 1))
            carried = torch.where((near.part == part)[..., None], step, carried)
        normals = near.normals @ rotation
        return cls(own, nearest, normals, carried, rotation, translation, seen, trust)

    @property
    def steps(self) -> Float[Tensor, "B T 21 3"]:
        """Step of each keypoint to the next frame, relative to the surface; 0 in the last frame."""
        over = self.joints.diff(dim=1) - self.carried[:, :-1]
        return pad(over, (0, 0, 0, 0, 0, 1))

    def from_world(self, joints: Float[Tensor, "B T 21 3"]) -> Float[Tensor, "B T 21 3"]:
        """Other keypoints, from the world frame into the frame of the first part."""
        return (joints - self.translation[:, :, None]) @ self.rotation

    def noisiness(self) -> Float[Tensor, " B"]:
        """Standard deviation of the input around the hand after SpatialDiff, in units of `SHAKING`,
        between `LEAST_NOISE` and 1."""
        noise = self.observed - self.joints
        shaking = (noise - noise.mean(1, keepdim=True)).square().sum(-1).mean((1, 2)).sqrt()
        return (shaking / SHAKING).clamp(LEAST_NOISE, 1.0)

    def features(self, axes: Float[Tensor, "B 3 3"]) -> Float[Tensor, "B T F"]:
        """Network input features of each frame, in the given axes."""
        turn = axes[:, None]
        joints, wrist = self.joints, self.joints[:, :, :1]
        offset = (self.nearest - joints) @ turn
        close = torch.exp(-offset.norm(dim=-1) / CLOSE)
        height = -(offset * (self.normals @ turn)).sum(-1)
        steps = self.steps @ turn / STEP_UNIT
        before = pad(steps[:, :-1], (0, 0, 0, 0, 1, 0))
        noise = (self.observed - joints) @ turn / 0.02
        jitter = pad(noise.diff(dim=1), (0, 0, 0, 0, 0, 1))
        drift = (wrist - wrist.mean(1, keepdim=True)) @ turn
        parts = [
            drift.flatten(2) / 0.03,
            ((joints - wrist)[:, :, 1:] @ turn / 0.06).flatten(2),
            (offset * close[..., None] / 0.01).flatten(2),
            close,
            (height * close / 0.01).clamp(-3, 3),
            steps.flatten(2).clamp(-10, 10),
            before.flatten(2).clamp(-10, 10),
            noise.flatten(2).clamp(-10, 10),
            jitter.flatten(2).clamp(-10, 10),
            self._object_motion(axes),
            self.trust[..., None],
        ]
        return torch.cat(parts, dim=-1)

    def _object_motion(self, axes: Float[Tensor, "B 3 3"]) -> Float[Tensor, "B T 6"]:
        """Motion of the first part to the next frame, at the hand; see `object_rates`."""
        turn = self.rotation[:, :-1].mT @ self.rotation[:, 1:]
        middle = self.joints[:, :-1].mean(2)
        shift = self.translation.diff(dim=1)[..., None, :] @ self.rotation[:, :-1]
        move = (turn @ middle[..., None])[..., 0] - middle + shift[..., 0, :]
        return object_rates(move, turn, axes)


@dataclass(frozen=True)
class StepCorrection(Bundle):
    """The output of TemporalDiff: corrections of the steps, and log weights."""

    change: Float[Tensor, "B T 21 3"]
    """Clean minus input step, metres, in the frame of the first part; the last frame, which has no
    step, repeats the one before."""
    steps: Float[Tensor, "B T 21"]  # log weight of each clean step, 0 for the usual weight
    places: Float[Tensor, "B T 21"]  # log weight of each keypoint's input position


class TemporalDenoiser(nn.Module):
    """A transformer over frames that corrects the steps of a hand."""

    def __init__(self, config: TemporalConfig) -> None:
        """Build the network; its last layer starts at zero, so that the initial change is zero."""
        super().__init__()
        self.config = config
        self.embed = nn.Linear(TEMPORAL_FEATURES, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, ANSWERS))

    def forward(self, evidence: TemporalEvidence) -> StepCorrection:
        """The correction of the steps of B hands over at least two frames."""
        axes = palm_axes(evidence.joints)  # makes the output rotation equivariant
        tokens = self.embed(evidence.features(axes))
        tokens = self.trunk(tokens, tokens.new_zeros(len(tokens)))
        # the last frame has no step
        answer = self.head(tokens[:, :-1]).unflatten(-1, (21, -1))
        mix, offset, sure = answer.split((CANDIDATES, 3, 2), dim=-1)
        steps = evidence.steps[:, :-1]
        # candidates: zero motion over the surface, the observed steps, and smoothed steps
        observed = (evidence.observed - evidence.joints).diff(dim=1)
        smoother = (gaussian_means(steps, deviation) - steps for deviation in STEP_FILTERS)
        candidates = torch.stack([-steps, observed, *smoother], dim=-1)
        change = (candidates * mix[..., None, :]).sum(-1)
        change = change + STEP_UNIT * offset @ axes[:, None].mT
        sure = SURENESS * torch.tanh(sure / SURENESS)
        # a hand that the stages before hardly changed keeps its positions
        places = sure[..., 1] - 4 * evidence.noisiness().log()[:, None, None]
        own = StepCorrection(change, sure[..., 0], places)
        return own.map(lambda values: torch.cat([values, values[:, -1:]], dim=1))


def gaussian_means(
    values: Float[Tensor, "B T 21 3"], deviation: float
) -> Float[Tensor, "B T 21 3"]:
    """Gaussian filter over time; `deviation` is its standard deviation in frames."""
    time = torch.arange(values.shape[1], device=values.device)
    weight = torch.exp(-0.5 * ((time[:, None] - time) / deviation).square())
    weight = (weight / weight.sum(1, keepdim=True)).to(values)
    return torch.einsum("ts,bsjc->btjc", weight, values)
