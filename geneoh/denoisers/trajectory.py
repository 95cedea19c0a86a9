"""MotionDiff in the paper's form, on canonical keypoints (3.2; appendices A.2, C.4, C.5)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.denoisers.base import HAND_SCALE, palm_axes
from geneoh.denoisers.candidate_corrections import SMOOTHING_FRAMES, filter_kernels
from geneoh.diffusion.precondition import preconditioned
from geneoh.nn.blocks import FrameTransformer, zeroed


@dataclass(frozen=True)
class TrajectoryConfig:
    """Size of the network; one token per frame."""

    width: int = 160
    depth: int = 6
    heads: int = 4


class TrajectoryDenoiser(nn.Module):
    """A transformer over frames that maps noisy canonical keypoints to clean ones.

    It has no other input. Like `MotionDenoiser` it mixes the noisy sample with low-pass filtered
    ones, frame by frame and coordinate by coordinate.
    """

    def __init__(self, config: TrajectoryConfig) -> None:
        """Build the network; its last layers start at zero, so it starts as the skip path."""
        super().__init__()
        self.config = config
        count = 1 + len(SMOOTHING_FRAMES)
        self.embed = nn.Linear(63 * count, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, 63))
        self.mix = zeroed(nn.Linear(config.width, 63 * count))

    def forward(
        self, x: Float[Tensor, "B T 21 3"], sigma: Float[Tensor, " B"]
    ) -> Float[Tensor, "B T 21 3"]:
        """The clean canonical keypoints in `x` = clean + sigma * noise, metres."""
        axes = palm_axes(x)[:, None]  # so that the answer turns with the hand
        kernels = filter_kernels(torch.ones_like(x[:, :, 0, 0]), SMOOTHING_FRAMES)

        def network(scaled: Tensor, level: Tensor) -> Tensor:
            flat = scaled.flatten(2)
            mixed = torch.cat([flat[:, None], kernels @ flat[:, None]], dim=1).transpose(1, 2)
            tokens = self.trunk(self.embed(mixed.flatten(2)), level.flatten())
            mix = self.mix(tokens).unflatten(-1, mixed.shape[2:])
            return (self.head(tokens) + (mix * mixed).sum(2)).unflatten(-1, (21, 3))

        sigma = sigma[:, None, None, None]
        scale = torch.full_like(sigma, HAND_SCALE)
        clean = preconditioned(network, x @ axes, torch.zeros_like(x), sigma, scale)
        return clean @ axes.mT
