"""TemporalDiff: how the hand moves over the object (paper 3.2; our form of it).

In one call, without a diffusion, the denoiser answers with the clean step of every keypoint over
the surface near it, and with how sure it is of each step and of each place. `geneoh.fitting.align`
finds the hand that agrees with both. The paper's form is `geneoh.denoisers.latent`.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import pad

from geneoh.bundle import Bundle
from geneoh.denoisers.base import object_rates
from geneoh.nn.blocks import FrameTransformer, zeroed
from geneoh.nn.sizes import NetworkConfig
from geneoh.representation.region import ObjectSurface
from geneoh.representation.steps import SurfaceMotion
from geneoh.sequence.keypoints import palm_axes

STEP_UNIT = 0.003  # typical step of a keypoint over the surface between frames, metres
CLOSE = 0.02  # distance over which closeness to the surface decays, metres
SMOOTHING = (1.0, 2.5, 6.0)  # deviations in frames of the Gaussians whose smoothed steps are read
TEMPORAL_FEATURES = 3 + 60 + 5 * 63 + 2 * 21 + 6 + 1  # width of `TemporalEvidence.features`
CANDIDATES = 2 + len(SMOOTHING)  # changes of each step that the network mixes
ANSWERS = 21 * (CANDIDATES + 3 + 2)  # numbers that the network answers per frame
SHAKING = 0.008  # deviation of an input whose places are not relied on, metres
LEAST_NOISE = 0.05  # least share of that
SURENESS = 6.0  # largest size of the logarithm of a weight


@dataclass(frozen=True)
class TemporalConfig(NetworkConfig):
    """Size of the network; one token per frame."""

    width: int = 160
    depth: int = 4
    heads: int = 4


@dataclass(frozen=True)
class TemporalEvidence(SurfaceMotion):
    """What TemporalDiff sees, in the frame of the object's first part."""

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
        """The evidence of hands of the world, after SpatialDiff and as they were observed."""
        motion = SurfaceMotion.of(joints, surface)
        return cls(**vars(motion), observed=motion.from_world(observed), trust=trust)

    def noisiness(self) -> Float[Tensor, " B"]:
        """How far the input shakes around the hand that SpatialDiff leaves, in `SHAKING`, at most
        1."""
        off = self.observed - self.joints
        shaking = (off - off.mean(1, keepdim=True)).square().sum(-1).mean((1, 2)).sqrt()
        return (shaking / SHAKING).clamp(LEAST_NOISE, 1.0)

    def features(self, axes: Float[Tensor, "B 3 3"]) -> Float[Tensor, "B T F"]:
        """What the network reads of each frame, in the given axes."""
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
        """Step and turn of the first part to the next frame, at the hand, in 3 mm and 0.03 rad."""
        turn = self.rotation[:, :-1].mT @ self.rotation[:, 1:]
        middle = self.joints[:, :-1].mean(2)
        shift = self.translation.diff(dim=1)[..., None, :] @ self.rotation[:, :-1]
        move = (turn @ middle[..., None])[..., 0] - middle + shift[..., 0, :]
        return object_rates(move, turn, axes)


@dataclass(frozen=True)
class StepCorrection(Bundle):
    """What TemporalDiff answers: clean steps over the surface, and how sure it is of what."""

    change: Float[Tensor, "B T 21 3"]
    """From each step to the clean one, metres, in the frame of the first part; the last frame,
    which has no next one, repeats the one before."""
    steps: Float[Tensor, "B T 21"]  # log weight of each step, 0 for the usual one
    places: Float[Tensor, "B T 21"]  # the same of each place: that the keypoint stays where it is


class TemporalDenoiser(nn.Module):
    """A transformer over frames that maps the steps of a hand to the clean ones."""

    def __init__(self, config: TemporalConfig) -> None:
        """Build the network; its last layer starts at zero, so it starts by changing nothing."""
        super().__init__()
        self.config = config
        self.embed = nn.Linear(TEMPORAL_FEATURES, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, ANSWERS))

    def forward(self, evidence: TemporalEvidence) -> StepCorrection:
        """The correction of the steps of B hands over at least two frames."""
        axes = palm_axes(evidence.joints)  # so that the answer turns with the hand
        tokens = self.embed(evidence.features(axes))
        tokens = self.trunk(tokens, tokens.new_zeros(len(tokens)))
        # the last frame has no step
        answer = self.head(tokens[:, :-1]).unflatten(-1, (21, -1))
        mix, offset, sure = answer.split((CANDIDATES, 3, 2), dim=-1)
        steps = evidence.steps[:, :-1]
        # toward no motion over the surface, the observed steps, and smoother ones
        observed = (evidence.observed - evidence.joints).diff(dim=1)
        smoother = (gaussian_means(steps, deviation) - steps for deviation in SMOOTHING)
        candidates = torch.stack([-steps, observed, *smoother], dim=-1)
        change = (candidates * mix[..., None, :]).sum(-1)
        change = change + STEP_UNIT * offset @ axes[:, None].mT
        sure = SURENESS * torch.tanh(sure / SURENESS)
        # a hand that the stages before hardly changed needs no other places
        places = sure[..., 1] - 4 * evidence.noisiness().log()[:, None, None]
        own = StepCorrection(change, sure[..., 0], places)
        return own.map(lambda values: torch.cat([values, values[:, -1:]], dim=1))


def gaussian_means(
    values: Float[Tensor, "B T 21 3"], deviation: float
) -> Float[Tensor, "B T 21 3"]:
    """Means over the frames with Gaussian weights; `deviation` is in frames."""
    time = torch.arange(values.shape[1], device=values.device)
    weight = torch.exp(-0.5 * ((time[:, None] - time) / deviation).square())
    weight = (weight / weight.sum(1, keepdim=True)).to(values)
    return torch.einsum("ts,bsjc->btjc", weight, values)
