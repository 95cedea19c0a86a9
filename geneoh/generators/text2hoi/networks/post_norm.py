"""The transformer of Text2HOI's paper: post-norm layers over tokens with sinusoidal positions."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from geneoh.nn.blocks import check_heads, sinusoid


class PostNormTransformer(nn.Module):
    """A stack of torch's encoder layers; the noise level is added to the first token.

    Source: Text2HOI, supplement; Vaswani et al. 2017.
    """

    def __init__(self, width: int, depth: int, heads: int, *, levels: bool = True) -> None:
        """Build `depth` layers of `width` features; without `levels` no noise level is embedded."""
        check_heads(width, heads, unit=1)
        super().__init__()
        steps = (nn.Linear(width, width), nn.SiLU(), nn.Linear(width, width))
        self.level = nn.Sequential(*steps) if levels else None
        self.layers = nn.ModuleList(
            nn.TransformerEncoderLayer(
                width, heads, 2 * width, dropout=0.0, activation="gelu", batch_first=True
            )
            for _ in range(depth)
        )

    def forward(
        self,
        tokens: Float[Tensor, "B N D"],
        level: Float[Tensor, " B"] | None,
        position: Float[Tensor, " N"],
        seen: Bool[Tensor, "B N"],
    ) -> Float[Tensor, "B N D"]:
        """Tokens after all layers; `seen` masks the tokens that are attended to."""
        width = tokens.shape[-1]
        if self.level is not None and level is not None:
            first = tokens[:, :1] + self.level(sinusoid(level, width))[:, None]
            tokens = torch.cat([first, tokens[:, 1:]], dim=1)
        tokens = tokens + sinusoid(position, width)
        for layer in self.layers:
            tokens = layer(tokens, src_key_padding_mask=~seen)
        return tokens
