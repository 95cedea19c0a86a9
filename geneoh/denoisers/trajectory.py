"""MotionDiff as the paper has it: canonical keypoints, one hand (3.2; appendices A.2, C.4, C.5)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.denoisers.base import FEATURES, Observation
from geneoh.diffusion.precondition import denoised
from geneoh.nn.blocks import FrameTransformer, zeroed


@dataclass(frozen=True)
class TrajectoryConfig:
    """Size of the network; one token per frame."""

    width: int = 160
    depth: int = 6
    heads: int = 4


class TrajectoryDenoiser(nn.Module):
    """A transformer over frames that maps noisy canonical keypoints to clean ones."""

    def __init__(self, config: TrajectoryConfig) -> None:
        """Build the network; its last layers start at zero, so it starts as the skip path."""
        super().__init__()
        self.config = config
        self.embed = nn.Linear(63 + FEATURES, config.width)
        self.trunk = FrameTransformer(config.width, config.depth, config.heads)
        self.head = zeroed(nn.Linear(config.width, 63))
        self.gate = zeroed(nn.Linear(config.width, 63))

    def forward(
        self,
        x: Float[Tensor, "B T 21 3"],
        sigma: Float[Tensor, " B"],
        observation: Observation,
    ) -> Float[Tensor, "B T 21 3"]:
        """The clean canonical keypoints seen in `x` = clean + sigma * noise, metres."""
        axes = observation.palm()
        observation = observation.turned(axes)
        features = observation.features()

        def network(scaled: Tensor, level: Tensor) -> Tensor:
            tokens = self.embed(torch.cat([scaled.flatten(2), features], dim=-1))
            tokens = self.trunk(tokens, level.flatten())
            # the gate scales the sample itself: how far this input's observation is to be trusted
            out = self.head(tokens) + self.gate(tokens) * scaled.flatten(2)
            return out.unflatten(-1, (21, 3))

        sigma, scale = sigma[:, None, None, None], observation.scale[:, None, None, None]
        clean = denoised(network, x @ axes[:, None], observation.anchor, sigma, scale)
        return clean @ axes[:, None].transpose(-1, -2)
