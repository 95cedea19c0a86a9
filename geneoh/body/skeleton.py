"""The body's kinematic tree: 52 joints in SMPL-H order, and a skeleton of our own.

Frame of the rest pose: a T-pose with y up, facing +z, so that the left arm points towards +x, both
palms down and the thumbs forward. All joints' rotations are the identity there, and the hands are
flat, as in SMPL-H with `flat_hand_mean`. Each hand's 15 joints stand in MANO order, their offsets
in MANO's rest frame, so a hand's pose parameters mean the same on a body and on a hand alone.
"""

from dataclasses import dataclass
from functools import cache

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import SIDES, Side
from geneoh.hand.library import mean_hand
from geneoh.hand.skeleton import FINGERS
from geneoh.hand.skeleton import PARENTS as HAND_PARENTS

BODY_JOINTS = 22
"""Joints 0 to 21 are the body's, the wrists included; 22 to 51 those of the fingers."""
BODY_NAMES = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"),
    *("left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck"),
    *("left_collar", "right_collar", "head", "left_shoulder", "right_shoulder"),
    *("left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
JOINT_NAMES: tuple[str, ...] = (
    *BODY_NAMES,
    *(f"{side}_{finger}{i}" for side in SIDES for finger in FINGERS for i in (1, 2, 3)),
)
BODY_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
WRISTS: dict[Side, int] = {side: JOINT_NAMES.index(f"{side}_wrist") for side in SIDES}
FINGER_JOINTS: dict[Side, tuple[int, ...]] = {
    side: tuple(JOINT_NAMES.index(f"{side}_index1") + i for i in range(15)) for side in SIDES
}
"""Joints 1 to 15 of a hand in MANO order."""


def _finger_parents(side: Side) -> tuple[int, ...]:
    hand = (WRISTS[side], *FINGER_JOINTS[side])
    return tuple(hand[parent] for parent in HAND_PARENTS[1:])


PARENTS: tuple[int, ...] = (*BODY_PARENTS, *_finger_parents("left"), *_finger_parents("right"))
"""Parent of each joint; -1 for the root, the pelvis."""

REST_BODY = {
    "pelvis": (0.0, 0.98, 0.0),
    "spine1": (0.0, 1.08, -0.01),
    "spine2": (0.0, 1.21, -0.02),
    "spine3": (0.0, 1.28, -0.02),
    "neck": (0.0, 1.48, -0.04),
    "head": (0.0, 1.57, 0.0),
    "left_hip": (0.085, 0.92, 0.0),
    "left_knee": (0.09, 0.5, 0.0),
    "left_ankle": (0.095, 0.075, -0.02),
    "left_foot": (0.105, 0.02, 0.11),
    "left_collar": (0.05, 1.4, -0.02),
    "left_shoulder": (0.175, 1.42, -0.03),
    "left_elbow": (0.455, 1.42, -0.04),
    "left_wrist": (0.72, 1.42, -0.03),
}
"""Joint centres of an adult of 1.74 m in the T-pose, metres above the ground; the right ones are
mirrored. Limbs rounded from de Leva 1996, Adjustments to Zatsiorsky-Seluyanov's segment inertia
parameters, table 4 (thigh 0.42, shank 0.43, upper arm 0.28, forearm 0.27); the trunk is ours."""


@dataclass(frozen=True)
class Skeleton(Bundle):
    """The rest pose of one person's body and hands."""

    offsets: Float[Tensor, "*B 52 3"]
    """Position of each joint relative to its parent in the T-pose, metres, y up, facing +z; zero
    for the root."""


@cache
def embedded_skeleton() -> Skeleton:
    """The skeleton that ships with geneoh; its hands are those of `geneoh.hand.embedded`."""
    places = torch.tensor([_rest_place(name) for name in BODY_NAMES])
    body = places - places[list((0, *BODY_PARENTS[1:]))]
    hands = [mean_hand(side).offsets[:15] for side in SIDES]
    return Skeleton(torch.cat([body, *hands]))


def _rest_place(name: str) -> tuple[float, float, float]:
    x, y, z = REST_BODY[name.replace("right", "left")]
    return (-x, y, z) if name.startswith("right") else (x, y, z)
