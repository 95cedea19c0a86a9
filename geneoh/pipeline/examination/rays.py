"""Estimate an unknown camera ray from the direction of a hand's jitter.

Depth is the least certain coordinate in an image, so the estimated hand jitters more along the
camera ray than across it. A direction of significantly larger jitter is taken for the ray, along
which SpatialDiff also expects the constant errors.
"""

from dataclasses import dataclass, replace
from math import comb, sqrt

import torch
from jaxtyping import Bool, Float, Float64
from torch import Tensor

from geneoh.choices import Side
from geneoh.pipeline.presets import Preset
from geneoh.sequence.gaps import filled_keypoints, palm_points
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

LEAST_FRAMES = 20
"""Least number of differences from which a direction is estimated."""
LEAST_JITTER = 0.001
"""Least jitter along the ray, metres. Below 30 frames a second motion looks like jitter, in
proportion to the square of the time between frames, and the bound is scaled by that."""
CHANCE = 12.0
"""With N differences, the variance along the ray must be at least `1 + CHANCE / sqrt(N)` times the
next one. Isotropic noise of the position exceeds this bound in one of 500 tracks of 120 frames,
noise of position, rotation and fingers in one of fifty."""
FOURTH_SHARE = 0.7
"""Share of that excess over 1 that fourth differences must show too."""
ALIKE = 0.9
"""Least cosine between directions that count as the same."""
MOST_COUNTED = 600
"""Number of differences beyond which the bound stays constant, at a variance ratio of 1.49 or a
ratio of standard deviations of 1.22. Synthetic clips have 1.6 to 2.4 under camera noise; isotropic
noise together with the anisotropic motion of hands has 1.1."""
WHITE = 0.7
"""Least ratio of the jitter in fourth to that in second differences: for motion it is lower."""
FREEDOM, ITERATIONS = 4.0, 30
"""Degrees of freedom of Student's t, which weights outliers down, and iterations of its fit."""
NORMAL_MEDIAN = 0.6745
"""Median absolute value of a standard normal variable."""


@dataclass(frozen=True)
class FoundRay:
    """The direction along which a hand jitters most."""

    direction: Float[Tensor, " 3"]
    """Unit vector, world frame; its sign is arbitrary."""
    times: float
    """Ratio of the jitter along it to that along the next principal direction."""

    def sentence(self, side: Side) -> str:
        """Sentence for the user."""
        x, y, z = self.direction.tolist()
        return (
            f"the {side} hand jitters {self.times:.1f} times as much along ({x:.2f}, {y:.2f}, "
            f"{z:.2f}) as across it, which was taken for the ray of the camera that it was "
            "estimated from; --camera says where the camera is"
        )


@dataclass(frozen=True)
class Jitter:
    """How one place of a hand jitters, by second and fourth differences."""

    second: Float64[Tensor, " 3"]
    fourth: Float64[Tensor, " 3"]
    """Unit vectors of the largest variance, world frame."""
    ratio: float
    """Ratio of that variance of the second differences to the next one."""
    certain: float
    """The excess over 1 of the ratio that both orders show; 0 for jitter that is small enough to be
    rounding or not white enough to be no motion."""


def found_ray(hand: HandTrack, motion: ObjectTrack, fps: float) -> FoundRay | None:
    """The camera ray estimated from a hand's jitter, constant over frames; None if not significant.

    An error along the ray moves the whole palm: wrist, knuckles and their middle must jitter most
    along the same direction, unlike under noise of the rotation. So must fourth differences, unlike
    those of a hand that moves fast to and fro. The ray is measured at the place that shows it most:
    noise of the rotation jitters least about the point that a tracker turns the hand about.
    """
    points, known = palm_points(filled_keypoints(hand), hand.trust > 0)
    least = LEAST_JITTER * max(1.0, 30 / fps) ** 2
    found = []
    for place in (points.mean(1), points[:, 0], points[:, 1:].mean(1)):
        second, fourth = jitter_of(place, known, motion)
        if len(fourth) < LEAST_FRAMES:
            return None
        found.append(measured_jitter(second, fourth, least))
    best = max(found, key=lambda jitter: jitter.certain)
    directions = torch.stack([axis for jitter in found for axis in (jitter.second, jitter.fourth)])
    alike = bool(((directions @ best.second).abs() > ALIKE).all())
    if not alike or best.certain < CHANCE / sqrt(min(len(second), MOST_COUNTED)):
        return None
    return FoundRay(best.second.to(points), sqrt(best.ratio))


def measured_jitter(
    second: Float64[Tensor, "N 3"], fourth: Float64[Tensor, "M 3"], least: float
) -> Jitter:
    """The jitter of a place by its differences; noise is at least as large as `least`, metres."""
    (axis, ratio), (axis_of_fourth, ratio_of_fourth) = strongest(second), strongest(fourth)
    jitter, white = (
        float((values @ axis).abs().median()) / NORMAL_MEDIAN for values in (second, fourth)
    )
    is_noise = white >= max(least, WHITE * jitter)
    excess = min(ratio - 1, (ratio_of_fourth - 1) / FOURTH_SHARE)
    return Jitter(axis, axis_of_fourth, ratio, excess if is_noise else 0.0)


def jitter_of(
    places: Float[Tensor, "T 3"], known: Bool[Tensor, " T"], motion: ObjectTrack
) -> tuple[Float64[Tensor, "N 3"], Float64[Tensor, "M 3"]]:
    """Second and fourth differences of a place of the hand over its known frames, see `bends`, in
    the frame in which it moves least, the world or an object part: the motion of a hand with its
    object is not noise."""
    views = [(bends(places, known, 2), bends(places, known, 4))]
    for part in motion.seen_parts:
        seen = motion.seen_from(part, places[:, None])[:, 0]
        turns = motion.rotation[:, part]
        views.append((bends(seen, known, 2, turns), bends(seen, known, 4, turns)))
    return min(views, key=lambda view: float(view[0].norm(dim=-1).nanmedian()))


def strongest(jitter: Float64[Tensor, "N 3"]) -> tuple[Float64[Tensor, " 3"], float]:
    """The direction of largest variance, and its ratio to the second largest one."""
    variance, axes = torch.linalg.eigh(scatter(jitter))
    return axes[:, -1], float(variance[-1] / variance[-2])


def with_found_rays(sequence: Sequence, chosen: Preset) -> tuple[Sequence, list[str]]:
    """The sequence with the camera rays that the stages get, and sentences for the user.

    The object of `sequence` must have its cleaned poses.
    """
    hands, notes = list(sequence.hands), []
    for index, hand in enumerate(hands):
        ray = hand.camera_ray if chosen.camera_told else None
        if ray is None and chosen.camera_found and chosen.has_object:
            found = found_ray(hand, sequence.object, sequence.fps)
            if found is not None:
                ray = found.direction.expand(hand.frames, 3)
                notes.append(found.sentence(hand.side))
        hands[index] = replace(hand, camera_ray=ray)
    return replace(sequence, hands=tuple(hands)), notes


def bends(
    places: Float[Tensor, "T 3"],
    known: Bool[Tensor, " T"],
    order: int,
    turns: Float[Tensor, "T 3 3"] | None = None,
) -> Float64[Tensor, "N 3"]:
    """Temporal differences of an order over known frames, scaled to keep the standard deviation of
    white noise; rotated to world axes by `turns`, the rotation of the frame of `places`.
    """
    if len(places) <= order:
        return places.new_zeros(0, 3).double()
    change = places.double().diff(n=order, dim=0)
    if turns is not None:
        middle = turns[order // 2 : order // 2 + len(change)].double()
        change = (middle @ change[..., None])[..., 0]
    return change[known.unfold(0, order + 1, 1).all(-1)] / sqrt(comb(2 * order, order))


def scatter(values: Float64[Tensor, "N 3"]) -> Float64[Tensor, "3 3"]:
    """Robust covariance: the scatter matrix of Student's t with mean zero.

    Fixed-point iteration (Kent and Tyler 1991).
    """
    identity = torch.eye(3).to(values)
    found = identity * values.square().mean().clamp(min=1e-12)
    for _ in range(ITERATIONS):
        away = (values * torch.linalg.solve(found, values.mT).mT).sum(-1)
        weight = (FREEDOM + 3) / (FREEDOM + away)
        found = (weight[:, None] * values).mT @ values / len(values)
        found = found + identity * (1e-9 * found.trace() + 1e-15)  # invertible for points on a line
    return found
