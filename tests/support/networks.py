"""Small networks with random weights, and observations to show them."""

import pytest
import torch
from draws import normal, seeded
from torch import nn

from geneoh.baselines.networks import Observation


def observation(batch: int = 2, frames: int = 4, seed: int = 0) -> Observation:
    """Keypoints within some 8 cm of the contact points."""
    return Observation(
        joints=0.08 * normal(batch, frames, 21, 3, seed=seed),
        trust=torch.ones(batch, frames, 21),
    )


def awake(network: nn.Module, seed: int = 0) -> nn.Module:
    """The network with random weights everywhere: fresh ones end in layers of zeros."""
    generator = seeded(seed)
    with torch.no_grad():
        for parameter in network.parameters():
            size = 0.7 / max(parameter.shape[-1], 1) ** 0.5
            parameter.copy_(size * torch.randn(parameter.shape, generator=generator))
    return network.eval().requires_grad_(False)


@pytest.fixture(scope="session")
def make_observation():
    return observation


@pytest.fixture(scope="session")
def wake():
    return awake


@pytest.fixture(scope="session")
def draw():
    return normal
