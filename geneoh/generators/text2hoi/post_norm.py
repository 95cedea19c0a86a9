"""The transformer of the paper: post-norm layers over tokens with sinusoidal positions."""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn


class PostNormTransformer(nn.Module):
    """A stack of torch's encoder layers; the noise level is added to the first token.

    Source: Text2HOI, supplement; Vaswani et al. 2017.
    """

    def __init__(self, width: int, depth: int, heads: int) -> None:
        """Build `depth` layers of `width` features, with feed-forward layers twice as wide."""
        super().__init__()
        self.level = nn.Sequential(nn.Linear(width, width), nn.SiLU(), nn.Linear(width, width))
        self.layers = nn.ModuleList(
            nn.TransformerEncoderLayer(
                width, heads, 2 * width, dropout=0.0, activation="gelu", batch_first=True
            )
            for _ in range(depth)
        )

    def forward(
        self,
        tokens: Float[Tensor, "B N D"],
        level: Float[Tensor, " B"],
        position: Float[Tensor, " N"],
        seen: Bool[Tensor, "B N"],
    ) -> Float[Tensor, "B N D"]:
        """Tokens after all layers; attention is to those that are seen."""
        width = tokens.shape[-1]
        first = tokens[:, :1] + self.level(sinusoid(level, width))[:, None]
        tokens = torch.cat([first, tokens[:, 1:]], dim=1) + sinusoid(position, width)
        for layer in self.layers:
            tokens = layer(tokens, src_key_padding_mask=~seen)
        return tokens


def sinusoid(position: Float[Tensor, " N"], width: int) -> Float[Tensor, "N D"]:
    """Sines and cosines in turn, of wavelengths from 2 pi to 20,000 pi (Vaswani et al. 2017)."""
    half = torch.arange(0, width, 2, device=position.device)
    angle = position[:, None] * torch.exp(-math.log(10000.0) * half / width)
    return torch.stack([angle.sin(), angle.cos()], dim=-1).flatten(-2)
