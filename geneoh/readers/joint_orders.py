"""Orders of hand keypoints, and how each becomes OpenPose's."""

from dataclasses import dataclass, replace

import numpy as np

from geneoh.choices import JointOrder
from geneoh.readers.records import Array, Record


@dataclass(frozen=True)
class Order:
    """Keypoint i of OpenPose's 21 is entry `entries[i]` of `count`; -1 where there is none."""

    count: int
    entries: tuple[int, ...]


ORDERS: dict[JointOrder, Order] = {
    "openpose": Order(21, tuple(range(21))),
    "mano": Order(21, (0, 13, 14, 15, 16, 1, 2, 3, 17, 4, 5, 6, 18, 10, 11, 12, 19, 7, 8, 9, 20)),
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
"""Place of the thumb's base between the wrist and the next joint of the thumb, as a share of that
way, in MANO's mean hand."""


def openpose_order(points: Array, order: JointOrder) -> tuple[Array, Array]:
    """(T, 21, 3) keypoints in OpenPose's order out of (T, N, 3) in another one.

    Also (21,) trust: 0 where the order has no such keypoint and it was estimated, else 1.
    """
    entries = np.array(ORDERS[order].entries)
    joints = points[:, np.maximum(entries, 0)].copy()
    if (entries < 0).any():  # only ever the base of the thumb
        way = joints[:, THUMB_NEXT] - joints[:, 0]
        joints[:, THUMB_BASE] = joints[:, 0] + THUMB_BASE_SHARE * way
    return joints, (entries >= 0).astype(np.float64)


def in_openpose_order(record: Record, points: Array, order: JointOrder) -> Record:
    """The fields with (T, N, 3) `points` in OpenPose's order as 'joints', and 'confidence' too."""
    joints, trust = openpose_order(points, order)
    given = record.optional_array("confidence", ("T", ORDERS[order].count), ("T",))
    values = {**record.values, "joints": joints}
    if given is None and trust.all():
        return replace(record, values=values)
    given = np.ones(len(points)) if given is None else given
    if given.ndim == 1:
        given = given[:, None]
    else:
        given = openpose_order(given[..., None], order)[0][..., 0]
    return replace(record, values={**values, "confidence": given * trust})
