"""The ray of a camera that nobody told, from the noise of the hand that was seen along it.

An image tells depth worst, so the estimated place of a hand jitters more along the ray of the
camera than across it. Where it clearly does, that direction is taken for the ray: along it are the
errors that last, which no jitter shows and which SpatialDiff looks for.
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
"""Number of differences below which they tell no direction."""
LEAST_JITTER = 0.001
"""Jitter along the ray below which nothing is told, metres. At fewer than 30 frames a second motion
looks like jitter, with the square of the time between frames, and the bound grows with that."""
CHANCE = 10.0
"""Of N differences, the variance along the ray is at least `1 + CHANCE / sqrt(N)` times the next
one. Noise that is alike in all directions exceeds that in one of fifty tracks of 120 frames."""
MOST_COUNTED = 600
"""Differences beyond which more of them do not lower that bound. It is 1.41 then, 1.19 times as
much along the ray as across it, where made clips have 1.6 to 2.4 under the noise of a camera. The
motion of a hand, which is not alike in all directions either, makes 1.1 of noise that is."""
WHITE = 0.7
"""Share of the jitter by second differences that fourth ones show at least: of motion they show
less."""
FREEDOM, ITERATIONS = 4.0, 30
"""Degrees of freedom of Student's t, so that outliers count little, and iterations of its fit."""
NORMAL_MEDIAN = 0.6745
"""Median size of a standard normal number."""


@dataclass(frozen=True)
class FoundRay:
    """The direction along which a hand jitters most."""

    direction: Float[Tensor, " 3"]
    """Unit vector, world. Whether it leads to the camera or away from it is not known."""
    times: float
    """How many times as much the hand jitters along it as along the next direction."""

    def sentence(self, side: Side) -> str:
        """What a user should know of it."""
        x, y, z = self.direction.tolist()
        return (
            f"the {side} hand jitters {self.times:.1f} times as much along ({x:.2f}, {y:.2f}, "
            f"{z:.2f}) as across it, which was taken for the ray of the camera that it was "
            "estimated from; --camera says where the camera is"
        )


def found_ray(hand: HandTrack, motion: ObjectTrack, fps: float) -> FoundRay | None:
    """The ray of the camera that saw a hand, the same in all frames; None where noise tells none.

    The palm is seen from where it moves least, which is the world or a part of the object, so that
    the motion of a hand with its object is not taken for noise.
    """
    points, known = palm_points(filled_keypoints(hand), hand.trust > 0)
    middle = points.mean(1)
    views = [(bends(middle, known, 2), bends(middle, known, 4))]
    for part in motion.seen_parts:
        seen = motion.seen_from(part, middle[:, None])[:, 0]
        turns = motion.rotation[:, part]
        views.append((bends(seen, known, 2, turns), bends(seen, known, 4, turns)))
    second, fourth = min(views, key=lambda view: float(view[0].norm(dim=-1).nanmedian()))
    if len(fourth) < LEAST_FRAMES:
        return None
    variance, axes = torch.linalg.eigh(scatter(second))
    direction, ratio = axes[:, -1], float(variance[-1] / variance[-2])
    jitter = float((second @ direction).abs().median()) / NORMAL_MEDIAN
    white = float((fourth @ direction).abs().median()) / NORMAL_MEDIAN
    least = LEAST_JITTER * max(1.0, 30 / fps) ** 2
    told = 1 + CHANCE / sqrt(min(len(second), MOST_COUNTED))
    if ratio < told or white < max(least, WHITE * jitter):
        return None
    return FoundRay(direction.to(middle), sqrt(ratio))


def with_found_rays(sequence: Sequence, chosen: Preset) -> tuple[Sequence, list[str]]:
    """The sequence with the rays that the stages are shown, and what a user should know of them.

    The poses of its object are those that the stages see.
    """
    hands, said = list(sequence.hands), []
    for index, hand in enumerate(hands):
        ray = hand.camera_ray if chosen.camera_told else None
        if ray is None and chosen.camera_found and chosen.has_object:
            found = found_ray(hand, sequence.object, sequence.fps)
            if found is not None:
                ray = found.direction.expand(hand.frames, 3)
                said.append(found.sentence(hand.side))
        hands[index] = replace(hand, camera_ray=ray)
    return replace(sequence, hands=tuple(hands)), said


def bends(
    places: Float[Tensor, "T 3"],
    known: Bool[Tensor, " T"],
    order: int,
    turns: Float[Tensor, "T 3 3"] | None = None,
) -> Float64[Tensor, "N 3"]:
    """Differences of an order between frames that are all known, in units in which white noise
    keeps its deviation; turned to the world by the rotation of the frame that they are seen from.
    """
    if len(places) <= order:
        return places.new_zeros(0, 3).double()
    change = places.double().diff(n=order, dim=0)
    if turns is not None:
        middle = turns[order // 2 : order // 2 + len(change)].double()
        change = (middle @ change[..., None])[..., 0]
    return change[known.unfold(0, order + 1, 1).all(-1)] / sqrt(comb(2 * order, order))


def scatter(values: Float64[Tensor, "N 3"]) -> Float64[Tensor, "3 3"]:
    """The scatter of Student's t around zero: a covariance to which outliers count little.

    By fixed-point iteration (Kent and Tyler 1991).
    """
    identity = torch.eye(3).to(values)
    found = identity * values.square().mean().clamp(min=1e-12)
    for _ in range(ITERATIONS):
        away = (values * torch.linalg.solve(found, values.mT).mT).sum(-1)
        weight = (FREEDOM + 3) / (FREEDOM + away)
        found = (weight[:, None] * values).mT @ values / len(values)
        found = found + identity * (1e-9 * found.trace() + 1e-15)  # a line has a scatter too
    return found
