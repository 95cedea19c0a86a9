"""Joint limits as boxes of axis-angle vectors, and the pose of a relaxed hand.

Angles are anatomical (flexion towards the palm, spreading towards the index, twist along the bone)
and are turned into MANO's axis-angle vectors by the rest skeleton: a finger flexes about the line
across it, which is near +z for the right hand.
"""

from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from tools.hand_builder.anatomy import CHAINS, THUMB, Digit, FloatArray

AngleRange = tuple[float, float]

FLEX: dict[int, tuple[AngleRange, AngleRange, AngleRange]] = {
    0: ((-25, 95), (-5, 115), (-10, 85)),
    1: ((-25, 95), (-5, 115), (-10, 85)),
    2: ((-30, 100), (-5, 110), (-10, 85)),
    3: ((-25, 95), (-5, 115), (-10, 85)),
}
"""Degrees of flexion, per finger (index into CHAINS), knuckle to distal joint."""
SPREAD: dict[int, AngleRange] = {0: (-22, 22), 1: (-18, 18), 2: (-35, 25), 3: (-20, 18)}
TWIST: dict[int, AngleRange] = {0: (-20, 20), 1: (-20, 20), 2: (-35, 35), 3: (-20, 20)}
SLACK = 0.15
"""Margin of the limits, radians: recordings split a rotation between joints in various ways."""

THUMB_LOW = np.array([[-0.5, -0.75, -0.45], [-0.35, -1.0, -0.35], [-0.35, -1.25, -1.35]])
THUMB_HIGH = np.array([[2.05, 0.75, 0.75], [1.6, 0.4, 0.95], [0.75, 0.45, 0.9]])
"""Limits of the thumb in MANO's axes, radians; turning about +x brings it before the palm."""

RELAXED_FLEX = {0: (18, 30, 15), 1: (24, 34, 17), 2: (26, 30, 15), 3: (27, 36, 18)}
RELAXED_SPREAD = {0: -3.0, 1: 0.0, 2: 12.0, 3: 4.0}
RELAXED_THUMB = np.array([[0.55, -0.10, 0.10], [0.10, -0.15, 0.10], [0.08, -0.20, 0.12]])
FINGER_STD = np.array([[0.20, 0.16, 0.40], [0.18, 0.08, 0.42], [0.12, 0.06, 0.30]])
THUMB_STD = np.array([[0.45, 0.25, 0.25], [0.35, 0.25, 0.25], [0.20, 0.30, 0.40]])


def joint_limits(tubes: tuple[Digit, ...]) -> tuple[FloatArray, FloatArray]:
    """Lower and upper bounds (16, 3) of each joint's axis-angle vector; the wrist is free."""
    low, high = np.full((16, 3), -np.inf), np.full((16, 3), np.inf)
    for finger, chain in enumerate(CHAINS):
        if finger == THUMB:
            low[list(chain[:3])], high[list(chain[:3])] = THUMB_LOW, THUMB_HIGH
            continue
        for place, joint in enumerate(chain[:3]):
            spread = SPREAD[finger] if place == 0 else (0.0, 0.0)
            reach = _reachable(tubes[finger], place, FLEX[finger][place], spread, TWIST[finger])
            low[joint], high[joint] = reach.min(0) - SLACK, reach.max(0) + SLACK
    return low, high


def relaxed_pose(tubes: tuple[Digit, ...]) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation (16, 3) of a relaxed hand, axis-angle in radians, wrist zero."""
    mean, std = np.zeros((16, 3)), np.ones((16, 3))
    for finger, chain in enumerate(CHAINS):
        joints = list(chain[:3])
        if finger == THUMB:
            mean[joints], std[joints] = RELAXED_THUMB, THUMB_STD
            continue
        for place, joint in enumerate(joints):
            spread = RELAXED_SPREAD[finger] if place == 0 else 0.0
            mean[joint] = rotation_vector(
                tubes[finger], place, RELAXED_FLEX[finger][place], spread, 0.0
            )
        std[joints] = FINGER_STD
    return mean, std


def rotation_vector(
    tube: Digit, place: int, flex: float, spread: float, twist: float
) -> FloatArray:
    """Axis-angle vector of anatomical angles in degrees at one joint of a digit."""
    bone = tube.points[place + 1] - tube.points[place]
    bone = bone / np.linalg.norm(bone)
    up = tube.dorsal - bone * (bone @ tube.dorsal)
    up /= np.linalg.norm(up)
    axes = np.stack([up, bone, np.cross(up, bone)])
    angles = np.radians([spread, twist, flex])
    parts = [Rotation.from_rotvec(angle * axis) for angle, axis in zip(angles, axes, strict=True)]
    return (parts[0] * parts[1] * parts[2]).as_rotvec()


def _reachable(
    tube: Digit, place: int, flex: AngleRange, spread: AngleRange, twist: AngleRange
) -> FloatArray:
    """Axis-angle vectors over a grid of the joint's range."""
    grid = product(np.linspace(*flex, 9), np.linspace(*spread, 5), np.linspace(*twist, 3))
    return np.stack([rotation_vector(tube, place, *angles) for angles in grid])
