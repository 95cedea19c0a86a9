"""The hand model that ships with geneoh: made by `tools.hand_builder`, under geneoh's own licence.

The asset holds the right hand in MANO's own field names as plain arrays, so that `smplx` can load
it too; the left hand is its mirror image.
"""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files

import numpy as np
import torch
from torch import Tensor

from geneoh.choices import Side
from geneoh.hand.model import HandModel

ASSET = "embedded_right.npz"
TENSORS = ("v_template", "shapedirs", "posedirs", "J_regressor", "weights")
"""MANO's field names of the tensors of `HandModel`, in the order of its fields."""
POSE = ("pose_low", "pose_high", "pose_mean", "pose_std")
TIP_VERTS = (320, 443, 671, 554, 744)
"""Index, middle, pinky, ring, thumb: the vertices that `smplx.vertex_ids['mano']` names too."""


def read_arrays() -> dict[str, np.ndarray]:
    """The asset's arrays by name: MANO's fields, then joint limits and the natural pose."""
    with (files("geneoh.hand") / "assets" / ASSET).open("rb") as file, np.load(file) as data:
        return {name: data[name] for name in data.files}


def hand_model(
    name: str, side: Side, fields: Mapping[str, np.ndarray], pose: Mapping[str, Tensor]
) -> HandModel:
    """A `HandModel` from arrays under MANO's names, and joint limits and poses named as `POSE`."""
    return HandModel(
        name,
        side,
        *(torch.from_numpy(np.ascontiguousarray(fields[each], np.float32)) for each in TENSORS),
        faces=torch.from_numpy(fields["f"].astype(np.int64)),
        tip_verts=TIP_VERTS,
        **pose,
    )


@cache
def embedded_hand(side: Side) -> HandModel:
    """The hand of one side, made once."""
    if side == "left":
        return embedded_hand("right").mirrored()
    arrays = read_arrays()
    pose = {name: torch.from_numpy(arrays[name]) for name in POSE}
    return hand_model("embedded", "right", arrays, pose)
