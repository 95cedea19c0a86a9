"""Gradient descent by Adam, for fits of a few parameters."""

from collections.abc import Callable, Sequence

import torch
from torch import Tensor

from geneoh import progress


def adam(
    loss: Callable[[list[Tensor]], Tensor],
    parameters: Sequence[Tensor],
    *,
    steps: int,
    rate: float | Callable[[int], Sequence[float]],
    epsilon: float = 1e-8,
    bounded: Callable[[list[Tensor]], list[Tensor]] | None = None,
    on_step: progress.OnStep | None = None,
) -> list[Tensor]:
    """Parameters after `steps` steps of Adam (Kingma and Ba 2015, algorithm 1, default betas).

    `rate` is the learning rate, or a function from the number of finished steps to one learning
    rate per parameter; steps are shorter where the gradient is below `epsilon`. `bounded` projects
    the parameters into their limits after each step. Written out because `torch.optim` takes
    seconds to import.
    """
    parameters = list(parameters)  # the caller's list stays as it is
    first = [torch.zeros_like(p) for p in parameters]
    second = [torch.zeros_like(p) for p in parameters]
    for step in progress.steps(range(1, steps + 1), on_step):
        lengths = rate(step - 1) if callable(rate) else [rate] * len(parameters)
        with torch.enable_grad():
            leaves = [p.detach().requires_grad_(True) for p in parameters]
            gradients = torch.autograd.grad(loss(leaves), leaves)
        for i, gradient in enumerate(gradients):
            first[i] = 0.9 * first[i] + 0.1 * gradient
            second[i] = 0.999 * second[i] + 0.001 * gradient.square()
            mean, square = first[i] / (1 - 0.9**step), second[i] / (1 - 0.999**step)
            parameters[i] = leaves[i].detach() - lengths[i] * mean / (square.sqrt() + epsilon)
        if bounded is not None:
            parameters = bounded(parameters)
    return parameters
