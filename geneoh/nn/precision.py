"""Data type of the matrix products in transformer blocks; sums, norms and results are float32."""

import torch
from torch import nn

from geneoh.nn.blocks import FrameTransformer


def quick_precision(device: torch.device) -> torch.dtype:
    """Fastest type of the matrix products: bfloat16 where the hardware has units for it."""
    if device.type == "cuda":
        native = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        # older versions of torch do not have this function
        able = getattr(torch.cpu, "get_capabilities", dict)()
        units = any(able.get(name) for name in ("amx_bf16", "avx512_bf16"))
        native = device.type == "cpu" and units
    return torch.bfloat16 if native else torch.float32


def cleaning_precision(device: torch.device) -> torch.dtype:
    """Type for cleaning tracks: float32 on a CPU, so that all CPUs give bit-identical results."""
    return torch.float32 if device.type == "cpu" else quick_precision(device)


def multiply_in(model: nn.Module, precision: torch.dtype) -> None:
    """Set the type of matrix products in all transformers of a model; sums stay in float32."""
    for module in model.modules():
        if isinstance(module, FrameTransformer):
            module.precision = precision
