"""Hands in natural poses, in single and in double precision."""

from dataclasses import fields, replace

import pytest
import torch
from torch import Tensor

from geneoh.fitting.terms import HandState
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.model import ShapedHand


@pytest.fixture(scope="session")
def hand():
    return load_hand("right")


@pytest.fixture(scope="session")
def shaped(hand):
    """Some person's hand."""
    betas = torch.randn(10, generator=torch.Generator().manual_seed(7))
    return hand.shaped(0.7 * betas)


def in_double(value):
    """The same hand or state in float64, for gradients that are exact."""
    changed = {}
    for field in fields(value):
        old = getattr(value, field.name)
        if isinstance(old, ShapedHand) or field.name == "model":
            changed[field.name] = in_double(old)
        elif isinstance(old, Tensor) and old.is_floating_point():
            changed[field.name] = old.double()
    return replace(value, **changed)


@pytest.fixture(scope="session")
def double():
    return in_double


@pytest.fixture(scope="session")
def make_state(hand):
    """Hands of some samples that move smoothly through natural poses."""

    def make(samples: int = 1, frames: int = 3, seed: int = 0, spread: float = 0.4) -> HandState:
        generator = torch.Generator().manual_seed(seed)

        def path(*shape: int, step: float) -> Tensor:
            start = torch.randn(samples, 1, *shape, generator=generator)
            way = torch.randn(samples, 1, *shape, generator=generator)
            return start + step * torch.arange(frames).reshape(-1, *[1] * len(shape)) * way

        pose = hand.pose_mean + spread * path(16, 3, step=0.05) * hand.pose_std
        pose = torch.minimum(torch.maximum(pose, hand.pose_low), hand.pose_high)
        pose[..., 0, :] = path(3, step=0.03)
        return HandState(axis_angle_to_matrix(pose), 0.1 * path(3, step=0.05))

    return make
