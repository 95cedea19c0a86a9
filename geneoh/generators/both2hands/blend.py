"""The network that blends the hands of the body with those of the sentence (paper, section 4.3).

In the first block the body's hands attend to the sentence's, in the second the result attends to
the body's hands, and so on; every block is used, where the paper's code leaves the last one out.
Ours adds the output to the weighted mean of both and blends in every step of the reverse process,
in which both networks denoise the same noisy hands, so that their predictions fit each other. The
paper blends hands of two separate reverse processes (`form="paper"`).
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.generators.both2hands.denoiser import Form
from geneoh.generators.both2hands.features import HANDS
from geneoh.generators.both2hands.paper_layers import PaperBlock
from geneoh.nn.blocks import NetworkConfig, in_steps, mlp, sinusoid, zeroed


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
