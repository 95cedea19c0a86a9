"""Filters on the track of the object or of the hand, but not on both."""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float, Float64
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle, nearest_rotations
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.sequence import Sequence

ObjectFilter = Literal[
    "smooth 3", "smooth 6", "lag 0.3", "late 2", "hand smooth 3", "hand lag 0.3", "hand late 2"
]
"""A Gaussian filter by its standard deviation in frames, an exponential moving average by the
weight of a new frame, or a delay in frames; on the object, or on the hand."""


def filtered_as(sequence: Sequence, kind: ObjectFilter) -> Sequence:
    """A sequence whose object, or hand, went through a filter."""
    name, size = kind.removeprefix("hand ").split()

    def through(values: Float[Tensor, "T ..."]) -> Float[Tensor, "T ..."]:
        done = FILTERS[name](values.double().cpu().numpy(), float(size))
        return torch.from_numpy(np.ascontiguousarray(done)).to(values)

    if not kind.startswith("hand"):
        motion = sequence.object
        turns = nearest_rotations(through(motion.rotation))
        motion = replace(motion, rotation=turns, translation=through(motion.translation))
        return replace(sequence, object=motion)
    (hand,) = sequence.hands
    whole = fill_gaps(hand)
    assert whole.joints is not None, "every clip has joints"
    assert whole.pose is not None, "every clip has a pose"
    assert whole.wrist is not None, "every clip has a wrist"
    pose = matrix_to_axis_angle(nearest_rotations(through(axis_angle_to_matrix(whole.pose))))
    hand = replace(hand, joints=through(whole.joints), pose=pose, wrist=through(whole.wrist))
    return replace(sequence, hands=(hand,))


def smooth(values: Float64[np.ndarray, "T ..."], size: float) -> Float64[np.ndarray, "T ..."]:
    """A Gaussian filter over frames, as of an offline smoother."""
    return gaussian_filter1d(values, size, axis=0, mode="nearest")


def lag(values: Float64[np.ndarray, "T ..."], share: float) -> Float64[np.ndarray, "T ..."]:
    """A causal exponential moving average; `share` is the weight of a new frame."""
    start = (1 - share) * values[:1]
    return lfilter([share], [1, share - 1], values, axis=0, zi=start)[0]


def late(values: Float64[np.ndarray, "T ..."], frames: float) -> Float64[np.ndarray, "T ..."]:
    """A delay by whole frames."""
    return values[(np.arange(len(values)) - int(frames)).clip(0)]


FILTERS: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "smooth": smooth,
    "lag": lag,
    "late": late,
}
