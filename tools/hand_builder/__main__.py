"""Writes the asset of the embedded hand: `python -m tools.hand_builder OUT.npz`."""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.hand.embedded import TIP_VERTS
from geneoh.hand.skeleton import PARENTS
from tools.hand_builder.anatomy import digits, skeleton
from tools.hand_builder.correctives import pose_directions
from tools.hand_builder.limits import joint_limits, relaxed_pose
from tools.hand_builder.placing import place_vertices
from tools.hand_builder.shape import shape_directions
from tools.hand_builder.skinning import joint_regressor, skin_weights
from tools.hand_builder.topology import HandTopology, hand_topology

ORIGIN = np.array([96.0, 6.0, 6.0])
"""Position of the wrist joint in the template, mm: about that of MANO's mean right hand, so that
translations of the two models (convention O) are close to each other."""


def build() -> dict[str, np.ndarray]:
    """All arrays of the asset, metres, in MANO's field names."""
    points, topology = skeleton(), hand_topology()
    tubes = digits(points)
    verts = place_vertices(topology)
    weights = skin_weights(topology, verts, tubes)
    dirs, point_dirs = shape_directions(verts, weights, points)
    regressor = joint_regressor(verts, points[:16], dirs, point_dirs[:16])
    low, high = joint_limits(tubes)
    mean, std = relaxed_pose(tubes)
    order = tip_order(topology)
    rank = np.argsort(order)
    arrays = {
        "v_template": (verts[order] + ORIGIN) / 1000.0,
        "shapedirs": dirs[order] / 1000.0,
        "posedirs": pose_directions(verts, weights, tubes)[order] / 1000.0,
        "J_regressor": regressor[:, order],
        "weights": weights[order],
        "hands_components": np.eye(45),
        "hands_mean": mean[1:].ravel(),
        "pose_low": low,
        "pose_high": high,
        "pose_mean": mean,
        "pose_std": std,
    }
    whole = {"f": rank[topology.triangles], "kintree_table": np.array([PARENTS, range(16)])}
    return {name: array.astype(np.float32) for name, array in arrays.items()} | {
        name: array.astype(np.int32) for name, array in whole.items()
    }


def tip_order(topology: HandTopology) -> np.ndarray:
    """Order of the vertices in which the fingertips have the numbers that smplx expects."""
    order = np.arange(topology.count)
    by_digit = (TIP_VERTS[0], TIP_VERTS[1], TIP_VERTS[3], TIP_VERTS[2], TIP_VERTS[4])
    for now, wanted in zip(topology.tips, by_digit, strict=True):
        here = int(np.flatnonzero(order == now)[0])
        order[[here, wanted]] = order[[wanted, here]]
    return order


if __name__ == "__main__":
    arrays: dict[str, Any] = build()
    with Path(sys.argv[1]).open("wb") as file:
        np.savez_compressed(file, **arrays)
