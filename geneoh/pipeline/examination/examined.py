"""Hands and object as the stages are to see them: without noise of the object's track, and without
a filter that one of hand and object went through."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.objects.cleaning import clean_object
from geneoh.objects.evidence import evidence_of_poses
from geneoh.objects.examination import ObjectExamination
from geneoh.objects.palms import palm_of
from geneoh.objects.sharpening import sharpened
from geneoh.readers.checks.delay import hand_delay
from geneoh.sequence.repeats import without_repeats
from geneoh.sequence.sequence import HandTrack, ObjectTrack


@dataclass(frozen=True)
class Examined:
    """Hands and object, and how far the object is relied on."""

    hands: tuple[HandTrack, ...]
    object: ObjectTrack
    relied: Float[Tensor, "T Q"]
    """How far the poses of the seen parts are relied on, 0 to 1; of an object that is trusted one
    column for all parts."""
    undone: tuple[HandTrack, ...] = ()
    """The hands in which a filter was undone, as they were given."""
    examination: ObjectExamination | None = None  # None for an object that is trusted
    notes: tuple[str, ...] = ()

    @property
    def met(self) -> ObjectTrack:
        """The object without parts that were never seen: they stand at the origin, where a hand
        must not meet them."""
        return self.object.of_parts(self.object.seen_parts) if self.object.meshes else self.object


def trusted(hands: tuple[HandTrack, ...], motion: ObjectTrack) -> Examined:
    """Hands and object as they were given."""
    return Examined(hands, motion, torch.ones(len(motion.rotation), 1))


def examined(hands: tuple[HandTrack, ...], motion: ObjectTrack, fps: float) -> Examined:
    """Hands and object after the object's track was looked at, and cleaned where it is noisy."""
    palms = tuple(map(palm_of, hands))
    motion, repeated = without_repeats(motion)
    motion, examination = clean_object(motion, fps, palms)
    delays = tuple(hand_delay(hand, motion, fps) for hand in hands)
    sharp = sharpened(hands, palms, delays, motion, examination, fps)
    relied = evidence_of_poses(examination, sharp.object, fps, sharp.off)
    return Examined(
        hands=sharp.hands,
        object=sharp.object,
        relied=relied[:, sharp.object.seen_parts],
        undone=tuple(h for h, new in zip(hands, sharp.hands, strict=True) if new is not h),
        examination=examination,
        notes=(*repeated, *examination.sentences(), *sharp.notes),
    )
