"""The network that denoises hands and object together, conditioned on a sentence and an object.

Source: Text2HOI, section 3.2 and supplement: a transformer over tokens of the left hand, the right
hand and the object of each frame, behind a token of the condition. It predicts the clean sample.
Ours (`form="ours"`): several frames per token, in coordinates along their principal axes, with the
Wiener estimate beside them; pre-norm blocks with rotary positions, whose output counts more the
noisier the tokens are (Karras et al. 2022); tokens of places on the object beside that of the
condition, so that attention can place hands by geometry; features of unit variance. `form="paper"`
is the paper's, without its dropout, because a run draws all its random numbers from one generator.
"""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from geneoh.bundle import Bundle
from geneoh.config import Limits
from geneoh.diffusion.schedule import cosine_levels
from geneoh.generators.text2hoi.networks.objects import (
    Objects,
    ObjectTokens,
    PointConfig,
    WholeObject,
)
from geneoh.generators.text2hoi.networks.post_norm import PostNormTransformer
from geneoh.generators.text2hoi.networks.principal_axes import (
    PrincipalAxes,
    Waves,
    axes_of_most_variance,
)
from geneoh.generators.text2hoi.networks.tokens import (
    HAND,
    NUMBERS,
    OBJECT,
    HandFrame,
    Tokens,
    defined_numbers,
    tokens_of,
)
from geneoh.nn.blocks import FrameTransformer, NetworkConfig, drawn, in_steps, sinusoid, zeroed
from geneoh.streamed import Streamed
from geneoh.synthesis.actions.action import LONGEST, Actions

AGENT_ROWS = (1, 1666, 3333)
"""Rows of the paper's sinusoid table that encode the left hand, the right hand and the object."""
LEAST_DEVIATION = 0.02
"""Lower bound of the features' standard deviations (m, dm, entries of rotations)."""
MOST_FITTED = 512  # largest number of clips that means, deviations and axes are fitted to


@dataclass(frozen=True)
class Condition(Bundle):
    """The conditions of B clips of at most T frames."""

    text: Float[Tensor, "B W"]  # features of the sentence
    objects: Objects
    contact: Float[Tensor, "B P"]  # probability that a point is touched
    present: Bool[Tensor, "B 2"]  # whether the left, and whether the right hand takes part
    valid: Bool[Tensor, "B T"]  # frames before the end
    text_given: Bool[Tensor, " B"]  # false where the sentence is dropped
    object_given: Bool[Tensor, " B"]  # false where object and contact map are dropped

    @property
    def shown(self) -> Bool[Tensor, "B T 208"]:
        """Mask of defined features: of hands that take part, in frames before the end."""
        return defined_numbers(self.present, self.valid, self.objects.jointed)

    def without_text(self) -> "Condition":
        """The same condition without the sentence, for guidance."""
        return replace(self, text_given=torch.zeros_like(self.text_given))


@dataclass(frozen=True)
class InteractionConfig(NetworkConfig):
    """Size and form of the network; the paper's are `configs/interaction_paper.toml`."""

    LIMITS: ClassVar[Limits] = {"object_tokens": (0, 4096)}

    form: Literal["ours", "paper"] = "ours"
    width: int = 160  # features of a token
    depth: int = 6  # transformer blocks
    heads: int = 5
    frames_per_token: int = 10  # frames of an agent in one token (paper: 1)
    text: int = 128  # features of a sentence, those of the text encoder
    object_points: int = 512  # points of the object that are read (paper: 1,024)
    object_tokens: int = 16  # places of the object with a token of their own (paper: none)
    frame: HandFrame = "object"  # coordinate frame of the hands (paper: the world)
    normalised: bool = True  # whether features are scaled to unit variance (paper: no)
    points: PointConfig = field(default_factory=PointConfig)


@dataclass(frozen=True)
class EncodedAction(Bundle):
    """An encoded condition, computed once for all noise levels."""

    tokens: Float[Tensor, "B K D"]  # of the condition as a whole, then of places on the object
    seen: Bool[Tensor, "B K"]
    step_seen: Bool[Tensor, "B S 3"]  # which tokens of left hand, right hand and object exist
    shown: Bool[Tensor, "B T 208"]
    time: Float[Tensor, "B S D"]  # added to all tokens of a step


class InteractionNetwork(nn.Module):
    """Predicts clean features of hands and object from noisy ones."""

    mean: Tensor
    std: Tensor

    def __init__(self, config: InteractionConfig) -> None:
        super().__init__()
        self.config = config
        width, frames, ours = config.width, config.frames_per_token, config.form == "ours"
        self.register_buffer("mean", torch.zeros(NUMBERS))
        self.register_buffer("std", torch.ones(NUMBERS))
        numbers = [frames * n for n in (HAND, HAND, OBJECT)]
        axes = (PrincipalAxes(n, width, -(-LONGEST // frames)) for n in numbers if ours)
        self.axes = nn.ModuleList(axes)
        sizes = [width] * 3 if ours else numbers
        self.inputs = nn.ModuleList(nn.Linear(2 * n if ours else n, width) for n in sizes)
        self.outputs = nn.ModuleList(
            nn.Linear(k * width, n) for k, n in zip((2, 2, 1), sizes, strict=True)
        )
        if ours:
            for layer in self.outputs:
                zeroed(layer)
        self.text = nn.Linear(config.text, width)
        seen = (config.points, width, config.object_points)
        self.object = ObjectTokens(*seen, config.object_tokens) if ours else WholeObject(*seen)
        self.time = nn.Linear(5, width) if ours else None
        self.agents = nn.Parameter(drawn(0.1, 3, width)) if ours else None
        if ours:
            self.trunk = FrameTransformer(width, config.depth, config.heads)
        else:
            self.trunk = PostNormTransformer(width, config.depth, config.heads)

    @property
    def sigmas(self) -> Float[Tensor, " N"]:
        """Standard deviation of the noise at each level, in units of the features' own."""
        return cosine_levels(self.mean.device)

    @property
    def codecs(self) -> list["PrincipalAxes"]:
        """The principal axes of left hand, right hand and object; none in the paper's form."""
        return [axes for axes in self.axes if isinstance(axes, PrincipalAxes)]

    def normalise(self, numbers: Float[Tensor, "B T 208"]) -> Float[Tensor, "B T 208"]:
        """Features minus their mean, in units of their standard deviation."""
        return (numbers - self.mean) / self.std

    def denormalise(self, numbers: Float[Tensor, "B T 208"]) -> Float[Tensor, "B T 208"]:
        """Inverse of `normalise`."""
        return numbers * self.std + self.mean

    def encode(self, condition: Condition) -> EncodedAction:
        """Encode a condition for `denoised`."""
        steps = in_steps(condition.valid, self.config.frames_per_token)
        whole, places = self.object(condition.objects, condition.contact)
        known = condition.object_given[:, None]
        text = self.text(condition.text * condition.text_given[:, None])
        whole = (text + whole * known)[:, None]
        seen = torch.cat([torch.ones_like(known), known.expand(-1, places.shape[1])], dim=1)
        there = torch.cat([condition.present, torch.ones_like(known)], dim=1)
        step_seen = steps.any(-1)[..., None] & there[:, None]
        time = whole.new_zeros(*steps.shape[:2], whole.shape[-1])
        if self.time is not None:
            time = whole + self.time(moments(steps))
        return EncodedAction(
            torch.cat([whole, places], dim=1), seen, step_seen, condition.shown, time
        )

    def denoised(
        self, x: Float[Tensor, "B T 208"], level: Float[Tensor, " B"], action: EncodedAction
    ) -> Float[Tensor, "B T 208"]:
        """Prediction of the clean normalised features in `x` = clean + sigma * noise.

        `level` is the index of the noise level, 0 to 1,000 (see `cosine_sigmas`). Features that are
        not `shown` have no effect in `x` and are zero in the result.
        """
        sigma = self.sigmas[level.long()]
        steps = in_steps(x * action.shown, self.config.frames_per_token)
        agents = [agent.flatten(-2) for agent in steps.split([HAND, HAND, OBJECT], dim=-1)]
        codecs, waves, linear = self.codecs, None, []
        if codecs:
            waves = Waves.of(action.step_seen[..., 2], len(codecs[0].covariance))
            both = [axes.read(n, sigma, waves) for axes, n in zip(codecs, agents, strict=True)]
            own, linear = [torch.cat(pair, dim=-1) for pair in both], [pair[1] for pair in both]
        else:
            own = [agent / (1 + sigma.square()).sqrt()[:, None, None] for agent in agents]
        tokens, position = self.sequence(own, action)
        seen = torch.cat([action.seen, action.step_seen.flatten(1)], dim=1)
        quarter = 0.25 * sigma.clamp(min=1e-4).log() if self.time is not None else level
        after = self.trunk(tokens, quarter, position, seen)[:, action.tokens.shape[1] :]
        left, right, thing = after.unflatten(1, (-1, 3)).unbind(2)
        read = (torch.cat([left, thing], -1), torch.cat([right, thing], -1), thing)
        found = [write(r) for write, r in zip(self.outputs, read, strict=True)]
        if waves is not None:
            found = [
                axes.write(guess, answer, sigma, waves)
                for axes, guess, answer in zip(codecs, linear, found, strict=True)
            ]
        frames = [f.unflatten(-1, (self.config.frames_per_token, -1)).flatten(1, 2) for f in found]
        return torch.cat(frames, dim=-1)[:, : x.shape[1]] * action.shown

    def sequence(
        self, own: list[Float[Tensor, "B S _"]], action: EncodedAction
    ) -> tuple[Float[Tensor, "B N D"], Float[Tensor, " N"]]:
        """All tokens and their positions: the condition's, then left, right, object step by step.

        `own` are the features of each agent (left hand, right hand, object) in each step. The
        condition has position 0 and step s position s, counted from 1 (paper: s is a frame).
        """
        read = [layer(agent) for layer, agent in zip(self.inputs, own, strict=True)]
        tokens = torch.stack(read, dim=2) + action.time[:, :, None]
        rows = torch.tensor(AGENT_ROWS).to(tokens)
        own_agents = sinusoid(rows, tokens.shape[-1]) if self.agents is None else self.agents
        tokens = tokens + own_agents
        steps = tokens.shape[1]
        tokens = torch.cat([action.tokens, tokens.flatten(1, 2)], dim=1)
        numbers = torch.arange(1, steps + 1, device=tokens.device)
        condition = numbers.new_zeros(action.tokens.shape[1])
        return tokens, torch.cat([condition, numbers.repeat_interleave(3)]).to(tokens)


def moments(steps: Bool[Tensor, "B S F"]) -> Float[Tensor, "B S 5"]:
    """Time features of each step: time since the start over the length, times since the start and
    to the end in units of 5 s, and exp(-frames / 10) for both."""
    length = steps.sum((1, 2), dtype=torch.float32)[:, None]
    middle = (torch.arange(steps.shape[1], device=steps.device) + 0.5) * steps.shape[2]
    left = (length - middle).clamp(min=0)
    middle = middle.expand_as(left)
    near = (torch.exp(-middle / 10), torch.exp(-left / 10))
    return torch.stack([middle / length, middle / 150, left / 150, *near], dim=-1)


@torch.no_grad()
def set_statistics(network: InteractionNetwork, actions: Streamed[Actions]) -> None:
    """Fit the means and standard deviations of features to clips and their mirror images.

    In our form the principal axes are fitted as well.
    """
    some = actions.take(slice(None, None, -(-len(actions) // MOST_FITTED)))
    both = [tokens_of(each, network.config.frame) for each in (some, some.mirrored())]
    total, square, count = (torch.zeros(len(network.mean), dtype=torch.float64) for _ in range(3))
    for tokens in both:
        numbers = (tokens.flat * tokens.defined).double()
        total += numbers.sum((0, 1))
        square += numbers.square().sum((0, 1))
        count += tokens.defined.sum((0, 1))
    mean = total / count.clamp(min=1)
    std = (square / count.clamp(min=1) - mean.square()).clamp(min=0).sqrt()
    network.mean.copy_(mean)
    network.std.copy_(std.clamp(min=LEAST_DEVIATION))
    if network.config.form == "ours":
        set_axes(network, both)


@torch.no_grad()
def set_axes(network: InteractionNetwork, clips: list[Tokens]) -> None:
    """Fit the principal axes of whole tokens, and the autocovariance over tokens along each."""
    frames = network.config.frames_per_token
    steps = [in_steps(network.normalise(t.flat) * t.defined, frames) for t in clips]
    whole = [in_steps(t.shown.transpose(1, 2), frames).all(2) for t in clips]
    agents = torch.cat(steps).split([HAND, HAND, OBJECT], dim=-1)
    for index, codec in enumerate(network.codecs):
        numbers, there = agents[index].flatten(2), torch.cat(whole)[..., index]
        axes = axes_of_most_variance(numbers[there])[: len(codec.axes)]
        codec.axes.zero_()
        codec.axes[: len(axes)] = axes
        places = numbers @ codec.axes.T
        codec.covariance.zero_()
        for lag in range(min(len(codec.covariance), there.shape[1])):
            both = there[:, lag:] & there[:, : there.shape[1] - lag]
            product = (places[:, lag:] * places[:, : places.shape[1] - lag])[both]
            codec.covariance[lag] = product.sum(0) / max(1, len(product))
