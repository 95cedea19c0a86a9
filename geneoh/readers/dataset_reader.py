"""What all readers of data sets do alike: find clips, put sequences together, split recordings.

A source in `geneoh.readers.sources` is a class with the source's units, axes, convention, frame
rate and file names as data, and a method that gives the parts of a clip.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.readers.base import (
    CrossChecks,
    ReaderOptions,
    Recording,
    SourceClip,
    clip_name,
    finite_frames,
    paths_matching,
    runs,
)
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    callers_object,
    mano_track,
    object_track,
    part_of,
    sequence_of,
)
from geneoh.readers.meshes import with_parts
from geneoh.readers.records import Array, Place, Record
from geneoh.sequence.camera import seen_from
from geneoh.sequence.sequence import HandTrack, Sequence


@dataclass(frozen=True)
class ClipParts:
    """Hands and one object as a source has them: what a sequence is made from."""

    source: str
    """The source and its name of the clip, as `Sequence.source` begins."""
    hands: list[ManoParameters] | list[HandTrack]
    """As the source stores them; those that were not observed in any frame are left out."""
    meshes: dict[str, Mesh] = field(default_factory=dict)
    """One mesh in metres for each part of the object, by the name of its file."""
    motion: Array | None = None
    """(T, 4, 4) or (T, Q, 4, 4) object to world in metres, NaN where it is not known; None for a
    source without an object, which takes the caller's."""
    name: str = ""
    """Of the recording, by default the clip's."""
    fps: float | None = None
    """Frames a second, where they are not those of all clips of the source."""
    notes: tuple[str, ...] = ()
    """What had to be assumed, in words."""
    cross_checks: CrossChecks = field(default_factory=CrossChecks)
    object_known: Array | None = None
    """(T,) the frames to keep, by default those in which the motion is known."""
    after_jump: Array | None = None
    """(T,) frames that do not follow in time from the one before them."""
    convention: ManoConvention | None = None
    """How the source uses MANO, where that is not the same in all of its clips."""
    camera: Place | None = None
    """Position of the camera from whose images the hands were estimated, metres, where known."""


class DatasetReader(ABC):
    """The common part of all readers; a subclass is one source."""

    patterns: ClassVar[tuple[str, ...]]
    """Names of the files that make a clip, or of folders, which end in "/"."""
    clip_is_folder: ClassVar[bool] = False
    """Whether the clip is the folder that holds such a file, and not the file."""
    name_parts: ClassVar[int] = 1
    """How many parts of the path a clip's name keeps."""
    fps: ClassVar[float] = 30.0
    fps_assumed: ClassVar[bool] = False
    """Whether the files do not say the frame rate, which is noted then."""
    convention: ClassVar[ManoConvention] = ManoConvention("wrist")
    """How the source uses MANO, where it does."""
    content: ClassVar[str] = "a hand and an object"
    """What every clip must hold, for the message where one does not."""

    def find(self, path: Path) -> list[SourceClip]:
        """Every clip at or below a path."""
        matches = (match for pattern in self.patterns for match in paths_matching(path, pattern))
        return list(dict.fromkeys(self.clip_at(match) for match in matches if self.accepts(match)))

    def accepts(self, match: Path) -> bool:
        """Whether a file or folder with a fitting name is one of this source."""
        return True

    def clip_at(self, match: Path) -> SourceClip:
        """The clip that a file or folder belongs to."""
        path = match.parent if self.clip_is_folder else match
        return SourceClip(clip_name(path, self.name_parts), path)

    @abstractmethod
    def parts(self, clip: SourceClip, options: ReaderOptions) -> Iterable[ClipParts]:
        """The interactions of a clip, each of which becomes one recording or more.

        Raises:
            InputError: a file of it cannot be read; the message names it.
        """

    def read(self, clip: SourceClip, options: ReaderOptions) -> list[Recording]:
        """The recordings of a clip: its parts, cut where the object is not known.

        Raises:
            InputError: a file of it cannot be read; the message names it.
            MissingAssetError: it needs a file that the user must supply.
        """
        found = [
            recording
            for parts in self.parts(clip, options)
            for recording in self.recordings(parts, clip, options)
        ]
        if not found:
            raise InputError(f"{clip.path}: expected {self.content}, got none; download them")
        return found

    def recordings(
        self, parts: ClipParts, clip: SourceClip, options: ReaderOptions
    ) -> list[Recording]:
        """The recordings of one interaction."""
        where, notes = str(clip.path), list(parts.notes)
        if parts.motion is None:
            frames = parts.hands[0].frames if parts.hands else 1
            motion, about_object = callers_object(options, frames, where)
            names = ()
            object_known, notes = np.ones(frames, dtype=bool), [*about_object, *notes]
        else:
            motion, names = object_track(parts.meshes.values(), parts.motion), tuple(parts.meshes)
            object_known = finite_frames(parts.motion)
        motion, about_meshes = with_parts(motion)
        notes += about_meshes
        if len(names) != len(motion.meshes):
            names = tuple(f"{clip.name}_{index}" for index in range(len(motion.meshes)))
        if self.fps_assumed and options.fps is None:
            notes.append(f"{self.fps:g} frames a second assumed; --fps says otherwise")
        hands, convention = [], parts.convention or self.convention
        for stored in parts.hands:
            hand, about_hand = (
                mano_track(stored, convention, options, where)
                if isinstance(stored, ManoParameters)
                else (stored, ())
            )
            if bool(hand.valid.any()):
                hands.append(hand)
                notes += about_hand
        rate = options.rate(self.fps if parts.fps is None else parts.fps)
        sequence = sequence_of(hands, motion, rate, parts.source, notes)
        refuse_other_frames(where, sequence, parts.cross_checks)
        camera = parts.camera if options.camera is None else options.camera
        if camera is not None:
            sequence = seen_from(
                sequence,
                torch.tensor([camera], dtype=torch.float32),
                f"{where}: the camera's position",
            )
        whole = Recording(parts.name or clip.name, sequence, names, parts.cross_checks)
        kept = object_known if parts.object_known is None else parts.object_known
        return split(whole, kept, parts.after_jump)


def refuse_other_frames(where: str, sequence: Sequence, stored: CrossChecks) -> None:
    """Refuse hands, or stored points, that are not of the object's frames."""
    lengths = {f"{hand.side} hand": hand.frames for hand in sequence.hands}
    lengths |= {f"{side} hand's keypoints": len(joints) for side, joints in stored.joints.items()}
    lengths |= {f"{side} hand's mesh": len(rim) for side, rim in stored.rim.items()}
    if stored.object_points is not None:
        lengths["stored object"] = len(stored.object_points[0])
    for name, length in lengths.items():
        if length != sequence.frames:
            raise InputError(
                f"{where}: expected {sequence.frames} frames of the {name}, as the object has, got "
                f"{length}; its files are of different clips or versions"
            )


def split(whole: Recording, object_known: Array, after_jump: Array | None) -> list[Recording]:
    """One recording for each stretch of frames in which the object's place is known.

    Args:
        whole: all frames; with several stretches each is called by its first frame as well.
        object_known: (T,) the frames that have the object's place.
        after_jump: (T,) frames that do not follow in time from the one before them.

    Raises:
        InputError: it is known in no frame, or in none with a hand.
    """
    if not object_known.any():
        raise InputError(f"{whole.name}: expected the object's pose in some frame, got none")
    stretches = runs(object_known, after_jump)
    if len(stretches) == 1 and object_known.all():
        return [whole]
    found = [
        Recording(
            f"{whole.name}_{span.start:05d}",
            part_of(whole.sequence, span),
            whole.mesh_names,
            whole.cross_checks[span],
        )
        for span in stretches
        if any(bool(hand.valid[span].any()) for hand in whole.sequence.hands)
    ]
    if not found:
        raise InputError(f"{whole.name}: expected a hand and the object in one frame, got none")
    return found


def stated_side(record: Record, options: ReaderOptions) -> Side:
    """The hand that a file of one hand holds, by the caller or by its field 'side'."""
    side = options.side or record.optional_text("side")
    if side not in ("left", "right"):
        raise InputError(
            f"{record.where}: which hand it holds is not said; pass --side left or right"
        )
    return side
