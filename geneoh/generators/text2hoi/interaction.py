"""The network that denoises hands and object together, conditioned on a sentence and an object.

Source: Text2HOI, section 3.4 and supplement: a transformer over tokens of the left hand, the right
hand and the object of each frame, behind a token of the condition. It predicts the clean sample.
Ours (`form="ours"`): several frames to a token, pre-norm blocks with rotary positions, tokens of
places on the object beside that of the condition, so that attention can place hands by geometry,
numbers of unit variance. `form="paper"` is the paper's; without its dropout, because all random
numbers of a run come from its own generator.
"""

from dataclasses import dataclass, field
from functools import cache
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from geneoh.bundle import Bundle
from geneoh.diffusion.schedule import cosine_sigmas
from geneoh.generators.text2hoi.condition import Condition
from geneoh.generators.text2hoi.object_tokens import ObjectTokens, WholeObject
from geneoh.generators.text2hoi.pointnet import PointConfig
from geneoh.generators.text2hoi.post_norm import PostNormTransformer, sinusoid
from geneoh.generators.text2hoi.tokens import HAND, NUMBERS, OBJECT, HandFrame
from geneoh.nn.blocks import FrameTransformer

LEAST_DEVIATION = 0.02
"""Deviations of numbers below this one (m, dm, entries of rotations) count as this large."""
AGENT_ROWS = (1, 1666, 3333)
"""Rows of the paper's sinusoid table that tell the left hand, the right hand and the object."""


@dataclass(frozen=True)
class InteractionConfig:
    """Size and form of the network; the paper's are `configs/text2hoi_paper.toml`."""

    form: Literal["ours", "paper"] = "ours"
    width: int = 160  # features of a token
    depth: int = 6  # transformer blocks
    heads: int = 5
    frames_per_token: int = 10  # frames of an agent in one token (paper: 1)
    text: int = 128  # features of a sentence, those of the text encoder
    object_points: int = 512  # points of the object that are looked at (paper: 1,024)
    object_tokens: int = 16  # places of the object with a token of their own (paper: none)
    frame: HandFrame = "object"  # axes that hands are written in (paper: the world's)
    normalised: bool = True  # whether numbers are scaled to unit variance (paper: no)
    points: PointConfig = field(default_factory=PointConfig)


@dataclass(frozen=True)
class Told(Bundle):
    """A condition as the network holds it, the same at all noise levels."""

    tokens: Float[Tensor, "B K D"]  # of the condition as a whole, then of places on the object
    seen: Bool[Tensor, "B K"]
    step_seen: Bool[Tensor, "B S 3"]  # tokens of left hand, right hand and object that are there
    shown: Bool[Tensor, "B T 208"]
    time: Float[Tensor, "B S D"]  # what is added to all tokens of a step


class InteractionNetwork(nn.Module):
    """From noisy numbers of hands and object to the clean ones."""

    mean: Tensor
    std: Tensor

    def __init__(self, config: InteractionConfig) -> None:
        """Build the network with random weights."""
        super().__init__()
        self.config = config
        width, frames, ours = config.width, config.frames_per_token, config.form == "ours"
        self.register_buffer("mean", torch.zeros(NUMBERS))
        self.register_buffer("std", torch.ones(NUMBERS))
        self.inputs = nn.ModuleList(nn.Linear(frames * n, width) for n in (HAND, HAND, OBJECT))
        self.outputs = nn.ModuleList(
            nn.Linear(k * width, frames * n) for k, n in ((2, HAND), (2, HAND), (1, OBJECT))
        )
        self.text = nn.Linear(config.text, width)
        sizes = (config.points, width, config.object_points)
        self.object = ObjectTokens(*sizes, config.object_tokens) if ours else WholeObject(*sizes)
        self.time = nn.Linear(5, width) if ours else None
        self.agents = nn.Parameter(0.1 * torch.randn(3, width)) if ours else None
        if ours:
            self.trunk = FrameTransformer(width, config.depth, config.heads)
        else:
            self.trunk = PostNormTransformer(width, config.depth, config.heads)

    @property
    def sigmas(self) -> Float[Tensor, " N"]:
        """Noise of each level, in units of the deviation of numbers."""
        return _sigmas(self.mean.device)

    def normalise(self, numbers: Float[Tensor, "B T 208"]) -> Float[Tensor, "B T 208"]:
        """Numbers in units of their deviation."""
        return (numbers - self.mean) / self.std

    def denormalise(self, numbers: Float[Tensor, "B T 208"]) -> Float[Tensor, "B T 208"]:
        """Inverse of `normalise`."""
        return numbers * self.std + self.mean

    def told(self, condition: Condition) -> Told:
        """A condition made ready for `denoised`."""
        steps = _steps(condition.valid, self.config.frames_per_token)
        whole, places = self.object(condition.objects, condition.contact)
        given = condition.object_given[:, None]
        text = self.text(condition.text * condition.text_given[:, None])
        whole = (text + whole * given)[:, None]
        seen = torch.cat([torch.ones_like(given), given.expand(-1, places.shape[1])], dim=1)
        there = torch.cat([condition.present, torch.ones_like(given)], dim=1)
        step_seen = steps.any(-1)[..., None] & there[:, None]
        time = whole.new_zeros(*steps.shape[:2], whole.shape[-1])
        if self.time is not None:
            time = whole + self.time(moments(steps))
        return Told(torch.cat([whole, places], dim=1), seen, step_seen, condition.shown, time)

    def denoised(
        self, x: Float[Tensor, "B T 208"], level: Float[Tensor, " B"], told: Told
    ) -> Float[Tensor, "B T 208"]:
        """The clean numbers, normalised, in `x` = clean + sigma * noise.

        `level` is the number of the noise level, 0 to 1,000 (see `cosine_sigmas`). What is not
        shown is zero, and what stands there in `x` has no effect.
        """
        sigma = self.sigmas[level.long()]
        scaled = x * told.shown / (1 + sigma.square()).sqrt()[:, None, None]
        tokens, position = self.sequence(scaled, told)
        seen = torch.cat([told.seen, told.step_seen.flatten(1)], dim=1)
        quarter = 0.25 * sigma.clamp(min=1e-4).log() if self.time is not None else level
        after = self.trunk(tokens, quarter, position, seen)[:, told.tokens.shape[1] :]
        left, right, thing = after.unflatten(1, (-1, 3)).unbind(2)
        read = (torch.cat([left, thing], -1), torch.cat([right, thing], -1), thing)
        frames = self.config.frames_per_token
        found = [
            out(r).unflatten(-1, (frames, -1)).flatten(1, 2)
            for out, r in zip(self.outputs, read, strict=True)
        ]
        return torch.cat(found, dim=-1)[:, : x.shape[1]] * told.shown

    def sequence(
        self, scaled: Float[Tensor, "B T 208"], told: Told
    ) -> tuple[Float[Tensor, "B N D"], Float[Tensor, " N"]]:
        """All tokens and their positions: the condition's, then left, right, object step by step.

        The condition has position 0 and step s position s, counted from 1 (paper: s is a frame).
        """
        short = -scaled.shape[1] % self.config.frames_per_token
        steps = nn.functional.pad(scaled, (0, 0, 0, short)).unflatten(
            1, (-1, self.config.frames_per_token)
        )
        agents = steps.split([HAND, HAND, OBJECT], dim=-1)
        tokens = torch.stack(
            [read(agent.flatten(-2)) for read, agent in zip(self.inputs, agents, strict=True)], 2
        )
        tokens = tokens + told.time[:, :, None] + self._agents(tokens)
        tokens = torch.cat([told.tokens, tokens.flatten(1, 2)], dim=1)
        numbers = torch.arange(1, steps.shape[1] + 1, device=scaled.device)
        condition = numbers.new_zeros(told.tokens.shape[1])
        return tokens, torch.cat([condition, numbers.repeat_interleave(3)]).to(scaled)

    def _agents(self, tokens: Tensor) -> Float[Tensor, "3 D"]:
        if self.agents is not None:
            return self.agents
        return sinusoid(torch.tensor(AGENT_ROWS).to(tokens), tokens.shape[-1])


@cache
def _sigmas(device: torch.device) -> Float[Tensor, " N"]:
    return cosine_sigmas().float().to(device)


def _steps(valid: Bool[Tensor, "B T"], frames: int) -> Bool[Tensor, "B S F"]:
    """Frames before the end, by the token that they are in."""
    return nn.functional.pad(valid, (0, -valid.shape[1] % frames)).unflatten(1, (-1, frames))


def moments(steps: Bool[Tensor, "B S F"]) -> Float[Tensor, "B S 5"]:
    """When a step is: since the start and to the end, as shares, in 5 s, and how near they are."""
    length = steps.sum((1, 2), dtype=torch.float32)[:, None]
    middle = (torch.arange(steps.shape[1], device=steps.device) + 0.5) * steps.shape[2]
    left = (length - middle).clamp(min=0)
    middle = middle.expand_as(left)
    near = (torch.exp(-middle / 10), torch.exp(-left / 10))
    return torch.stack([middle / length, middle / 150, left / 150, *near], dim=-1)
