"""MotionDiff in the paper's form, on canonical keypoints (3.2; appendices A.2, C.4, C.5)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.denoisers.base import VERSIONS, window_size, with_low_passed
from geneoh.diffusion.precondition import preconditioned
from geneoh.nn.blocks import FrameTransformer, NetworkConfig, zeroed
from geneoh.sequence.keypoints import palm_axes


@dataclass(frozen=True)
class TrajectoryConfig(NetworkConfig):
    """Size of the network; one token per frame."""

    width: int = 160
    depth: int = 6
    heads: int = 4


class TrajectoryDenoiser(nn.Module):
    """A transformer over frames that maps noisy canonical keypoints, in units of their window
    (`WindowScale`), to clean ones. Ours: the window's standard deviation is an input, without which
    bone lengths are unknown; and like `MotionDenoiser` the network mixes the noisy sample with its
    low-pass filtered versions, by frame and coordinate."""

    def __init__(self, config: TrajectoryConfig) -> None:
        """Build the network; its last layers start at zero, which leaves the skip path alone."""
        super().__init__()
        self.config = config
        self.embed = nn.Linear(63 * VERSIONS + 1, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, 63))
        self.mix = zeroed(nn.Linear(config.width, 63 * VERSIONS))

    def forward(
        self,
        x: Float[Tensor, "B T 21 3"],
        sigma: Float[Tensor, " B"],
        deviation: Float[Tensor, " B"],
    ) -> Float[Tensor, "B T 21 3"]:
        """The clean keypoints, predicted from `x` = clean + sigma * noise. Both have mean zero and
        are in units of their window's standard deviation, which is `deviation` metres."""
        x = centred(x)
        axes = palm_axes(x)[:, None]  # makes the output rotation equivariant
        size = window_size(deviation, x.shape[1])

        def network(scaled: Tensor, level: Tensor) -> Tensor:
            mixed = with_low_passed(scaled.flatten(2))
            tokens = self.embed(torch.cat([mixed.flatten(2), size], dim=-1))
            tokens = self.trunk(tokens, level.flatten())
            mix = self.mix(tokens).unflatten(-1, mixed.shape[2:])
            return (self.head(tokens) + (mix * mixed).sum(2)).unflatten(-1, (21, 3))

        sigma, one = sigma[:, None, None, None], x.new_ones(len(x), 1, 1, 1)
        clean = preconditioned(network, x @ axes, torch.zeros_like(x), sigma, one)
        return centred(clean @ axes.mT)


def centred(windows: Float[Tensor, "B T 21 3"]) -> Float[Tensor, "B T 21 3"]:
    """Windows with mean zero over frames and keypoints."""
    return windows - windows.mean((1, 2), keepdim=True)
