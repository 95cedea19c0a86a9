"""Checks of a single hand: the depth and the order of its keypoints, and its side.

A check yields a sentence for each doubt.
"""

from collections.abc import Iterator

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import OTHER_SIDE, Side
from geneoh.errors import InputError
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.readers.joint_orders import shorter_order
from geneoh.readers.records import Array
from geneoh.sequence.keypoints import KNUCKLES
from geneoh.sequence.sequence import HandTrack
from geneoh.sequence.validation import lies_flat

MIDDLE_JOINTS = (2, 5, 8, 11)
"""Second joints of the four fingers, which bend one way only."""
BACKWARD_LIMIT = 0.05
"""Largest mean angle in radians by which these joints bend backward; in recordings they bend
forward by 0.2 and more."""
FINGERTIPS = [8, 12, 16, 20]
"""Keypoints at the tips of the four fingers."""
FINGER_FROM = [start for knuckle in KNUCKLES for start in range(knuckle, knuckle + 3)]
FINGER_TO = [start + 1 for start in FINGER_FROM]
"""Keypoints at both ends of the bones of the four fingers."""
LONGEST_LINK = 0.8
"""Largest length of a finger's bone in palm lengths; the longest measured is 0.6."""
REORDER = "reorder them, or pass --joint-order {order} where they are bare keypoints"
"""What to do about a file whose keypoints are in another order."""
NO_DEPTH = 1e-4
"""Value below which the wrist's depth counts as 0, as in MediaPipe's image landmarks, whose depths
are relative to the wrist."""
HANDEDNESS = "handedness:"
"""Beginning of the sentences on a hand that seems to be of the other side."""
MIRRORED = (
    "in left-handed axes, as Unity and Unreal have: negate one coordinate of all points and meshes"
)
"""End of such sentences: keypoints of a mirrored scene look like a hand of the other side."""
THUMB_JOINTS = [2, 3]
"""Keypoints of the thumb that lie in front of the palm however the fingers are bent."""
MIDDLE_POINTS = [knuckle + 1 for knuckle in KNUCKLES]
"""Keypoints of the four fingers' middle joints."""
BEHIND_LIMIT = 0.05
"""A hand is of the other side if `palm_side` is below minus this. Under every noise, hands of the
stated side stay above that value, and hands of the other side as far below it."""


def refuse_other_order(hand: HandTrack, name: str, cure: str = REORDER) -> None:
    """`InputError` if the keypoints are certainly in another order than OpenPose's.

    The message names the file `name` and ends with the remedy `cure`, in which {order} is replaced.
    """
    if hand.joints is not None and (order := shorter_order(trusted_joints(hand))):
        raise InputError(
            f"{name}: the keypoints of the {hand.side} hand must be in OpenPose order, got bones "
            f"that only a hand in the order {order} has; {cure.format(order=order)}"
        )


def trusted_joints(hand: HandTrack) -> Float[Tensor, "N 21 3"]:
    """Keypoints of the observed frames, NaN where the confidence is 0."""
    assert hand.joints is not None, "asked for the joints of a track that has none"
    return hand.joints.masked_fill((hand.trust == 0)[..., None], torch.nan)[hand.observed]


def check_anatomy(hand: HandTrack) -> Iterator[str]:
    """Whether keypoints and pose are those of a hand of its side, in OpenPose's order."""
    if hand.joints is not None:
        joints = trusted_joints(hand)
        yield from check_depth(joints)
        yield from check_keypoint_order(joints, hand.side)
    if hand.pose is not None:
        yield from check_finger_bend(hand.pose[hand.valid], hand.side)


def check_depth(joints: Float[Tensor, "N 21 3"]) -> Iterator[str]:
    """Whether the keypoints are 3D points, and not landmarks in an image."""
    if of_picture(joints.cpu().numpy()):
        yield (
            "place: the depth of its wrist is 0 in every frame and the others are measured from "
            "it, as in MediaPipe's landmarks of the picture, which have no size; give its world "
            "landmarks"
        )
    elif lies_flat(joints):
        yield (
            "place: its keypoints lie in a plane, as points of a picture with a score do; unless "
            "they are of a flat hand, give 3D keypoints"
        )


def check_keypoint_order(joints: Float[Tensor, "N 21 3"], side: Side) -> Iterator[str]:
    """Whether the bones between the keypoints are as short as a finger's, and curl to the palm."""
    span = palm_length(joints)
    links = (joints[:, FINGER_TO] - joints[:, FINGER_FROM]).norm(dim=-1)
    longest = float(links.nanmedian(0).values.nan_to_num().max())
    if order := shorter_order(joints):
        yield f"order: the bones are those of a hand in the order {order}, not in OpenPose's"
    elif longest > LONGEST_LINK * span:
        yield (
            f"order: a finger's bone is {1000 * longest:.0f} mm long beside a palm of "
            f"{1000 * span:.0f} mm; the keypoints are in another order (--joint-order)"
        )
    elif curls_backward(joints, side):
        yield (
            f"{HANDEDNESS} thumb and fingers curl away from the palm; these seem to be points of "
            f"the other hand: pass --side {OTHER_SIDE[side]} or correct the side that is stated; "
            f"or they are {MIRRORED}"
        )


def of_picture(points: Array) -> bool:
    """Whether points are image landmarks: only those have a wrist off the origin with depth 0."""
    wrist = points[np.isfinite(points).all((1, 2)), 0]
    flat = len(wrist) > 0 and np.abs(wrist[:, 2]).max() < NO_DEPTH
    return bool(flat and np.abs(wrist[:, :2]).min() > NO_DEPTH and (wrist > -NO_DEPTH).all())


def curls_backward(joints: Float[Tensor, "T 21 3"], side: Side) -> bool:
    """Whether fingers and thumb are behind the palm, as if the hand were of the other side."""
    return palm_side(joints, side) < -BEHIND_LIMIT


def palm_side(joints: Float[Tensor, "T 21 3"], side: Side) -> float:
    """How far fingers and thumb are in front of the palm; negative for a hand of the other side.

    The sum of the mean sine of the bend of middle joints, half of the height of fingertips over
    their knuckles, and the height of the thumb over the wrist, in palm lengths along the normal.
    Under noise, no single term decides for a hand with stretched fingers or thumb.
    """
    normals = palm_normals(joints, side)[:, None]
    thumb = ((joints[:, THUMB_JOINTS] - joints[:, :1]) * normals).sum(-1).nanmean(-1)
    height = (finger_curls(joints, side) / 2 + thumb).nanmean() / palm_length(joints)
    return float(height + middle_bend(joints, side).nanmean())


def middle_bend(joints: Float[Tensor, "T 21 3"], side: Side) -> Float[Tensor, " T"]:
    """Mean sine by which the middle joints of the four fingers bend to the palm."""
    middle = joints[:, MIDDLE_POINTS]
    before, after = middle - joints[:, KNUCKLES], joints[:, [k + 1 for k in MIDDLE_POINTS]] - middle
    across = (joints[:, 5] - joints[:, 17])[:, None] * (1 if side == "right" else -1)
    unit = torch.nn.functional.normalize
    turn = torch.linalg.cross(unit(before, dim=-1), unit(after, dim=-1))
    return (turn * unit(across, dim=-1)).sum(-1).nanmean(-1)


def palm_length(joints: Float[Tensor, "T 21 3"]) -> float:
    """Median distance in metres from the wrist to a knuckle."""
    return float((joints[:, KNUCKLES] - joints[:, :1]).norm(dim=-1).nanmedian())


def palm_normals(joints: Float[Tensor, "T 21 3"], side: Side) -> Float[Tensor, "T 3"]:
    """Unit normals of the palm, on its inner side."""
    palm = torch.linalg.cross(joints[:, 5] - joints[:, 0], joints[:, 17] - joints[:, 0])
    return torch.nn.functional.normalize(palm, dim=-1) * (1 if side == "right" else -1)


def finger_curls(joints: Float[Tensor, "T 21 3"], side: Side) -> Float[Tensor, " T"]:
    """Mean distance in metres from knuckles to tips along the palm's inner normal, without NaN."""
    normals = palm_normals(joints, side)[:, None]
    return ((joints[:, FINGERTIPS] - joints[:, KNUCKLES]) * normals).sum(-1).nanmean(-1)


def check_finger_bend(pose: Float[Tensor, "N 16 3"], side: Side) -> Iterator[str]:
    """Whether the pose bends the fingers the way that they can bend."""
    shortest = matrix_to_axis_angle(axis_angle_to_matrix(pose[:, MIDDLE_JOINTS]))
    bend = float(shortest[..., 2].mean())
    bend = bend if side == "right" else -bend
    if bend < -BACKWARD_LIMIT:
        other = OTHER_SIDE[side]
        yield (
            f"{HANDEDNESS} the fingers bend backward by {-bend:.2f} rad on average; unless the "
            f"hand is flat, these are the numbers of a {other} hand (--side {other}), or a mean "
            "pose is missing (--mean-pose)"
        )
