"""Building blocks of networks: the limits of their sizes, a pre-norm transformer, small MLPs."""

import itertools
import math
from contextlib import nullcontext
from dataclasses import dataclass
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Shaped
from torch import Tensor, nn

from geneoh.config import Limited
from geneoh.errors import ConfigError


@dataclass(frozen=True)
class NetworkConfig(Limited):
    """Size and form of a network; whole numbers are 1 to 4,096 unless a network says otherwise."""

    LARGEST: ClassVar[int] = 4096


def mlp(*widths: int) -> nn.Sequential:
    """Linear layers of the given widths with SiLU between them."""
    layers: list[nn.Module] = []
    for before, after in itertools.pairwise(widths):
        layers += [nn.Linear(before, after), nn.SiLU()]
    return nn.Sequential(*layers[:-1])


def zeroed(layer: nn.Module) -> nn.Module:
    """The linear layer with weights and bias set to zero, so that training starts without it."""
    for parameter in layer.parameters():
        nn.init.zeros_(parameter)
    return layer


def drawn(scale: float, *size: int) -> Tensor:
    """Normal initial values of a learned tensor. None are drawn on the device "meta", where weights
    are loaded later: torch would draw them all the same, or import a compiler for two seconds."""
    values = torch.empty(size)
    return values if values.is_meta else values.normal_(0.0, scale)


def in_steps(values: Shaped[Tensor, "B T *N"], frames: int) -> Shaped[Tensor, "B S F *N"]:
    """Per-frame values grouped into S tokens of F = `frames` frames; the last is zero-padded."""
    short = values.new_zeros(len(values), -values.shape[1] % frames, *values.shape[2:])
    return torch.cat([values, short], dim=1).unflatten(1, (-1, frames))


def check_heads(width: int, heads: int, unit: int = 2) -> None:
    """Refuse a width that attention heads cannot share in units of features (`ConfigError`)."""
    if width < 1 or heads < 1 or width % (unit * heads):
        raise ConfigError(
            f"width must be a multiple of {unit} x the number of heads, got {width} for {heads} "
            "heads; change one"
        )


def rotary(
    x: Float[Tensor, "B H T D"], position: Float[Tensor, " T"] | None = None
) -> Float[Tensor, "B H T D"]:
    """Rotary position embedding: attention depends on distances in frames, not on positions.
    Without `position`, tokens stand at 0, 1, 2, ..."""
    half = x.shape[-1] // 2
    frequency = torch.exp(-math.log(1000.0) * torch.arange(half, device=x.device) / half)
    if position is None:
        position = torch.arange(x.shape[-2], device=x.device)
    angle = position[:, None] * frequency
    cos, sin = angle.cos().to(x.dtype), angle.sin().to(x.dtype)
    a, b = x[..., :half], x[..., half:]
    return torch.cat([a * cos - b * sin, a * sin + b * cos], dim=-1)


class Block(nn.Module):
    """Pre-norm attention over frames and a feed-forward layer, both scaled by the noise level."""

    def __init__(self, width: int, heads: int) -> None:
        check_heads(width, heads)
        super().__init__()
        self.heads = heads
        self.norm_attention = nn.LayerNorm(width)
        self.qkv = nn.Linear(width, 3 * width)
        self.project = nn.Linear(width, width)
        self.norm_forward = nn.LayerNorm(width)
        self.forward_layers = mlp(width, 3 * width, width)
        self.gain = zeroed(nn.Linear(width, 2 * width))

    def matrices(self) -> list[Tensor]:
        """The weight matrices between features, for optimizers that treat matrices differently."""
        layers = (self.qkv, self.project, *self.forward_layers)
        return [layer.weight for layer in layers if isinstance(layer, nn.Linear)]

    def forward(
        self,
        tokens: Float[Tensor, "B T D"],
        level: Float[Tensor, "B D"],
        position: Float[Tensor, " T"] | None = None,
        seen: Bool[Tensor, "B T"] | None = None,
    ) -> Float[Tensor, "B T D"]:
        """One residual update of the tokens; `level` embeds the noise level. `seen` masks the keys:
        only tokens with True are attended to, at least one per item; None attends to all."""
        gain_attention, gain_forward = (1 + self.gain(level))[:, None].chunk(2, dim=-1)
        q, k, v = self.qkv(self.norm_attention(tokens) * gain_attention).chunk(3, dim=-1)
        q, k, v = (x.unflatten(-1, (self.heads, -1)).transpose(1, 2) for x in (q, k, v))
        # written out: for windows this short it is faster than torch's fused attention
        score = rotary(q, position) @ rotary(k, position).mT * q.shape[-1] ** -0.5
        if seen is not None:
            score = score.masked_fill(~seen[:, None, None], -torch.inf)
        attended = score.softmax(-1).to(v.dtype) @ v
        tokens = tokens + self.project(attended.transpose(1, 2).flatten(-2))
        return tokens + self.forward_layers(self.norm_forward(tokens) * gain_forward)


class FrameTransformer(nn.Module):
    """A stack of blocks over frames with the noise level embedded once."""

    def __init__(self, width: int, depth: int, heads: int) -> None:
        super().__init__()
        self.precision = torch.float32
        """Type of the matrix products, see `geneoh.nn.precision`."""
        self.level = mlp(width, width, width)
        self.blocks = nn.ModuleList(Block(width, heads) for _ in range(depth))
        self.norm = nn.LayerNorm(width)

    def forward(
        self,
        tokens: Float[Tensor, "B T D"],
        level: Float[Tensor, " B"],
        position: Float[Tensor, " T"] | None = None,
        seen: Bool[Tensor, "B T"] | None = None,
    ) -> Float[Tensor, "B T D"]:
        """Tokens after all blocks; `level` is the noise level as `Scaling.level` states it,
        `position` and `seen` are those of `Block`."""
        embedded = self.level(fourier(level, tokens.shape[-1]))
        in_float32 = self.precision == torch.float32
        device = tokens.device.type
        with nullcontext() if in_float32 else torch.autocast(device, dtype=self.precision):
            for block in self.blocks:
                tokens = block(tokens + embedded[:, None], embedded, position, seen)
        return self.norm(tokens)


def fourier(x: Float[Tensor, " B"], width: int) -> Float[Tensor, "B D"]:
    """Sines and cosines of `x` at `width` / 2 frequencies from 1 to 30 radians per unit."""
    frequency = torch.exp(torch.linspace(0.0, math.log(30.0), width // 2, device=x.device))
    angle = x[:, None] * frequency
    return torch.cat([angle.sin(), angle.cos()], dim=-1)


def sinusoid(position: Float[Tensor, " N"], width: int) -> Float[Tensor, "N D"]:
    """Sines and cosines in turn, of wavelengths from 2 pi to 20,000 pi (Vaswani et al. 2017)."""
    half = torch.arange(0, width, 2, device=position.device)
    angle = position[:, None] * torch.exp(-math.log(10000.0) * half / width)
    return torch.stack([angle.sin(), angle.cos()], dim=-1).flatten(-2)[..., :width]
