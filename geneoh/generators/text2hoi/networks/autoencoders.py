"""Conditional VAEs of Text2HOI: contact maps of an object, and numbers of frames, from a sentence.

Source of contact maps: Text2HOI, section 3.1 and supplement. Ours: the points' normals, parts and
sizes are inputs too, and the decoder returns logits. Source of lengths: the code of Text2HOI; the
paper, section 4.1, has a regression from noise. Ours: never fewer than 2 frames, and sizes that fit
a text encoder of 128 features.
"""

from dataclasses import dataclass, field

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from geneoh.diffusion.samplers import normal_like
from geneoh.generators.text2hoi.networks.objects import (
    CHANNELS,
    Objects,
    PointConfig,
    PointNet,
    layer,
)
from geneoh.nn.blocks import NetworkConfig
from geneoh.synthesis.actions.action import LONGEST

SHORTEST_ACTION = 2  # frames: one is no motion, and none would leave nothing to attend to


@dataclass(frozen=True)
class ContactConfig(NetworkConfig):
    """Size of the network; the paper's is `configs/contact_paper.toml`."""

    latent: int = 16  # features of the latent (paper: 64)
    hidden: int = 128  # features of the first layer of the decoder (paper: 512)
    text: int = 128  # features of a sentence, those of the text encoder
    places_alone: bool = False  # whether normalised positions are the points' only features (paper)
    points: PointConfig = field(default_factory=PointConfig)


class ContactNetwork(nn.Module):
    """Encoder of a contact map to a latent, and decoder of a latent to a contact map."""

    def __init__(self, config: ContactConfig) -> None:
        super().__init__()
        self.config = config
        channels = 3 if config.places_alone else CHANNELS
        whole, hidden = config.points.whole, config.hidden
        self.points = PointNet(channels, config.points)
        self.touched = PointNet(channels + 1, config.points)
        self.encoder = nn.Sequential(
            layer(whole, whole // 2),
            layer(whole // 2, whole // 4),
            nn.Linear(whole // 4, 2 * config.latent),
        )
        width = config.latent + 1 + whole + config.text
        self.whole = nn.Linear(width, hidden)
        self.each = nn.Linear(config.points.near, hidden, bias=False)
        self.decoder = nn.Sequential(
            nn.LeakyReLU(0.2),
            nn.Linear(hidden, hidden // 2),
            nn.LeakyReLU(0.2),
            nn.Linear(hidden // 2, hidden // 4),
            nn.LeakyReLU(0.2),
            nn.Linear(hidden // 4, 1),
        )

    def given(self, objects: Objects) -> Float[Tensor, "B P C"]:
        """Input features of each point."""
        return objects.normalised if self.config.places_alone else objects.channels

    def encode(
        self, objects: Objects, contact: Float[Tensor, "B P"]
    ) -> tuple[Float[Tensor, "B Z"], Float[Tensor, "B Z"]]:
        """Mean and log variance of the latent of a contact map."""
        channels = torch.cat([self.given(objects), contact[..., None]], dim=-1)
        _, features = self.touched(channels)
        mean, log_variance = self.encoder(features.amax(1)).chunk(2, dim=-1)
        return mean, log_variance.clamp(-10, 10)

    def decode(
        self, latent: Float[Tensor, "B Z"], objects: Objects, text: Float[Tensor, "B W"]
    ) -> Float[Tensor, "B P"]:
        """Logits of the contact of each point."""
        near, features = self.points(self.given(objects))
        # decimetres, so that the number is of order one
        condition = torch.cat([latent, 10 * objects.scale, features.amax(1), text], dim=-1)
        # one linear layer over local and global features, without repeating the global ones
        return self.decoder(self.each(near) + self.whole(condition)[:, None])[..., 0]

    def sample(
        self, objects: Objects, text: Float[Tensor, "B W"], *, generator: torch.Generator
    ) -> Float[Tensor, "B P"]:
        """Probability of the contact of each point, for a random latent."""
        latent = text.new_zeros(len(text), self.config.latent)
        return self.decode(normal_like(latent, generator=generator), objects, text).sigmoid()


def contact_loss(
    network: ContactNetwork,
    objects: Objects,
    contact: Float[Tensor, "B P"],
    text: Float[Tensor, "B W"],
    *,
    divergence: float,
    noise: Float[Tensor, "B Z"],
) -> Float[Tensor, ""]:
    """Cross-entropy and dice loss of a reconstructed map, and KL divergence of the latent.

    Ours: means over points and clips, where the paper's code sums cross-entropy and KL divergence
    over the batch; a dice loss for each clip. `divergence` is the weight of the KL divergence.
    """
    mean, log_variance = network.encode(objects, contact)
    latent = mean + (0.5 * log_variance).exp() * noise
    logits = network.decode(latent, objects, text)
    entropy = nn.functional.binary_cross_entropy_with_logits(logits, contact)
    share = logits.sigmoid()
    overlap = (share * contact).sum(1) / (share.sum(1) + contact.sum(1) + 1.0)
    apart = 0.5 * (mean.square() + log_variance.exp() - 1 - log_variance).sum(-1)
    return entropy + (1 - 2 * overlap).mean() + divergence * apart.mean()


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
