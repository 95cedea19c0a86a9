"""Check the first frames of a stream once, as whole files are checked."""

import re
from dataclasses import replace

from geneoh.bundle import concatenated
from geneoh.errors import InputError, numbered
from geneoh.geometry.mesh import Mesh
from geneoh.pipeline.examination.faults import without_faults_of
from geneoh.pipeline.observed import Observed, lost_like
from geneoh.readers.checks.convention import doubts
from geneoh.readers.checks.hands import refuse_other_order
from geneoh.readers.checks.holding import POSES_REACH
from geneoh.sequence.distance_check import check_distance, least_distance
from geneoh.sequence.gaps import fill_object, without_placeholders
from geneoh.sequence.repeats import repeat_notes, repeated_poses
from geneoh.sequence.sequence import HandTrack, Sequence

SECONDS = 2.0  # checked duration from the first frame with the hand; delay estimation needs it
ORDER_FRAMES = 10  # frames with the hand from which the keypoint order can be determined
ORDER = "give them in OpenPose order"
"""Remedy for another keypoint order, for which a stream has no option."""
REPEATED = "as of a sensor that is slower than the hand's; give no pose in these frames"
"""Remedy for repeated poses: a stream cannot know how many follow."""


class FirstLook:
    """Buffers the first frames of one stream until they are checked."""

    def __init__(self, meshes: tuple[Mesh, ...], fps: float) -> None:
        """Begin without frames; `meshes` are those of the object."""
        self._meshes, self._fps = meshes, fps
        self._frames: list[Observed] = []
        self._done = False

    def push(self, seen: Observed, where: str) -> tuple[str, ...]:
        """Take an input frame; the last of the first `SECONDS` returns the doubts, others nothing.

        `where` names the frame in messages.

        Raises:
            InputError: the frames cannot be an interaction; this frame is then not taken.
        """
        if self._done or not (self._frames or seen.hand):
            return ()
        frames = [*self._frames, seen]
        if seen.hand and sum(frame.hand is not None for frame in frames) == ORDER_FRAMES:
            refuse_other_order(_hand_of(frames), where, ORDER)
        if len(frames) < round(SECONDS * self._fps):
            self._frames = frames
            return ()
        return self._looked(frames, where)

    def end(self, where: str) -> tuple[str, ...]:
        """The doubts if the stream ends before `SECONDS`; raises `InputError` as `push` does."""
        return self._looked(self._frames, where) if self._frames else ()

    def _looked(self, frames: list[Observed], where: str) -> tuple[str, ...]:
        found = self._doubts(frames, where)
        self._frames, self._done = [], True
        return found

    def _doubts(self, frames: list[Observed], where: str) -> tuple[str, ...]:
        """Doubts about some frames, as if they were a file."""
        motion = concatenated([frame.object for frame in frames])
        motion = fill_object(replace(motion, meshes=self._meshes))
        hand = without_placeholders(_hand_of(frames))
        hand, lost = without_faults_of(hand, self._fps, motion)
        refuse_other_order(hand, where, ORDER)
        try:
            # a hand may approach the object later, but not from farther than this
            if least_distance(hand, motion) > POSES_REACH:
                check_distance(hand, motion, where)
            found = (*lost, *doubts(Sequence((hand,), motion, self._fps), where))
            found += tuple(repeat_notes(motion, repeated_poses(motion), REPEATED))
        except InputError as error:
            raise InputError(without_options(str(error))) from None
        if self._meshes and not motion.is_seen:
            found += (
                f"no pose of the object in the first {numbered(len(frames), 'frame')}: the "
                f"{hand.side} hand is cleaned by the prior of hand motion alone, and nothing is "
                "known of contact; give the object's poses",
            )
        return tuple(map(without_options, found))


def _hand_of(frames: list[Observed]) -> HandTrack:
    """The hand of some frames as a track; at least one frame has the hand."""
    lost = lost_like(next(frame.hand for frame in frames if frame.hand is not None))
    return concatenated([frame.hand or lost for frame in frames])


def without_options(words: str) -> str:
    """A sentence without command-line options in brackets, which a stream does not have."""
    return re.sub(r" \(--[^)]*\)", "", words)
