"""Scores of hands on bodies: by the encoder's features, and by the motion of the fingers."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import BODY_JOINTS
from geneoh.evaluation.generation.scores import ClipFeatures
from geneoh.evaluation.gestures.encoder import POOL, GestureEncoder, Seen
from geneoh.evaluation.scores import Measure
from geneoh.generators.both2hands.limits import ALLOWED, FingerRange
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.metrics.features import diversity, frechet_distance, multimodality, retrieval
from geneoh.metrics.smoothness import acceleration, in_mm_per_frame_squared
from geneoh.synthesis.actions.action import FPS
from geneoh.synthesis.gestures.clips import Gestures

MEASURES = (
    Measure("top1", "R@1", "%", "more", f"sentences that find their clip among {POOL}"),
    Measure("top2", "R@2", "%", "more", "the same among the best 2"),
    Measure("top3", "R@3", "%", "more", "the same among the best 3"),
    Measure("fid", "FID", "", "less", "Fréchet distance of the features to those of real clips", 3),
    Measure("mm_distance", "MM-dist.", "", "less", "mean distance of a sentence to its clip", 2),
    Measure("diversity", "div.", "", "as real", "mean distance of 200 random pairs of features", 2),
    Measure(
        "multimodality", "MMod.", "", "more", "the same of pairs with one body and sentence", 2
    ),
    Measure(
        "acceleration_mm", "accel.", "mm/f²", "as real", "mean acceleration of finger joints", 2
    ),
    Measure("beyond", "beyond", "%", "less", "finger joints beyond the range of training", 2),
)


def range_of(clips: Gestures) -> FingerRange:
    """The range of the finger joint rotations over all clips."""
    fingers = clips.pose[:, :, BODY_JOINTS:]
    return FingerRange(fingers.amin((0, 1)), fingers.amax((0, 1)))


def share_beyond(
    fingers: FingerRange, motion: BodyMotion, counted: Bool[Tensor, "B T"]
) -> Float[Tensor, " B"]:
    """Share of finger joints, in the counted frames, beyond a range by more than `ALLOWED`."""
    turned = matrix_to_axis_angle(motion.rotations[:, :, BODY_JOINTS:])
    return mean_of_counted((fingers.beyond(turned) > ALLOWED).float().mean(2), counted)


def mean_of_counted(
    values: Float[Tensor, "B T"], counted: Bool[Tensor, "B T"]
) -> Float[Tensor, " B"]:
    """Mean over the counted frames of each clip; zero if there are none."""
    return (values * counted).sum(1) / counted.sum(1).clamp(min=1)


@dataclass(frozen=True)
class ScoredHands(ClipFeatures):
    """Features and measures of B clips of a row."""

    texts: Float[Tensor, "B F"]  # features of the sentence of the condition
    acceleration_mm: Float[Tensor, " B"]  # of finger joints, millimetres per frame squared
    beyond: Float[Tensor, " B"]  # `share_beyond`
    several: Float[Tensor, "P S F"]  # features of S samples for each of P conditions


def score_hands(
    model: GestureEncoder,
    real: Gestures,
    motion: BodyMotion,
    texts: Float[Tensor, "B F"],
    fingers: FingerRange,
    several: Float[Tensor, "P S F"] | None = None,
) -> ScoredHands:
    """Encode and measure every clip of a row; without `several` there is one sample per condition.

    Frames after the end of a real clip are not counted: real hands rest there, others do not.
    """
    joints = pose(real.skeleton, motion).positions[:, :, BODY_JOINTS:]
    moved = in_mm_per_frame_squared(acceleration(joints, FPS), FPS)
    return ScoredHands(
        model.motions(Seen.moved(real, motion)),
        texts,
        mean_of_counted(moved, real.before_end[:, 2:]),  # value t is made of frames up to t + 2
        share_beyond(fingers, motion, real.before_end),
        texts.new_zeros(0, 0, texts.shape[1]) if several is None else several,
    )


Score = Callable[[ScoredHands, ScoredHands, torch.Generator], float]
"""A score as a function of clips, other real clips, and a generator for random pools and pairs."""


def _retrieved(count: int) -> Score:
    return lambda part, _, drawn: (
        100 * retrieval(part.texts, part.features, count, pool=POOL, generator=drawn)
    )


def _several(part: ScoredHands, _: ScoredHands, drawn: torch.Generator) -> float:
    """Multimodality: distance of pairs of samples for one condition; NaN with one sample each.

    It is computed on a random half of the conditions, as the other scores on half of the clips, so
    that the deviation over repetitions reflects the choice of conditions, not only that of pairs.
    """
    count = len(part.several)
    some = part.several[torch.randperm(count, generator=drawn)[: (count + 1) // 2]]
    labels = torch.arange(len(some)).repeat_interleave(some.shape[1])
    return multimodality(some.flatten(0, 1), labels, generator=drawn)


SCORES: dict[str, Score] = {
    "top1": _retrieved(1),
    "top2": _retrieved(2),
    "top3": _retrieved(3),
    "fid": lambda part, other, _: frechet_distance(other.features, part.features),
    "mm_distance": lambda part, _, __: float((part.texts - part.features).norm(dim=-1).mean()),
    "diversity": lambda part, _, drawn: diversity(part.features, generator=drawn),
    "multimodality": _several,
    "acceleration_mm": lambda part, _, __: float(part.acceleration_mm.mean()),
    "beyond": lambda part, _, __: 100 * float(part.beyond.mean()),
}
"""The function of each measure of the table, by its key."""
