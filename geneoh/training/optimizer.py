"""The optimiser of the weights: Muon for the matrices of transformer blocks, AdamW for the rest.

Muon (Jordan et al. 2024) is momentum whose matrix updates are made orthogonal. Unlike
`torch.optim.Muon`, which always computes in bfloat16, its precision can be chosen: on processors
without bfloat16 units, those products take longer than the rest of a step.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.nn.blocks import Block
from geneoh.training.run_config import RunConfig

QUINTIC = (3.4445, -4.7750, 2.0315)
"""Coefficients of the odd polynomial whose iteration brings singular values close to 1."""
ORTHOGONAL_STEPS = 5
MOMENTUM = 0.95
UPDATE_RMS = 0.2  # of an update at rate 1; about AdamW's, so that both share one learning rate


class Muon(torch.optim.Optimizer):
    """Steepest descent in the spectral norm with Nesterov momentum, for matrices."""

    def __init__(
        self, matrices: Iterable[Tensor], *, lr: float, weight_decay: float, precision: torch.dtype
    ) -> None:
        """Optimise `matrices`; matrix products are computed in `precision`."""
        super().__init__(matrices, {"lr": lr, "weight_decay": weight_decay})
        self.precision = precision

    @torch.no_grad()
    def step(self, closure: Any = None) -> Any:
        """Update every matrix that has a gradient."""
        assert closure is None, "the loss is not evaluated again"
        for group in self.param_groups:
            for matrix in group["params"]:
                if matrix.grad is None:
                    continue
                state = self.state[matrix]
                if "momentum" not in state:
                    state["momentum"] = torch.zeros_like(matrix)
                momentum = state["momentum"].lerp_(matrix.grad, 1 - MOMENTUM)
                ahead = matrix.grad.lerp(momentum, MOMENTUM)
                update = orthogonal(ahead.to(self.precision)).to(matrix)
                matrix.mul_(1 - group["lr"] * group["weight_decay"])
                matrix.add_(update, alpha=-group["lr"] * UPDATE_RMS * max(matrix.shape) ** 0.5)


def orthogonal(matrix: Float[Tensor, "M N"]) -> Float[Tensor, "M N"]:
    """The matrix with singular values moved to between 0.7 and 1.2 by Newton-Schulz iterations."""
    tall = matrix.shape[0] > matrix.shape[1]
    x = matrix.mT if tall else matrix
    x = x / x.norm().clamp(min=1e-7)
    a, b, c = QUINTIC
    for _ in range(ORTHOGONAL_STEPS):
        square = x @ x.mT
        x = a * x + (b * square + c * square @ square) @ x
    return x.mT if tall else x


class Optimizer:
    """Muon for the matrices of transformer blocks, AdamW for all other parameters.

    Both use the same learning rate. Muon's matrix products are computed in `precision`.
    """

    def __init__(
        self, model: nn.Module, config: RunConfig, precision: torch.dtype = torch.float32
    ) -> None:
        """Assign each parameter to an optimiser; the learning rate is passed to each step."""
        blocks = [module for module in model.modules() if isinstance(module, Block)]
        matrices = [p for block in blocks for p in block.matrices()]
        known = {id(p) for p in matrices}
        rest = [p for p in model.parameters() if id(p) not in known]
        decay = config.weight_decay
        self.parts: dict[str, torch.optim.Optimizer] = {
            "adamw": torch.optim.AdamW(rest, lr=config.rate, betas=(0.9, 0.99), weight_decay=decay)
        }
        if matrices:
            self.parts["muon"] = Muon(
                matrices, lr=config.rate, weight_decay=decay, precision=precision
            )

    def step(self, rate: float) -> None:
        """Update all parameters."""
        for part in self.parts.values():
            for group in part.param_groups:
                group["lr"] = rate
            part.step()

    def tensors(self) -> dict[str, Tensor]:
        """The optimiser state of all parameters by name, for a checkpoint."""
        return {
            f"{name}.{index}.{key}": value
            for name, part in self.parts.items()
            for index, moments in part.state_dict()["state"].items()
            for key, value in moments.items()
        }

    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Load the state that `tensors` returned for the same model."""
        for name, part in self.parts.items():
            moments: dict[int, dict[str, Tensor]] = {}
            for full_name, tensor in tensors.items():
                owner, index, key = full_name.split(".")
                if owner == name:
                    moments.setdefault(int(index), {})[key] = tensor.clone()
            groups = part.state_dict()["param_groups"]
            part.load_state_dict({"state": moments, "param_groups": groups})
