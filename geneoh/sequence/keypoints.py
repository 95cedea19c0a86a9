"""Keypoints of a hand track, also of one with pose parameters alone, and axes of its palm."""

from jaxtyping import Float
from torch import Tensor

from geneoh.geometry.rotations import axes_along, axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.sequence.sequence import HandTrack

KNUCKLES = (5, 9, 13, 17)
"""Keypoints at the base of the four fingers."""
PALM = (0, *KNUCKLES)
"""Keypoints that move with the palm: the wrist and the knuckles."""


def keypoints_of(hand: HandTrack) -> Float[Tensor, "T 21 3"]:
    """Keypoints of a track, metres, world frame; from pose and mean shape where it stores none."""
    if hand.joints is not None:
        return hand.joints
    assert hand.pose is not None, "a track without joints has a pose"
    assert hand.wrist is not None, "a pose comes with a wrist"
    mean = load_hand(hand.side).to(hand.pose.device).shaped(hand.pose.new_zeros(10))
    return mean.joints_from_rotations(axis_angle_to_matrix(hand.pose), hand.wrist)


def palm_axes(joints: Float[Tensor, "B T 21 3"]) -> Float[Tensor, "B 3 3"]:
    """Axes of the mean palm over the T frames as columns: along it, across it, and its normal."""
    wrist, middle, index, pinky = (joints[:, :, i].mean(1) for i in (0, 9, 5, 17))
    return axes_along(middle - wrist, index - pinky)
