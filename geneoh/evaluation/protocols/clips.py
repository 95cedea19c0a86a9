"""Clips of one hand and its object: cut out of recordings, found again by name, filtered."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from scipy.spatial import KDTree

from geneoh.choices import Side
from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.hand.library import load_hand
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, runs
from geneoh.readers.builders import part_of
from geneoh.readers.recordings import read_clip, source_named
from geneoh.readers.records import Array
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

REACH = 0.15
"""Metres from the wrist to the nearest object point, beyond which a hand is not at the object."""
SEEN = 0.5
"""Share of a clip's frames in which its hand must have been observed."""


@runtime_checkable
class ClipSource(Protocol):
    """Where a clip comes from: cheap to hold and to send to a worker, read when it is needed."""

    @property
    def name(self) -> str:
        """What the clip is called in every table."""
        ...

    def read(self) -> Sequence:
        """The clip: one hand, with keypoints, and its object."""
        ...


@dataclass(frozen=True)
class Excerpt:
    """Frames of one hand in a recording of a data set on disk."""

    source: str
    clip: SourceClip
    recording: str
    side: Side
    start: int
    stop: int
    step: int
    known: ReaderOptions

    @property
    def name(self) -> str:
        """Recording, side and first frame."""
        return f"{self.recording}_{self.side}_{self.start:05d}"

    def read(self) -> Sequence:
        """The frames, from the data set's own files."""
        found = recordings_of(self.source, self.clip, self.known)
        (whole,) = (recording for recording in found if recording.name == self.recording)
        return excerpt(whole.sequence, self.side, slice(self.start, self.stop, self.step))


@lru_cache(maxsize=2)
def recordings_of(source: str, clip: SourceClip, known: ReaderOptions) -> tuple[Recording, ...]:
    """What one file of a data set holds; the last ones are kept, as neighbours are asked next."""
    return tuple(read_clip(source_named(source), clip, known))


def excerpt(sequence: Sequence, side: Side, span: slice) -> Sequence:
    """One hand with keypoints and its object, in the frames of a slice."""
    cut = part_of(replace(sequence, hands=(sequence.hand(side),)), span)
    return with_keypoints(replace(cut, fps=sequence.fps / (span.step or 1)))


def with_keypoints(sequence: Sequence) -> Sequence:
    """The sequence itself, or with the keypoints of our hand where a source cannot give them."""
    (hand,) = sequence.hands
    if hand.joints is not None:
        return sequence
    filled = fill_gaps(hand)
    assert filled.pose is not None, "a track without joints has a pose"
    assert filled.wrist is not None, "a pose comes with a wrist"
    shaped = load_hand(hand.side).shaped(torch.zeros(10))
    joints = shaped.posed(filled.pose, filled.wrist).joints
    joints = torch.where(hand.valid[:, None, None], joints, torch.nan)
    note = "keypoints of geneoh's mean hand in the recorded pose; pass --mano for the person's own"
    hands = (replace(hand, joints=joints),)
    return replace(sequence, hands=hands, source=f"{sequence.source} ({note})")


def excerpts(
    source: str,
    clip: SourceClip,
    recording: Recording,
    side: Side,
    kept: Array,
    options: ProtocolOptions,
) -> list[Excerpt]:
    """The clips of one hand: windows within each run of frames that are kept.

    Args:
        source: name of the reader.
        clip: the file.
        recording: one of what it holds.
        side: which hand.
        kept: (T,) bool, frames of the recording that the protocol keeps.
        options: windows, and how long and how far apart they are.
    """
    step = max(1, round(recording.sequence.fps / RATE[source]))
    valid = recording.sequence.hand(side).valid.numpy()[::step]
    found = []
    for span in runs(kept[::step]):
        for start, stop in windows_of(span.stop - span.start, options):
            first, last = span.start + start, span.start + stop
            if valid[first:last].mean() >= SEEN:
                name = recording.name
                ends = (first * step, (last - 1) * step + 1)
                found.append(Excerpt(source, clip, name, side, *ends, step, options.known))
    return found


RATE = {"grab": 30.0, "hoi4d": 15.0, "arctic": 30.0, "taco": 30.0}
"""Frames a second at which a protocol counts its frames; faster recordings are thinned out."""


def windows_of(frames: int, options: ProtocolOptions) -> Iterator[tuple[int, int]]:
    """First and last frame (exclusive) of the windows in a run; none in one too short for any."""
    if frames < options.frames:
        return
    if options.windows == "whole":
        yield 0, frames
        return
    for start in range(0, frames - options.frames + 1, options.stride):
        yield start, start + options.frames
        if options.windows == "first":
            return


def offset_of(recording: Recording, clip: SourceClip) -> int:
    """The frame of the file at which a recording starts, by its name."""
    return int(recording.name.removeprefix(clip.name)[1:] or 0)


def wrist_to_object(hand: HandTrack, motion: ObjectTrack) -> Array:
    """(T,) metres from the wrist to the nearest vertex of the object; NaN where there is no hand.

    Source: TOCH takes the middle of the mesh's rim at the wrist, GeneOH Diffusion (C.1) says wrist;
    here it is the wrist joint, which needs no mesh of the hand.
    """
    wrist = hand.wrist if hand.joints is None else hand.joints[:, 0]
    assert wrist is not None, "a hand without joints has a wrist"
    gaps = []
    for part, mesh in enumerate(motion.meshes):
        local = wrist - motion.translation[:, part]
        local = (motion.rotation[:, part].mT @ local[..., None])[..., 0].double().numpy()
        gap = np.full(len(local), np.nan)
        seen = np.isfinite(local).all(-1)
        gap[seen] = KDTree(mesh.verts.double().numpy()).query(local[seen])[0]
        gaps.append(gap)
    return np.asarray(np.min(gaps, axis=0))
