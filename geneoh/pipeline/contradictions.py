"""Notes on hands and objects that contradict each other for as long as the clip lasts.

Networks trained with noise around the truth move the hand until it fits the object. If the mesh or
the poses of the object are lastingly wrong, this makes the hand wrong as well, and its jitter does
not explain the change.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter1d
from torch import Tensor

from geneoh.metrics.contact import TOUCH
from geneoh.objects.smoothing import noise_level
from geneoh.sequence.keypoints import PALM

FEWEST = 20
"""Observed frames of contact from which a note is given: fewer do not show what lasts."""
DEEP, USUALLY, REMAINS = 0.01, 0.75, 0.002
"""A mesh is doubted where fingers are deeper than `DEEP` metres, as no soft skin is, in the share
`USUALLY` of the frames of contact, and `REMAINS` metres deep in the median of these frames after
cleaning. Most hands that are off themselves are moved out: with lasting errors of the hand 0.5 to
2.6 mm remain in synthetic clips, with convex hulls, boxes and shifted meshes 2.0 to 4.7."""
CALM = 0.007
"""Largest jitter of a palm, metres, for such a doubt: noisier fingers get deep by chance."""
FAR, TIMES, QUANTILE = 0.015, 3.0, 0.9
"""The shift of a hand is reported if it is larger than `FAR` metres and `TIMES` the jitter of its
palm, in the `QUANTILE` over frames. White noise of up to 18 mm makes it 6 mm at most."""
SMOOTHED, LASTING = 9, 31
"""Frames over which depths are averaged against jitter, and shifts to find what lasts a second."""


@dataclass(frozen=True)
class HandAtObject:
    """One hand over T frames at 30 frames a second, before or after cleaning."""

    joints: Float[Tensor, "T 21 3"]  # metres
    fingers: Float[Tensor, "T 5"]  # signed distance of each finger to the object, metres

    @property
    def palm(self) -> Float[np.ndarray, "T 3"]:
        """The middle of the palm, metres."""
        return self.joints[:, list(PALM)].mean(1).double().cpu().numpy()

    @property
    def distance(self) -> Float[np.ndarray, " T"]:
        """Signed distance of the deepest or nearest finger without its jitter, metres."""
        return uniform_filter1d(self.fingers.cpu().numpy(), SMOOTHED, axis=0).min(1)


def contradictions(
    before: HandAtObject,
    after: HandAtObject,
    observed: Bool[Tensor, " T"],
    evidence: Float[Tensor, " T"],
) -> Iterator[str]:
    """Sentences for the user where a hand contradicts its object; only frames that are `observed`
    and were cleaned against the object, by their `evidence`, count."""
    counted = (observed & (evidence > 0.5)).cpu().numpy()
    if counted.sum() < FEWEST:
        return
    jitter = noise_level(before.palm, observed.cpu().numpy())
    yield from too_large_meshes(before.distance, after.distance, counted, jitter)
    yield from lasting_shifts(before.palm, after.palm, counted, jitter)


def too_large_meshes(
    before: Float[np.ndarray, " T"],
    after: Float[np.ndarray, " T"],
    counted: Bool[np.ndarray, " T"],
    jitter: float,
) -> Iterator[str]:
    """A sentence if the fingers of a calm hand are lastingly inside of the object; distances and
    jitter are in metres."""
    touching = counted & (before <= TOUCH)
    if touching.sum() < FEWEST or jitter > CALM:
        return
    share, left = float((before[touching] < -DEEP).mean()), float(np.median(-after[touching]))
    if share >= USUALLY and left > REMAINS:
        yield (
            f"fingers are {1000 * float(np.median(-before[touching])):.0f} mm deep in the object "
            f"while they touch it, and {1000 * left:.0f} mm after cleaning, though the hand "
            f"jitters by {1000 * jitter:.0f} mm only: the mesh may be larger than the object, as a "
            "convex hull, a box or a mesh of another scale, or mesh, poses or hand may be off "
            "their place; give the mesh of the object itself, or none"
        )


def lasting_shift(
    before: Float[np.ndarray, "T 3"],
    after: Float[np.ndarray, "T 3"],
    counted: Bool[np.ndarray, " T"],
) -> float:
    """How far a palm was moved for a second or longer, metres."""
    shift = np.linalg.norm(uniform_filter1d(after - before, LASTING, axis=0), axis=1)
    return float(np.quantile(shift[counted], QUANTILE))


def lasting_shifts(
    before: Float[np.ndarray, "T 3"],
    after: Float[np.ndarray, "T 3"],
    counted: Bool[np.ndarray, " T"],
    jitter: float,
) -> Iterator[str]:
    """A sentence if a palm was moved for long by more than its jitter explains, in metres."""
    largest = lasting_shift(before, after, counted)
    if largest > max(FAR, TIMES * jitter):
        yield (
            f"the hand was moved by {1000 * largest:.0f} mm for a second or longer to fit the "
            f"object, which its jitter of {1000 * jitter:.0f} mm does not explain: the hand, or "
            "the poses or the mesh of the object, are off their place; without a mesh (no --obj) "
            "the hand is cleaned alone and keeps its place"
        )
