"""Low-pass filters on keypoints and on parameters, the usual way to clean a hand track.

The size of a filter is either tuned once, on validation clips over all kinds of noise (`TUNED`,
made by `python -m tools.tune_filters`), as a careful user could do. Or it is the best size for the
test clip itself, chosen with the ground truth (`best_filtered`), as no user can.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d
from torch import Tensor
from typing_extensions import assert_never

from geneoh.choices import FilterKind
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics, rest_offsets
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.sequence import HandTrack

Domain = Literal["keypoints", "parameters"]
"""What is filtered: coordinates of keypoints, or wrist position and joint rotations."""
CENTROID_FRAMES = 5.0  # standard deviation of the Gaussian in `smoothed_centroid`, frames
ORDER = 2  # degree of the Savitzky-Golay filter's polynomials
OFFSET_STEPS = 20  # iterations of `best_offset`; later ones move it by less than a micrometre
SPEED_CUTOFF = 1.0  # cutoff of the One-Euro filter's speed estimate, hertz (its authors' value)


@dataclass(frozen=True)
class Filter:
    """A low-pass filter over frames with its size."""

    kind: FilterKind
    size: float
    """Window in frames (savgol), standard deviation in frames (gaussian), or minimum cutoff in
    hertz (one-euro)."""
    beta: float = 0.0  # One-Euro: increase of the cutoff in hertz per speed of one unit a second


GRID: dict[FilterKind, tuple[Filter, ...]] = {
    "savgol": tuple(Filter("savgol", window) for window in (5.0, 9.0, 15.0, 21.0, 31.0)),
    "gaussian": tuple(Filter("gaussian", frames) for frames in (0.7, 1.0, 1.5, 2.0, 3.0, 4.5)),
    "one-euro": tuple(
        Filter("one-euro", cutoff, beta)
        for cutoff in (1.0, 2.0, 4.0, 8.0)
        for beta in (0.0, 2.0, 8.0, 32.0)
    ),
}
"""The sizes that tuning may choose from, and the candidates of `best_filtered` and
`best_filtered_and_moved`."""

TUNED: dict[tuple[FilterKind, Domain], Filter] = {
    ("savgol", "keypoints"): Filter("savgol", 15.0),  # 16.07 mm
    ("savgol", "parameters"): Filter("savgol", 15.0),  # 15.45 mm
    ("gaussian", "keypoints"): Filter("gaussian", 1.5),  # 16.08 mm
    ("gaussian", "parameters"): Filter("gaussian", 2.0),  # 15.45 mm
    ("one-euro", "keypoints"): Filter("one-euro", 1.0, 32.0),  # 18.65 mm
    ("one-euro", "parameters"): Filter("one-euro", 8.0),  # 19.14 mm
}
"""One size for all kinds of noise, with its mean keypoint error on the validation clips, which have
`TUNED_FPS` frames a second; printed by `python -m tools.tune_filters`."""
TUNED_FPS = 30.0


def tuned_at(kind: FilterKind, domain: Domain, fps: float) -> Filter:
    """The tuned filter, which smooths over the same time at any frame rate; windows are odd."""
    chosen = TUNED[kind, domain]
    size = chosen.size * fps / TUNED_FPS
    if kind == "savgol":
        size = 2.0 * max(1, round((size - 1) / 2)) + 1
    return chosen if kind == "one-euro" else replace(chosen, size=size)


def smooth(values: Float[Tensor, "T ..."], chosen: Filter, fps: float) -> Float[Tensor, "T ..."]:
    """Filter each coordinate over frames; a window is at most as long as the track."""
    array = values.cpu().double().numpy()
    match chosen.kind:
        case "savgol":
            from scipy.signal import savgol_filter  # slow to import, and not used by the cleaner

            longest = len(array) - (len(array) + 1) % 2  # windows are odd
            window = min(round(chosen.size), longest)
            done = array if window <= ORDER else savgol_filter(array, window, ORDER, axis=0)
        case "gaussian":
            done = gaussian_filter1d(array, chosen.size, axis=0, mode="nearest")
        case "one-euro":
            done = one_euro(array, chosen.size, chosen.beta, fps)
        case _:
            assert_never(chosen.kind)
    return torch.from_numpy(np.ascontiguousarray(done)).to(values)


def one_euro(
    values: Float[np.ndarray, "T ..."], cutoff: float, beta: float, fps: float
) -> Float[np.ndarray, "T ..."]:
    """The One-Euro filter: causal exponential smoothing that is weaker where values change fast.

    `cutoff` and `beta` are `Filter.size` and `Filter.beta`.
    Source: Casiez et al., CHI 2012, algorithm 1.
    """

    def share(hertz: float | np.ndarray) -> float | np.ndarray:
        """Weight of the new value for a cutoff frequency."""
        rate = 2 * math.pi * hertz / fps
        return rate / (rate + 1)

    kept = [values[0]]
    speed = np.zeros_like(values[0])
    for value in values[1:]:
        speed = speed + share(SPEED_CUTOFF) * ((value - kept[-1]) * fps - speed)
        weight = share(cutoff + beta * np.abs(speed))
        kept.append(kept[-1] + weight * (value - kept[-1]))
    return np.stack(kept)


def filtered(
    hand: HandTrack, chosen: Filter, domain: Domain, fps: float
) -> Float[Tensor, "T 21 3"]:
    """Keypoints of a filtered track in the track's frame, metres; gaps are first interpolated.

    "keypoints": each coordinate is filtered. "parameters": wrist positions and axis-angle vectors
    are filtered, then forward kinematics of the input's skeleton keep the bone lengths; the track
    needs pose parameters.
    """
    filled = fill_gaps(hand)
    assert filled.joints is not None, "the filters need keypoints"
    if domain == "keypoints":
        return smooth(filled.joints, chosen, fps)
    assert filled.pose is not None, "the filter on parameters needs a pose"
    offsets = rest_offsets(axis_angle_to_matrix(filled.pose), filled.joints, hand.trust)
    pose = smooth(unwrapped(filled.pose), chosen, fps)
    wrist = smooth(filled.joints[:, 0], chosen, fps)
    offsets = offsets.expand(len(pose), 20, 3)
    return forward_kinematics(axis_angle_to_matrix(pose), wrist, offsets)[0]


def smoothed_centroid(hand: HandTrack, fps: float) -> Float[Tensor, "T 21 3"]:
    """Keypoints moved with the smoothed centroid of the hand; the pose of the hand is unchanged.

    A Gaussian filter acts on the centroid of the keypoints, after gaps were interpolated. Source:
    the smoothing of hands in NVIDIA's video_to_data (`hand_alignment`), with its size.
    """
    joints = fill_gaps(hand).joints
    assert joints is not None, "the filters need keypoints"
    middle = joints.mean(1, keepdim=True)
    return joints + smooth(middle, Filter("gaussian", CENTROID_FRAMES), fps) - middle


def unwrapped(pose: Float[Tensor, "T 16 3"]) -> Float[Tensor, "T 16 3"]:
    """The same rotations, each as the axis-angle vector nearest to that of the previous frame.

    Otherwise the vector jumps to the opposite axis at an angle of pi, and a filter smears the jump.
    """
    kept = [pose[0]]
    for now in pose[1:]:
        angle = now.norm(dim=-1, keepdim=True)
        axis = now / angle.clamp(min=1e-6)
        turns = ((kept[-1] * axis).sum(-1, keepdim=True) - angle) / (2 * math.pi)
        kept.append((angle + 2 * math.pi * turns.round()) * axis)
    return torch.stack(kept)


def domains_of(hand: HandTrack) -> tuple[Domain, ...]:
    """The domains in which a track can be filtered; "parameters" needs pose parameters."""
    return ("keypoints",) if hand.pose is None else ("keypoints", "parameters")


def best_filtered(
    hand: HandTrack, truth: Float[Tensor, "T 21 3"], domain: Domain, fps: float
) -> Float[Tensor, "T 21 3"]:
    """Keypoints filtered by the filter of `GRID` whose result is nearest to the ground truth."""
    return _nearest(tried(hand, domain, fps), truth)


def best_filtered_and_moved(
    hand: HandTrack, truth: Float[Tensor, "T 21 3"], fps: float
) -> Float[Tensor, "T 21 3"]:
    """Like `best_filtered` over all domains, with each result moved by its `best_offset`."""
    made = (joints for domain in domains_of(hand) for joints in tried(hand, domain, fps))
    return _nearest((joints + best_offset(joints, truth) for joints in made), truth)


def tried(hand: HandTrack, domain: Domain, fps: float) -> Iterator[Float[Tensor, "T 21 3"]]:
    """Keypoints filtered by every filter of `GRID`."""
    return (filtered(hand, chosen, domain, fps) for sizes in GRID.values() for chosen in sizes)


def _nearest(
    made: Iterable[Float[Tensor, "T 21 3"]], truth: Float[Tensor, "T 21 3"]
) -> Float[Tensor, "T 21 3"]:
    """The candidate with the smallest mean keypoint distance to the ground truth."""
    return min(made, key=lambda joints: float((joints - truth).norm(dim=-1).mean()))


def best_offset(
    joints: Float[Tensor, "T 21 3"], truth: Float[Tensor, "T 21 3"]
) -> Float[Tensor, " 3"]:
    """The translation that minimises the mean keypoint distance, metres.

    It is the geometric median of all errors, by Weiszfeld's algorithm (1937) from their mean, whose
    iterations never increase the distance.
    """
    errors = (truth - joints).flatten(0, 1)
    offset = errors.mean(0)
    for _ in range(OFFSET_STEPS):
        weights = 1 / (errors - offset).norm(dim=-1, keepdim=True).clamp(min=1e-6)
        offset = (weights * errors).sum(0) / weights.sum()
    return offset
