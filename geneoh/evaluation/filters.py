"""The cleaners people already have: low-pass filters, on keypoints and on parameters."""

import numpy as np
import torch
from jaxtyping import Float
from scipy.signal import savgol_filter
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics, rest_offsets
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.tracks import HandTrack

WINDOWS = (5, 9, 15, 21, 31)
"""Frames; the windows that the generous baseline may choose from, with ground truth in hand."""
ORDER = 2


def smooth(values: Float[Tensor, "T ..."], window: int) -> Float[Tensor, "T ..."]:
    """Savitzky-Golay filter of order 2 over frames; a track shorter than the window is returned."""
    if len(values) < window:
        return values
    filtered = savgol_filter(values.double().numpy(), window, ORDER, axis=0)
    return torch.from_numpy(np.ascontiguousarray(filtered)).to(values)


def smooth_keypoints(hand: HandTrack, window: int) -> Float[Tensor, "T 21 3"]:
    """Keypoints filtered coordinate by coordinate, gaps filled linearly first."""
    filled = fill_gaps(hand)
    assert filled.joints is not None, "the comparison needs keypoints"
    return smooth(filled.joints, window)


def smooth_parameters(hand: HandTrack, window: int) -> Float[Tensor, "T 21 3"]:
    """Keypoints of filtered wrist positions and axis-angle vectors, on the input's own skeleton."""
    filled = fill_gaps(hand)
    assert filled.pose is not None, "the filter on parameters needs a pose"
    assert filled.joints is not None, "the comparison needs keypoints"
    offsets = rest_offsets(axis_angle_to_matrix(filled.pose), filled.joints, hand.valid)
    pose, wrist = smooth(filled.pose, window), smooth(filled.joints[:, 0], window)
    joints, _ = forward_kinematics(
        axis_angle_to_matrix(pose), wrist, offsets.expand(len(pose), 20, 3)
    )
    return joints


def best_window(
    hand: HandTrack, truth: Float[Tensor, "T 21 3"], *, on: str
) -> tuple[int, Float[Tensor, "T 21 3"]]:
    """Window and result nearest to the ground truth: better than any user could choose."""
    filtered = smooth_keypoints if on == "keypoints" else smooth_parameters
    tried = [(window, filtered(hand, window)) for window in WINDOWS]
    return min(tried, key=lambda made: float((made[1] - truth).norm(dim=-1).mean()))
