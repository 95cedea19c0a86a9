"""The number of frames of an interaction from its sentence: a conditional VAE.

Source: the code of Text2HOI; the paper, section 4.1, has a regression from noise. Ours: never fewer
than 2 frames, and sizes that fit a text encoder of 128 features.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from geneoh.diffusion.samplers import normal_like
from geneoh.nn.blocks import NetworkConfig
from geneoh.synthesis.actions.action import LONGEST

SHORTEST_ACTION = 2  # frames: one is no motion, and none would leave nothing to attend to


@dataclass(frozen=True)
class LengthConfig(NetworkConfig):
    """Size of the network; the paper's is `configs/length_paper.toml`."""

    latent: int = 16  # features of the latent (paper: 64)
    hidden: int = 128  # features of the hidden layers (paper: 512)
    text: int = 128  # features of a sentence, those of the text encoder


class LengthNetwork(nn.Module):
    """Encoder of a length to a latent, and decoder of a latent to a length, given the text."""

    def __init__(self, config: LengthConfig) -> None:
        super().__init__()
        self.config = config
        self.encoder = nn.Sequential(
            nn.Linear(1 + config.text, config.hidden),
            nn.ReLU(),
            nn.Linear(config.hidden, 2 * config.latent),
        )
        self.decoder = nn.Sequential(
            nn.Linear(config.latent + config.text, config.hidden),
            nn.LeakyReLU(0.2),
            nn.Linear(config.hidden, 1),
            nn.Sigmoid(),
        )

    def encode(
        self, share: Float[Tensor, " B"], text: Float[Tensor, "B W"]
    ) -> tuple[Float[Tensor, "B Z"], Float[Tensor, "B Z"]]:
        """Mean and log variance of the latent; `share` is the length over `LONGEST`, 0 to 1."""
        both = torch.cat([share[:, None], text], dim=-1)
        mean, log_variance = self.encoder(both).chunk(2, dim=-1)
        return mean, log_variance.clamp(-10, 10)

    def decode(
        self, latent: Float[Tensor, "B Z"], text: Float[Tensor, "B W"]
    ) -> Float[Tensor, " B"]:
        """The length as a share of `LONGEST`, 0 to 1."""
        return self.decoder(torch.cat([latent, text], dim=-1))[:, 0]

    def sample(
        self, text: Float[Tensor, "B W"], *, generator: torch.Generator
    ) -> Int[Tensor, " B"]:
        """A random number of frames for each sentence, `SHORTEST_ACTION` to `LONGEST`."""
        latent = text.new_zeros(len(text), self.config.latent)
        share = self.decode(normal_like(latent, generator=generator), text)
        return (LONGEST * share).floor().long().clamp(SHORTEST_ACTION, LONGEST)


def length_loss(
    network: LengthNetwork,
    length: Int[Tensor, " B"],
    text: Float[Tensor, "B W"],
    *,
    divergence: float,
    noise: Float[Tensor, "B Z"],
) -> Float[Tensor, ""]:
    """Squared error of the length as a share of `LONGEST`, and KL divergence of the latent.

    Ours: means over the batch, and a weight of the KL divergence at which sampled lengths still
    vary (the paper's code: sums, with weight 1).
    """
    share = length / LONGEST
    mean, log_variance = network.encode(share, text)
    found = network.decode(mean + (0.5 * log_variance).exp() * noise, text)
    apart = 0.5 * (mean.square() + log_variance.exp() - 1 - log_variance).sum(-1)
    return (found - share).square().mean() + divergence * apart.mean()
