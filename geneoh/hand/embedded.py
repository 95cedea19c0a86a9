"""The hand that ships with geneoh, our own, made by `tools.hand_builder`; free of other licences.

The asset holds the right hand in MANO's own field names as plain arrays, so that `smplx` can load
it too; the left hand is its mirror image.
"""

from functools import cache
from importlib.resources import files

import numpy as np
import torch

from geneoh.hand.model import HandModel

ASSET = "embedded_right.npz"
TIP_VERTS = (320, 443, 671, 554, 744)
"""Index, middle, pinky, ring, thumb: the vertices that `smplx.vertex_ids['mano']` names too."""


def read_arrays() -> dict[str, np.ndarray]:
    """The asset's arrays by name: MANO's fields, then joint limits and the natural pose."""
    with (files("geneoh.hand") / "assets" / ASSET).open("rb") as file, np.load(file) as data:
        return {name: data[name] for name in data.files}


@cache
def embedded_right() -> HandModel:
    """The right hand, read once."""
    arrays = read_arrays()
    tensors = {name: torch.from_numpy(array) for name, array in arrays.items()}
    return HandModel(
        name="embedded",
        side="right",
        template=tensors["v_template"],
        shape_dirs=tensors["shapedirs"],
        pose_dirs=tensors["posedirs"],
        joint_regressor=tensors["J_regressor"],
        skin_weights=tensors["weights"],
        faces=tensors["f"].long(),
        tip_verts=TIP_VERTS,
        pose_low=tensors["pose_low"],
        pose_high=tensors["pose_high"],
        pose_mean=tensors["pose_mean"],
        pose_std=tensors["pose_std"],
    )
