"""A cleaned sequence on disk, with what the cleaner learned beside the track itself."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import get_args

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import Side
from geneoh.files.npz import read_archive
from geneoh.pipeline.denoise import Denoised, Options
from geneoh.readers.npz_files import save_sequence


def save_result(result: Denoised, options: Options, path: Path) -> None:
    """Write the clean sequence as a geneoh-sequence npz, whole or not at all.

    Beside the sequence's own fields: per side `filled` (T,), frames the input did not hold, and,
    where several samples were drawn, `samples` (S, T, 21, 3) in metres, their keypoints at 30
    frames a second before selection and fit; `options`, the settings as JSON.
    """
    extra: dict[str, np.ndarray] = {"options": np.array(json.dumps(asdict(options), default=str))}
    for side, hand in result.hands.items():
        extra[f"{side}_filled"] = hand.filled.numpy()
        if len(hand.samples) > 1:
            extra[f"{side}_samples"] = hand.samples.cpu().numpy()
    save_sequence(result.sequence, path, extra=extra)


def load_samples(path: Path) -> dict[Side, Float[Tensor, "S T 21 3"]]:
    """Keypoints of the samples that a result keeps, per side, at 30 frames a second; often none."""
    arrays = read_archive(path)
    found: dict[Side, Tensor] = {}
    for side in get_args(Side):
        if (drawn := arrays.get(f"{side}_samples")) is not None and drawn.shape[2:] == (21, 3):
            found[side] = torch.from_numpy(drawn).float()
    return found
