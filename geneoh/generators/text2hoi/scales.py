"""Scales and principal axes of the numbers of actions, that networks begin with (ours)."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.generators.text2hoi.interaction import InteractionNetwork
from geneoh.generators.text2hoi.tokens import HAND, OBJECT, Tokens, tokens_of
from geneoh.nn.blocks import in_steps
from geneoh.streamed import Streamed
from geneoh.synthesis.actions import Actions

LEAST_DEVIATION = 0.02
"""Deviations of numbers below this one (m, dm, entries of rotations) count as this large."""
MOST = 512  # clips that are looked at


@torch.no_grad()
def set_statistics(network: InteractionNetwork, actions: Streamed[Actions]) -> None:
    """Set what a network that normalises knows of its numbers, from clips and mirror images.

    That is their means and deviations and, in our form, the axes along which they vary most.
    """
    some = actions.take(slice(None, None, -(-len(actions) // MOST)))
    both = [tokens_of(each, network.config.frame) for each in (some, some.mirrored())]
    total, square, count = (torch.zeros(len(network.mean), dtype=torch.float64) for _ in range(3))
    for tokens in both:
        numbers = (tokens.flat * tokens.defined).double()
        total += numbers.sum((0, 1))
        square += numbers.square().sum((0, 1))
        count += tokens.defined.sum((0, 1))
    mean = total / count.clamp(min=1)
    std = (square / count.clamp(min=1) - mean.square()).clamp(min=0).sqrt()
    network.mean.copy_(mean)
    network.std.copy_(std.clamp(min=LEAST_DEVIATION))
    if network.config.form == "ours":
        set_axes(network, both)


@torch.no_grad()
def set_axes(network: InteractionNetwork, clips: list[Tokens]) -> None:
    """Set the axes along which whole tokens vary most, and their covariance over tokens."""
    frames = network.config.frames_per_token
    steps = [in_steps(network.normalise(t.flat) * t.defined, frames) for t in clips]
    whole = [in_steps(t.shown.transpose(1, 2), frames).all(2) for t in clips]
    agents = torch.cat(steps).split([HAND, HAND, OBJECT], dim=-1)
    for index, codec in enumerate(network.codecs):
        numbers, there = agents[index].flatten(2), torch.cat(whole)[..., index]
        axes = principal_axes(numbers[there])[: len(codec.axes)]
        codec.axes.zero_()
        codec.axes[: len(axes)] = axes
        places = numbers @ codec.axes.T
        codec.covariance.zero_()
        for lag in range(min(len(codec.covariance), there.shape[1])):
            both = there[:, lag:] & there[:, : there.shape[1] - lag]
            product = (places[:, lag:] * places[:, : places.shape[1] - lag])[both]
            codec.covariance[lag] = product.sum(0) / max(1, len(product))


def principal_axes(values: Float[Tensor, "N D"]) -> Float[Tensor, "D D"]:
    """Unit axes along which values vary around zero, as rows, by falling variance."""
    _, axes = torch.linalg.eigh(values.double().T @ values.double())
    return axes.T.flip(0).to(values)
