"""Test clips of one hand and its object, cut out of recordings, and read only when needed."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
import torch
from scipy.spatial import KDTree

from geneoh.choices import Side
from geneoh.errors import GeneOHError
from geneoh.evaluation.options import ProtocolOptions
from geneoh.readers.base import ReaderOptions, Recording, SourceClip
from geneoh.readers.builders import stretch_of
from geneoh.readers.recordings import read_clip, source_named
from geneoh.readers.records import Array
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.keypoints import keypoints_of
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.windows import runs

OBSERVED_SHARE = 0.5  # smallest share of a clip's frames in which its hand must have been observed
FPS = {"grab": 30.0, "hoi4d": 15.0, "arctic": 30.0, "taco": 30.0}
"""Frame rate in which a protocol counts its frames; faster recordings are subsampled to it."""

CUT = re.compile(r"(_(tool|target))?(_\d{5})?_(left|right)_\d{5}$")
"""What `excerpts` and readers add to the name of a recording's file: the object's role in TACO,
first frames, and the side."""


@dataclass(frozen=True)
class Clip:
    """One hand with keypoints and its object over some frames, the unit that is scored."""

    name: str  # name of the clip in every table, with slashes where the data set has folders
    read: Callable[[], Sequence]
    """Reads the clip. It is a `functools.partial` of a module's function, so that a clip is small
    and can be sent to another process."""
    error: GeneOHError | None = None  # why the file cannot be read, for `unreadable_clip`


def unreadable_clip(name: str, error: GeneOHError) -> Clip:
    """A placeholder for a file that cannot be cut into clips; its scores hold the error."""
    return Clip(name, partial(_refuse, error), error)


def _refuse(error: GeneOHError) -> Sequence:
    """Raise the error of an unreadable clip."""
    raise error


@lru_cache(maxsize=2)
def recordings_of(source: str, file: SourceClip, known: ReaderOptions) -> tuple[Recording, ...]:
    """The recordings in one file of a data set, cached because the next clip is often of it too."""
    return tuple(read_clip(source_named(source), file, known))


def excerpts(
    source: str,
    file: SourceClip,
    recording: Recording,
    side: Side,
    kept: Array,
    options: ProtocolOptions,
    without: Array | None = None,
) -> list[Clip]:
    """The clips of one hand of a recording: windows within each run of frames that are kept.

    `kept` and `without` are masks over its frames; windows with any frame of `without` are dropped.
    """
    if side not in [hand.side for hand in recording.sequence.hands]:
        return []
    step = max(1, round(recording.sequence.fps / FPS[source]))
    valid = recording.sequence.hand(side).valid.numpy()
    found = []
    for run in runs(kept[::step]):
        for start, stop in windows_in_run(run.stop - run.start, options):
            first, last = run.start + start, run.start + stop
            span = slice(first * step, (last - 1) * step + 1, step)
            ruled_out = without is not None and without[span].any()
            if not ruled_out and valid[span].mean() >= OBSERVED_SHARE:
                known = options.reader_options
                read = partial(read_excerpt, source, file, recording.name, side, span, known)
                found.append(Clip(f"{recording.name}_{side}_{span.start:05d}", read))
    return found


def recording_of(clip: str) -> str:
    """Name of the recording that a clip was cut out of, because its clips are not independent.

    A clip that was not cut out of a recording counts as one.
    """
    return CUT.sub("", clip)


def windows_in_run(frames: int, options: ProtocolOptions) -> Iterator[tuple[int, int]]:
    """First and last frame (exclusive) of the windows in a run; none if the run is too short."""
    if frames < options.frames:
        return
    if options.windows == "whole":
        yield 0, frames
        return
    for start in range(0, frames - options.frames + 1, options.stride):
        yield start, start + options.frames
        if options.windows == "first":
            return


def read_excerpt(
    source: str, file: SourceClip, recording: str, side: Side, span: slice, known: ReaderOptions
) -> Sequence:
    """Read one hand with keypoints and its object from the files of a data set."""
    found = recordings_of(source, file, known)
    (whole,) = (each.sequence for each in found if each.name == recording)
    cut = stretch_of(replace(whole, hands=(whole.hand(side),)), span)
    return with_keypoints(replace(cut, fps=whole.fps / span.step))


def with_keypoints(sequence: Sequence) -> Sequence:
    """The sequence, with keypoints of geneoh's mean hand if the source has none."""
    (hand,) = sequence.hands
    if hand.joints is not None:
        return sequence
    joints = torch.where(hand.valid[:, None, None], keypoints_of(fill_gaps(hand)), torch.nan)
    note = "keypoints of geneoh's mean hand in the recorded pose; pass --mano for the person's own"
    hands = (replace(hand, joints=joints),)
    return replace(sequence, hands=hands, source=f"{sequence.source} ({note})")


def first_frame(recording: Recording, file: SourceClip) -> int:
    """Frame of the file at which a recording starts, parsed from its name."""
    return int(recording.name.removeprefix(file.name)[1:] or 0)


def wrist_gap(hand: HandTrack, motion: ObjectTrack) -> Array:
    """Distance (T,) from the wrist to the object's nearest vertex, metres; NaN without a hand.

    TOCH measures from the centre of the hand mesh's rim at the wrist. GeneOH Diffusion (C.1) uses
    the wrist joint, which needs no mesh of the hand.
    """
    wrist = hand.wrist if hand.joints is None else hand.joints[:, 0]
    assert wrist is not None, "a hand without joints has a wrist"
    gaps = []
    for part, mesh in enumerate(motion.meshes):
        local = motion.seen_from(part, wrist[:, None])[:, 0].double().numpy()
        gap = np.full(len(local), np.nan)
        seen = np.isfinite(local).all(-1)
        gap[seen] = KDTree(mesh.verts.double().numpy()).query(local[seen])[0]
        gaps.append(gap)
    return np.asarray(np.min(gaps, axis=0))
