"""The attention blocks of BOTH2Hands in the paper's form: post-norm, heads of their own width.

Source: BOTH2Hands, section 4.3 and its code; without dropout, because all random numbers of a run
come from its own generator.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.nn.blocks import sinusoid


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
