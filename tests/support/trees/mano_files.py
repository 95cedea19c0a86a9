"""A stand-in for MANO's files: random arrays in MANO's layout, built on the embedded hand."""

import pickle
import sys
import types
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import scipy.sparse
import torch

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import PARENTS, TIP_PARENTS, forward_kinematics

SIDES = ("right", "left")


FLIP = np.array([-1.0, 1.0, 1.0])

WRIST_DIRS = 0.002 * np.linspace(-1.0, 1.0, 30).reshape(3, 10)
"""How each shape direction moves the whole hand and so its wrist, metres: MANO's wrist depends on
the betas, and that of the embedded hand does not."""


class Ch:
    """Stands in for a chumpy array while a file is written."""

    def __init__(self, x):
        self.x = x


def right_shape_dirs() -> np.ndarray:
    """(V, 3, 10) shape directions of the right hand."""
    return load_hand("right").shape_dirs.double().numpy() + WRIST_DIRS


def mano_arrays(side: str) -> dict[str, np.ndarray]:
    """What a file of MANO holds, with its quirks."""
    hand, draw, flip = load_hand(side), np.random.default_rng(0), np.ones(3)
    mean = 0.15 * draw.standard_normal((15, 3))
    return {
        "v_template": hand.template.double().numpy(),
        "shapedirs": right_shape_dirs(),  # in both files
        "posedirs": hand.pose_dirs.double().numpy(),
        "J_regressor": hand.joint_regressor.double().numpy(),
        "weights": hand.skin_weights.double().numpy(),
        "kintree_table": np.array([[2**32 - 1, *PARENTS[1:]], range(16)], dtype=np.uint32),
        "hands_mean": (mean * (-FLIP if side == "left" else flip)).reshape(45),
        "hands_components": 0.1 * draw.standard_normal((45, 45)) + 2 * np.eye(45),
        "f": hand.faces.numpy().astype(np.uint32),
    }


class Hand:
    """One side of MANO in plain numpy, float64."""

    def __init__(self, side: str) -> None:
        arrays = mano_arrays(side)
        self.side, self.template = side, arrays["v_template"]
        self.shape_dirs, self.joint_regressor = arrays["shapedirs"], arrays["J_regressor"]
        self.mean, self.components = arrays["hands_mean"], arrays["hands_components"]

    def rest(self, betas: np.ndarray, left: str) -> np.ndarray:
        """(V, 3) vertices of the rest pose."""
        flip = FLIP if self.side == "left" and left == "mirrored" else np.ones(3)
        return self.template + (self.shape_dirs * flip[:, None]) @ betas

    def wrist_offset(self, betas: np.ndarray, left: str = "as shipped") -> np.ndarray:
        return (self.joint_regressor @ self.rest(betas, left))[0]

    def keypoints(self, pose, wrist, betas, left: str = "as shipped") -> np.ndarray:
        """(T, 21, 3) in OpenPose's order."""
        verts = self.rest(betas, left)
        joints, tips = self.joint_regressor @ verts, verts[list(load_hand("right").tip_verts)]
        bones = joints[1:] - joints[list(PARENTS[1:])]
        offsets = np.concatenate([bones, tips - joints[list(TIP_PARENTS)]])
        turned = axis_angle_to_matrix(torch.from_numpy(pose))
        offsets = torch.from_numpy(offsets).expand(len(pose), 20, 3)
        return forward_kinematics(turned, torch.from_numpy(wrist), offsets)[0].numpy()


def write_mano(folder: Path) -> Path:
    """MANO_RIGHT.pkl and MANO_LEFT.pkl with MANO's names and classes."""
    module = types.ModuleType("chumpy.ch")
    Ch.__module__, module.Ch = "chumpy.ch", Ch
    sys.modules.setdefault("chumpy", types.ModuleType("chumpy"))
    sys.modules["chumpy.ch"] = module
    folder.mkdir(parents=True, exist_ok=True)
    for side in SIDES:
        arrays: dict[str, object] = {**mano_arrays(side), "bs_type": "lrotmin"}
        arrays["shapedirs"] = Ch(arrays["shapedirs"])
        arrays["J_regressor"] = scipy.sparse.csc_matrix(arrays["J_regressor"])
        (folder / f"MANO_{side.upper()}.pkl").write_bytes(pickle.dumps(arrays, protocol=2))
    del sys.modules["chumpy.ch"], sys.modules["chumpy"]
    return folder


@cache
def mano_model(side: str):
    """MANO with the official left file, from the embedded hand."""
    return replace(load_hand(side), shape_dirs=torch.from_numpy(right_shape_dirs()).float())
