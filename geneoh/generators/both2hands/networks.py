"""The networks of BOTH2Hands: two denoise hands, by the body or by a sentence, and one blends them.

Source: BOTH2Hands, sections 4.1 to 4.3, and its code. All predict the clean sample. Ours
(`form="ours"`): one token per hand for several frames, pre-norm blocks with rotary positions, and
tokens of the words beside that of the sentence, so that each hand can attend to the words about it.
`form="paper"` has one token per frame and one for the condition, and post-norm blocks whose heads
have a width of their own; without dropout, because all random numbers of a run come from its own
generator.

In the first block of the blend the body's hands attend to the sentence's, in the second the result
attends to the body's hands, and so on; every block is used, where the paper's code leaves the last
one out. Ours adds the output to the weighted mean of both and blends in every step of the reverse
process, in which both networks denoise the same noisy hands, so that their predictions fit each
other. The paper blends hands of two separate reverse processes.
"""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from geneoh.bundle import Bundle
from geneoh.config import Limits
from geneoh.diffusion.schedule import cosine_levels
from geneoh.generators.both2hands.features import BODY, HANDS, HandsFrame, Scale, Scaling
from geneoh.generators.text import SentenceConfig, SentenceNetwork
from geneoh.nn.blocks import FrameTransformer, NetworkConfig, in_steps, mlp, sinusoid, zeroed
from geneoh.synthesis.gestures.clips import NAMES

Form = Literal["ours", "paper"]


class PaperBlock(nn.Module):
    """Attention of tokens to a memory, then a feed-forward layer, each followed by its norm."""

    def __init__(self, width: int, heads: int, head_width: int) -> None:
        super().__init__()
        self.heads, inner = heads, heads * head_width
        self.query, self.key, self.value = (nn.Linear(width, inner) for _ in range(3))
        self.project = nn.Linear(inner, width)
        self.norm_attention = nn.LayerNorm(width)
        self.forward_layers = nn.Sequential(
            nn.Linear(width, width), nn.ReLU(), nn.Linear(width, width)
        )
        self.norm_forward = nn.LayerNorm(width)

    def forward(
        self, tokens: Float[Tensor, "B N D"], memory: Float[Tensor, "B M D"]
    ) -> Float[Tensor, "B N D"]:
        """One update of the tokens; the memory is the tokens themselves for self-attention."""
        q, k, v = (
            layer(each).unflatten(-1, (self.heads, -1)).transpose(1, 2)
            for layer, each in ((self.query, tokens), (self.key, memory), (self.value, memory))
        )
        found = nn.functional.scaled_dot_product_attention(q, k, v)
        found = self.project(found.transpose(1, 2).flatten(-2))
        tokens = self.norm_attention(tokens + found)
        return self.norm_forward(tokens + self.forward_layers(tokens))


class PaperTransformer(nn.Module):
    """Blocks of self-attention; the noise level is added to the first token."""

    def __init__(self, width: int, depth: int, heads: int, head_width: int) -> None:
        super().__init__()
        self.level = nn.Sequential(nn.Linear(64, 256), nn.GELU(), nn.Linear(256, width))
        self.blocks = nn.ModuleList(PaperBlock(width, heads, head_width) for _ in range(depth))

    def forward(
        self, tokens: Float[Tensor, "B N D"], level: Float[Tensor, " B"]
    ) -> Float[Tensor, "B N D"]:
        """Tokens after all blocks; `level` is the index of the noise level, 0 to 1,000."""
        first = tokens[:, :1] + self.level(sinusoid(level, 64))[:, None]
        tokens = torch.cat([first, tokens[:, 1:]], dim=1)
        place = torch.arange(1, tokens.shape[1] + 1, device=tokens.device).to(tokens)
        tokens = tokens + sinusoid(place, tokens.shape[-1])
        for block in self.blocks:
            tokens = block(tokens, tokens)
        return tokens


@dataclass(frozen=True)
class HandsConfig(NetworkConfig):
    """Size and form of a network; the paper's are `configs/body_hands_paper.toml`."""

    form: Form = "ours"
    width: int = 128  # features of a token
    depth: int = 4  # transformer blocks
    heads: int = 4
    head_width: int = 256  # features of each head of the paper's form; ours divides the width
    frames_per_token: int = 6  # frames of a hand in one token (paper: 1, of both hands)
    frame: HandsFrame = "wrist"  # frame of hands (paper: the world for the body's network)
    scaling: Scaling = "deviation"  # of features (the paper's code: range)
    noise: float = 10.0
    """Factor on the noise of all levels; the paper's schedule has 1. Frames of a clip are so alike
    that the hands' motion shows through noise of up to 100 standard deviations; many levels need
    more noise, or the network ignores the condition (Hoogeboom et al. 2023)."""


@dataclass(frozen=True)
class TextHandsConfig(HandsConfig):
    """Size and form of the network that is conditioned on a sentence."""

    LIMITS: ClassVar[Limits] = {"text": (0, 65536), "gestures": (len(NAMES), 4096)}

    frame: Literal["wrist"] = "wrist"  # a sentence does not say where the body is
    text: int = 0
    """Features of a sentence from an external text encoder such as CLIP; 0: the network has a text
    encoder of its own, which is trained with it."""
    gestures: int = len(NAMES)
    """Number of gesture classes; our form learns to name each hand's gesture from the sentence."""
    words: SentenceConfig = field(default_factory=lambda: SentenceConfig(pieces=1024))


@dataclass(frozen=True)
class EncodedBody(Bundle):
    """An encoded condition (a body or a sentence), computed once for all noise levels."""

    tokens: Float[Tensor, "B K D"]  # of the condition as a whole, then of words
    seen: Bool[Tensor, "B K"]
    added: Float[Tensor, "B N D"] | None = None  # added to the tokens of hands


class HandsDenoiser(nn.Module):
    """Predicts clean hands from noisy ones, both as normalised features."""

    def __init__(self, config: HandsConfig) -> None:
        super().__init__()
        self.config = config
        width, frames, self.parts = config.width, config.frames_per_token, 1
        self.scale = Scale(HANDS)
        if config.form == "ours":
            self.parts = 2  # tokens of a step: left hand, right hand
            self.trunk = FrameTransformer(width, config.depth, config.heads)
        else:
            self.trunk = PaperTransformer(width, config.depth, config.heads, config.head_width)
        size = frames * HANDS // self.parts
        self.inputs = nn.ModuleList(nn.Linear(size, width) for _ in range(self.parts))
        self.outputs = nn.ModuleList(nn.Linear(width, size) for _ in range(self.parts))

    @property
    def sigmas(self) -> Float[Tensor, " N"]:
        """Standard deviation of the noise at each level, in units of the normalised features."""
        return self.config.noise * cosine_levels(self.scale.size.device)

    def denoised(
        self, x: Float[Tensor, "B T 270"], level: Float[Tensor, " B"], condition: EncodedBody
    ) -> Float[Tensor, "B T 270"]:
        """Prediction of the clean features in `x` = clean + sigma * noise, under a condition.

        `level` is the index of the noise level, 0 to 1,000 (see `cosine_sigmas`).
        """
        sigma = self.sigmas[level.long()]
        steps = self.steps(x / (1 + sigma.square()).sqrt()[:, None, None])
        tokens = each_by_its_own(self.inputs, steps).flatten(1, 2)
        tokens = tokens if condition.added is None else tokens + condition.added
        first = condition.tokens.shape[1]
        tokens = torch.cat([condition.tokens, tokens], dim=1)
        if isinstance(self.trunk, PaperTransformer):
            tokens = self.trunk(tokens, level)
        else:
            step = torch.arange(1, steps.shape[1] + 1, device=x.device).repeat_interleave(2)
            place = torch.cat([step.new_zeros(first), step]).to(x)
            seen = nn.functional.pad(condition.seen, (0, len(step)), value=True)
            tokens = self.trunk(tokens, 0.25 * sigma.clamp(min=1e-4).log(), place, seen)
        after = tokens[:, first:].unflatten(1, (-1, self.parts))
        return self.frames_of(each_by_its_own(self.outputs, after))[:, : x.shape[1]]

    def steps(self, x: Float[Tensor, "B T 270"]) -> Float[Tensor, "B S P N"]:
        """Features by token step and hand; for each frame of a step positions, then rotations."""
        both = x.split([HANDS // 3, 2 * HANDS // 3], dim=-1)
        hands = torch.cat([part.unflatten(-1, (self.parts, -1)) for part in both], dim=-1)
        return in_steps(hands, self.config.frames_per_token).transpose(2, 3).flatten(-2)

    def frames_of(self, steps: Float[Tensor, "B S P N"]) -> Float[Tensor, "B T 270"]:
        """Inverse of `steps`."""
        hands = steps.unflatten(-1, (self.config.frames_per_token, -1)).transpose(2, 3)
        size = HANDS // 3 // self.parts
        both = hands.flatten(1, 2).split([size, 2 * size], dim=-1)
        return torch.cat([part.flatten(-2) for part in both], dim=-1)


def each_by_its_own(
    layers: nn.ModuleList, parts: Float[Tensor, "B S P N"]
) -> Float[Tensor, "B S P M"]:
    """Apply a separate layer to each part of a step."""
    pairs = zip(layers, parts.unbind(2), strict=True)
    return torch.stack([layer(part) for layer, part in pairs], dim=2)


def of_whole(condition: Float[Tensor, "B D"]) -> EncodedBody:
    """A condition of one token."""
    return EncodedBody(condition[:, None], torch.ones_like(condition[:, :1], dtype=torch.bool))


class BodyHands(HandsDenoiser):
    """Hands that fit a body's motion."""

    def __init__(self, config: HandsConfig) -> None:
        super().__init__(config)
        self.body_scale = Scale(BODY)
        size = config.frames_per_token * BODY
        self.body = nn.Linear(size, self.parts * config.width, bias=False)

    def encode(self, body: Float[Tensor, "B T 198"]) -> EncodedBody:
        """Encode the features of a body as the condition of `denoised`."""
        body = in_steps(self.body_scale.normalise(body), self.config.frames_per_token)
        steps = self.body(body.flatten(-2))
        added = steps.unflatten(-1, (self.parts, -1)).flatten(1, 2)
        return replace(of_whole(steps.new_zeros(len(steps), self.config.width)), added=added)


class TextHands(HandsDenoiser):
    """Hands that follow a sentence, in the frames of their wrists."""

    config: TextHandsConfig

    def __init__(self, config: TextHandsConfig) -> None:
        super().__init__(config)
        self.words = None if config.text else SentenceNetwork(config.words)
        self.text = nn.Linear(config.text or config.words.width, config.width)
        ours = config.form == "ours"
        self.each = nn.Linear(config.words.width, config.width) if ours and self.words else None
        self.named = nn.Linear(config.width, 2 * config.gestures) if ours else None

    def encode(self, sentence: Int[Tensor, "B N"] | Float[Tensor, "B W"]) -> EncodedBody:
        """Encode sentences (piece indices, or vectors of an external encoder) for `denoised`."""
        if self.words is None:
            return of_whole(self.text(sentence))
        vector, states, real = self.words.read_pieces(sentence)
        whole = self.text(vector)
        if self.each is None:
            return of_whole(whole)
        tokens = torch.cat([whole[:, None], self.each(states)], dim=1)
        return EncodedBody(tokens, nn.functional.pad(real, (1, 0), value=True))

    def gestures(self, condition: EncodedBody) -> Float[Tensor, "B 2 G"]:
        """Logits of the gestures of the left and the right hand that a sentence names."""
        assert self.named is not None, "the paper's form names no gestures"
        return self.named(condition.tokens[:, 0]).unflatten(-1, (2, -1))


@dataclass(frozen=True)
class BlendConfig(NetworkConfig):
    """Size and form of the network; the paper's are `configs/blend_paper.toml`."""

    form: Form = "ours"
    width: int = 128
    depth: int = 4
    heads: int = 4
    head_width: int = 32
    frames_per_token: int = 6  # (paper: 1)
    body_weight: float = 0.8  # w_B, of the body's hands in the weighted mean
    text_weight: float = 0.2  # w_T, of the sentence's
    repeats: int = 3
    """How often the paper's form blends the finished hands, each time with the sentence's again;
    ours blends in every step of the reverse process instead."""


class Blender(nn.Module):
    """Blends two predictions of the hands on one body, normalised as in the body's network."""

    def __init__(self, config: BlendConfig) -> None:
        super().__init__()
        self.config = config
        width, size = config.width, config.frames_per_token * HANDS
        ours = config.form == "ours"
        self.enter = nn.Linear(size, width)
        self.level = mlp(width, width, width) if ours else None
        self.blocks = nn.ModuleList(
            PaperBlock(width, config.heads, config.head_width) for _ in range(config.depth)
        )
        leave = nn.Linear(width, size)
        self.leave = zeroed(leave) if ours else leave

    def forward(
        self,
        body: Float[Tensor, "B T 270"],
        text: Float[Tensor, "B T 270"],
        level: Float[Tensor, " B"],
    ) -> Float[Tensor, "B T 270"]:
        """The blended hands; `level` is the index of the noise level of both predictions."""
        of_body, of_text = self._tokens(body), self._tokens(text)
        found = of_body
        if self.level is not None:
            found = found + self.level(sinusoid(level, found.shape[-1]))[:, None]
        for index, block in enumerate(self.blocks):
            found = block(found, of_body if index % 2 else of_text)
        left = self.leave(found).unflatten(-1, (-1, HANDS)).flatten(1, 2)[:, : body.shape[1]]
        return left + self.mean(body, text) if self.config.form == "ours" else left

    def mean(
        self, body: Float[Tensor, "B T 270"], text: Float[Tensor, "B T 270"]
    ) -> Float[Tensor, "B T 270"]:
        """The weighted mean of both, w_B X_B + w_T X_T, which is the target of the paper's loss."""
        return self.config.body_weight * body + self.config.text_weight * text

    def _tokens(self, hands: Float[Tensor, "B T 270"]) -> Float[Tensor, "B S D"]:
        tokens = self.enter(in_steps(hands, self.config.frames_per_token).flatten(-2))
        place = torch.arange(tokens.shape[1], device=tokens.device).to(tokens)
        return tokens + sinusoid(place, tokens.shape[-1])
