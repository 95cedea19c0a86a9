"""Prepare hands and object for the stages: remove noise from the object's track, and undo a
low-pass filter that was applied to only one of hand and object."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from geneoh.objects.cleaning import clean_object
from geneoh.objects.evidence import TOLERATED, TOLERATED_BY_RAY, evidence_of_poses
from geneoh.objects.examination import ObjectExamination
from geneoh.objects.held_in_gaps import held_in_gaps
from geneoh.objects.palms import palm_of
from geneoh.objects.seeming_turns import without_seeming_turns
from geneoh.objects.sharpening import sharpened
from geneoh.objects.stuck import without_stuck_poses
from geneoh.readers.checks.delay import hand_delay
from geneoh.sequence.lines import without_lines
from geneoh.sequence.repeats import without_repeats
from geneoh.sequence.sequence import HandTrack, ObjectTrack


@dataclass(frozen=True)
class Examined:
    """Prepared hands and object, and the reliability of the object's poses."""

    hands: tuple[HandTrack, ...]
    object: ObjectTrack
    relied: Float[Tensor, "T Q"]
    """Reliability, 0 to 1, of the poses of the parts that were ever seen. With a trusted object,
    only frames without a pose lower it."""
    relied_by_ray: Float[Tensor, "T Q"]
    """The same for hands with a known ray from the camera."""
    undone: tuple[HandTrack, ...] = ()
    """The input tracks of the hands in which a filter was undone."""
    examination: ObjectExamination | None = None  # None if the object is trusted
    notes: tuple[str, ...] = ()

    @property
    def met(self) -> ObjectTrack:
        """The object without parts that were never seen: these are at the origin, where a hand must
        not collide with them."""
        return self.object.of_parts(self.object.seen_parts) if self.object.meshes else self.object


def with_missing_poses(
    hands: tuple[HandTrack, ...], motion: ObjectTrack, fps: float
) -> tuple[ObjectTrack, tuple[str, ...]]:
    """The object with those poses missing, and filled, that its tracker did not observe though they
    are not marked, and notes: interpolated or repeated ones, and such that stay behind a palm."""
    motion, lines = without_lines(motion)
    motion, repeated = without_repeats(motion)
    motion, stuck = without_stuck_poses(motion, map(palm_of, hands), fps)
    return motion, (*lines, *repeated, *stuck)


def examined(
    hands: tuple[HandTrack, ...], motion: ObjectTrack, fps: float, refined: bool = False
) -> Examined:
    """Hands and object after examination of the object's track, cleaned where it is noisy.

    `refined` is whether the result has poses of the object that agree with the clean hands."""
    palms = tuple(map(palm_of, hands))
    motion, missing = with_missing_poses(hands, motion, fps)
    motion, turned = without_seeming_turns(motion, palms, fps)
    # before cleaning, lest the ends of a line count as a jump, and after it in what it has cleaned
    cleaned, examination = clean_object(held_in_gaps(motion, palms), fps, palms)
    motion = held_in_gaps(cleaned, palms)
    delays = tuple(hand_delay(hand, motion, fps) for hand in hands)
    sharp = sharpened(hands, palms, delays, motion, examination, fps)
    relied, by_ray = (
        evidence_of_poses(examination, sharp.object, fps, sharp.error, bound)
        for bound in (TOLERATED, TOLERATED_BY_RAY)
    )
    return Examined(
        hands=sharp.hands,
        object=sharp.object,
        relied=relied[:, sharp.object.seen_parts],
        relied_by_ray=by_ray[:, sharp.object.seen_parts],
        undone=tuple(h for h, new in zip(hands, sharp.hands, strict=True) if new is not h),
        examination=examination,
        notes=(*missing, *turned, *examination.sentences(refined), *sharp.notes),
    )
