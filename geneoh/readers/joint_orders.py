"""Orders of hand keypoints, and their conversion to OpenPose's."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import JointOrder
from geneoh.errors import InputError
from geneoh.hand.skeleton import KEYPOINT_PARENTS
from geneoh.readers.records import Array, Record


@dataclass(frozen=True)
class Order:
    """Keypoint i of OpenPose's 21 is entry `entries[i]` of `count`; -1 where there is none."""

    count: int
    entries: tuple[int, ...]


ORDERS: dict[JointOrder, Order] = {
    "openpose": Order(21, tuple(range(21))),
    "mano": Order(21, (0, 13, 14, 15, 16, 1, 2, 3, 17, 4, 5, 6, 18, 10, 11, 12, 19, 7, 8, 9, 20)),
    "mano16": Order(16, (0, 13, 14, 15, -1, 1, 2, 3, -1, 4, 5, 6, -1, 10, 11, 12, -1, 7, 8, 9, -1)),
    "fphab": Order(21, (0, 1, 6, 7, 8, 2, 9, 10, 11, 3, 12, 13, 14, 4, 15, 16, 17, 5, 18, 19, 20)),
    "aria": Order(21, (5, -1, 6, 7, 0, 8, 9, 10, 1, 11, 12, 13, 2, 14, 15, 16, 3, 17, 18, 19, 4)),
    "webxr": Order(25, (0, 1, 2, 3, 4, 6, 7, 8, 9, 11, 12, 13, 14, 16, 17, 18, 19, 21, 22, 23, 24)),
    "openxr": Order(
        26, (1, 2, 3, 4, 5, 7, 8, 9, 10, 12, 13, 14, 15, 17, 18, 19, 20, 22, 23, 24, 25)
    ),
}
THUMB_BASE, THUMB_NEXT = 1, 2
"""Keypoints of OpenPose: the base of the thumb and the joint after it."""
THUMB_BASE_SHARE = 0.4
"""Position of the thumb's base in MANO's mean hand, as a fraction of the way from the wrist to the
thumb's next joint."""
SHORTER_BONES = 0.9
"""Ratio of total bone lengths below which another order of the keypoints is taken for the true one:
the true order has the shortest bones, with up to 40 mm of noise."""


def openpose_order(points: Array, order: JointOrder) -> tuple[Array, Array]:
    """(T, 21, 3) keypoints in OpenPose's order, from (T, N, 3) in another one.

    Also (21,) confidence: 0 for a keypoint that the order lacks, else 1. The base of the thumb is
    then estimated; fingertips are NaN.
    """
    entries = np.array(ORDERS[order].entries)
    joints = points[:, np.maximum(entries, 0)].copy()
    joints[:, entries < 0] = np.nan
    if entries[THUMB_BASE] < 0:
        way = joints[:, THUMB_NEXT] - joints[:, 0]
        joints[:, THUMB_BASE] = joints[:, 0] + THUMB_BASE_SHARE * way
    return joints, (entries >= 0).astype(np.float64)


def order_of_points(points: object) -> JointOrder | None:
    """The order with as many keypoints as (T, N, 3) `points`; None if none or several have N."""
    shape = points.shape if isinstance(points, Array) else ()
    known: list[JointOrder] = [
        name for name, order in ORDERS.items() if (order.count, 3) == shape[1:]
    ]
    return known[0] if len(known) == 1 else None


def in_openpose_order(record: Record, points: Array, order: JointOrder) -> Record:
    """The fields with (T, N, 3) `points` as 'joints' in OpenPose's order, and 'confidence' too.

    Raises `InputError` if the bone lengths show another order. For points that are already in
    OpenPose's order the check of the sequence does so.
    """
    if order != "openpose" and (other := shorter_order(torch.from_numpy(points), order)):
        raise InputError(
            f"{record.where}: the keypoints must be in the order {order}, as --joint-order says, "
            f"got bones that only a hand in the order {other} has; pass --joint-order {other}"
        )
    joints, trust = openpose_order(points, order)
    confidence = record.optional_array("confidence", ("T", ORDERS[order].count), ("T",))
    values = {**record.values, "joints": joints}
    if confidence is None and trust.all():
        return replace(record, values=values)
    confidence = np.ones(len(points)) if confidence is None else confidence
    if confidence.ndim == 1:
        confidence = confidence[:, None]
    else:
        confidence = openpose_order(confidence[..., None], order)[0][..., 0]
    return replace(record, values={**values, "confidence": confidence * trust})


def shorter_order(
    points: Float[Tensor, "T N 3"], expected: JointOrder = "openpose"
) -> JointOrder | None:
    """The order in which the keypoints have much shorter bones than in the expected one, if any."""
    totals: dict[JointOrder, float] = {
        name: bones_length(torch.from_numpy(openpose_order(points.cpu().numpy(), name)[0]))
        for name, order in ORDERS.items()
        if name == expected or sorted(order.entries) == list(range(points.shape[1]))
    }
    best = min(totals, key=totals.__getitem__)
    return best if totals[best] < SHORTER_BONES * totals[expected] else None


def bones_length(joints: Float[Tensor, "T 21 3"]) -> float:
    """Sum of the median lengths of a hand's bones; NaN if a keypoint is missing in all frames."""
    bones = joints[:, 1:] - joints[:, list(KEYPOINT_PARENTS[1:])]
    return float(bones.norm(dim=-1).nanmedian(0).values.sum())
