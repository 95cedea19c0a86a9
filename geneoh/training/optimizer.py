"""The optimiser of the weights."""

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from geneoh.nn.blocks import Block
from geneoh.training.muon import Muon
from geneoh.training.run_config import RunConfig


class Optimizer:
    """Muon for the matrices of transformer blocks, AdamW for all other parameters, at one rate.

    Muon's matrix products are of type `precision`.
    """

    def __init__(
        self, model: nn.Module, config: RunConfig, precision: torch.dtype = torch.float32
    ) -> None:
        """Assign each parameter to an optimiser; the rate is given with each step."""
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

    def zero_grad(self) -> None:
        """Clear all gradients."""
        for part in self.parts.values():
            part.zero_grad(set_to_none=True)

    def step(self, rate: float) -> None:
        """Move all parameters along their gradients."""
        for part in self.parts.values():
            for group in part.param_groups:
                group["lr"] = rate
            part.step()

    def tensors(self) -> dict[str, Tensor]:
        """The moments of all parameters, by name."""
        return {
            f"{name}.{index}.{key}": value
            for name, part in self.parts.items()
            for index, moments in part.state_dict()["state"].items()
            for key, value in moments.items()
        }

    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Take over what `tensors` of the same model's optimizer returned."""
        for name, part in self.parts.items():
            moments: dict[int, dict[str, Tensor]] = {}
            for full_name, tensor in tensors.items():
                owner, index, key = full_name.split(".")
                if owner == name:
                    moments.setdefault(int(index), {})[key] = tensor
            groups = part.state_dict()["param_groups"]
            part.load_state_dict({"state": moments, "param_groups": groups})
