"""The steps that all readers of data sets share: find clips, build sequences, split recordings.

A source is a function in `geneoh.readers.sources` that yields the parts of a clip; `reads` turns it
into a `DatasetReader`, which also holds the source's convention, frame rate and file names.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from geneoh.errors import ConfigError, InputError
from geneoh.readers import base, builders, meshes
from geneoh.readers.base import ClipParts, CrossChecks, ReaderOptions, Recording, SourceClip
from geneoh.readers.clock import Clock, rate_of, timing_of
from geneoh.readers.records import Array, Notes, float32
from geneoh.readers.transforms import refuse_bottom_row
from geneoh.sequence.camera import seen_from
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

Matches = Iterable[Path]
"""Files and folders that match a reader's patterns."""

IN_WORLD_NOTE = (
    "the object's poses are taken to lead to the world; where they lead to the frame of the moving "
    "camera, pass --object-pose-frame camera"
)


@dataclass(frozen=True)
class DatasetReader:
    """The reader of one source: what all of its clips share, and the function that reads a clip."""

    parts: Callable[[SourceClip, ReaderOptions], Iterable[ClipParts]]
    """The interactions of a clip, each of which becomes one recording or more."""
    patterns: tuple[str, ...]
    """Patterns for the files that make a clip, or for folders, with "/" at the end."""
    clip_is_folder: bool = False
    """Whether the clip is the folder that holds a matching file, and not the file itself."""
    choose: Callable[[Matches, Path], Matches] = lambda found, path: found
    """Selects the clips among the matches below a path; by default all matches."""
    any_file: bool = False
    """Whether a file that the caller names is a clip, whatever its name."""
    name_parts: int = 1
    """Number of path components in a clip's name."""
    name_above: int = 0
    """Number of levels above the clip's path at which the name ends."""
    fps: float | None = 30.0
    """Frames a second of all clips; None where it is unknown and is assumed, with a note."""
    convention: base.ManoConvention = base.WRIST
    """How the source uses MANO, if it stores MANO parameters."""
    takes: tuple[str, ...] = ()
    """The options of `geneoh.readers.base.OF_SOME` that the source accepts."""
    content: str = "a hand and an object"
    """What every clip must hold, for the error message."""

    def find(self, path: Path) -> list[SourceClip]:
        """Every clip at or below a path, each once."""
        if self.any_file and path.is_file():
            found = [path]
        else:
            found = [p for pattern in self.patterns for p in base.paths_matching(path, pattern)]
            found = [p.parent if self.clip_is_folder else p for p in self.choose(found, path)]
        named = {p: base.ancestor(p, self.name_above) for p in found}
        return [SourceClip(base.clip_name(named[p], self.name_parts), p) for p in named]

    def read(self, clip: SourceClip, options: ReaderOptions) -> list[Recording]:
        """The recordings of a clip: its interactions, cut where the object's pose is unknown."""
        found = []
        for parts in self.parts(clip, options):
            whole, rows = self.whole(parts, clip, options)
            found += split(whole, frames_to_keep(parts)[rows], parts.after_jump)
        if not found:
            raise InputError(f"{clip.path}: expected {self.content}, got none; download them")
        return found

    def timing(
        self, parts: ClipParts, options: ReaderOptions, where: str
    ) -> tuple[float, Clock | None, Notes]:
        """Frame rate, the clock if the clip has timestamps or frame numbers, and notes."""
        if parts.stamps is not None:
            return timing_of(parts.stamps, parts.frames, options.fps)
        usual = self.fps if parts.fps is None else None
        fps = usual if options.fps is None else options.fps
        rate, notes = rate_of(parts.fps, fps, where)
        return rate, None, notes

    def whole(
        self, parts: ClipParts, clip: SourceClip, options: ReaderOptions
    ) -> tuple[Recording, Array]:
        """One interaction with all of its frames, before it is split into recordings; and for each
        of these frames the nearest one of the clip."""
        where, checks = str(clip.path), parts.cross_checks
        rate, clock, about_time = self.timing(parts, options, where)
        hands, about_hands = _hands_of(parts, parts.convention or self.convention, options, where)
        motion, about_object = _object_of(parts, options, clock, where)
        motion, about_meshes = meshes.with_parts(motion)
        names = tuple(parts.meshes)
        if len(names) != len(motion.meshes):
            names = tuple(f"{clip.name}_{index}" for index in range(len(motion.meshes)))
        notes = [*about_object, *parts.notes, *about_time, *about_meshes, *about_hands]
        cameras = None
        if options.camera_pose is not None:
            poses, more = options.camera_pose.of_frames(parts.frames, where, clock, parts.first)
            cameras, notes = float32(poses), [*notes, *more]
        words = "; ".join(dict.fromkeys(notes))
        source = f"{parts.source} ({words})" if words else parts.source
        assumed = tuple(notes)
        sequence = Sequence(
            tuple(hands), motion, rate, source, assumed=assumed, camera_to_world=cameras
        )
        refuse_other_frames(where, sequence, checks)
        camera: Any = parts.camera if options.camera is None else options.camera
        if camera is None and parts.camera_poses is not None:
            camera = parts.camera_poses[:, :3, 3]
        if camera is not None:
            place = torch.from_numpy(np.atleast_2d(np.asarray(camera, np.float32)))
            sequence = seen_from(sequence, place, f"{where}: the camera's position")
        nearest = np.arange(sequence.frames)
        if clock is not None:
            sequence, nearest = clock.even(sequence)
            checks = checks[nearest]
        return Recording(parts.name or clip.name, sequence, names, checks), nearest


def reads(
    *patterns: str, **how: Any
) -> Callable[[Callable[[SourceClip, ReaderOptions], base.Parts]], DatasetReader]:
    """Decorator: make a function a reader; the arguments are the fields of `DatasetReader`."""
    return lambda parts: DatasetReader(parts, patterns, **how)


def _object_of(
    parts: ClipParts, options: ReaderOptions, clock: Clock | None, where: str
) -> tuple[ObjectTrack, Notes]:
    """The object of an interaction, or the caller's if the source has none; and notes."""
    if parts.object_track is not None:
        return parts.object_track, ()
    if parts.motion is None:
        return _callers_object(parts, options, clock, where)
    refuse_bottom_row(where, "the object's poses", parts.motion, frames_to_keep(parts))
    return builders.object_track(parts.meshes.values(), parts.motion), ()


def _callers_object(
    parts: ClipParts, options: ReaderOptions, clock: Clock | None, where: str
) -> tuple[ObjectTrack, Notes]:
    """The caller's object for a source without one; without --object-pose, one without meshes."""
    if options.object_pose is None and options.meshes:
        raise InputError(
            f"{where}: the mesh in --obj needs the poses of the object, got none; pass "
            "--object-pose POSES.npy, with the identity in every frame for an object that stands "
            "still at the origin, or leave --obj out to clean the hand alone"
        )
    if options.object_pose is None:
        if options.object_pose_frame != "world":
            raise ConfigError("--object-pose-frame: needs --object-pose, got none; drop it")
        about = "the source has no object; give one with --obj"
        return ObjectTrack.resting((), parts.frames), (about,)
    given = options.object_pose.without_unset(options.meshes)
    poses, notes = given.of_frames(parts.frames, where, clock, parts.first)
    refuse_bottom_row(where, "the poses in --object-pose", poses)
    if options.object_pose_frame == "camera":
        if parts.camera_poses is None:
            raise InputError(
                f"{where}: --object-pose-frame camera needs the poses of the camera, got none; "
                "keep the source's files of it in their place, or give poses in the world"
            )
        poses = np.einsum("tij,t...jk->t...ik", parts.camera_poses, poses)
    elif parts.camera_poses is not None:
        notes = (*notes, IN_WORLD_NOTE)
    return builders.object_track(options.meshes, poses), notes


def _hands_of(
    parts: ClipParts, convention: base.ManoConvention, options: ReaderOptions, where: str
) -> tuple[list[HandTrack], list[str]]:
    """The hands that were observed in some frame, `InputError` without any, and notes on what was
    assumed, and on hands that were left out."""
    hands, notes, unseen = [], [], []
    for hand in parts.hands:
        about = ()
        if isinstance(hand, base.ManoParameters):
            hand, about = builders.mano_track(hand, convention, options, where)
        if is_placed(hand):
            hands.append(hand)
            notes += about
        else:
            unseen.append(f"the {hand.side} hand is in no frame and was left out")
    if not hands:
        words = "expected a hand in some frame, got none; nothing to clean"
        raise InputError(f"{parts.source}: {words}")
    return hands, [*notes, *unseen]


def is_placed(hand: HandTrack) -> bool:
    """Whether some frame holds the hand, and not only zeros for its keypoints."""
    return bool(hand.valid.any()) and (hand.joints is None or bool(hand.joints.nan_to_num().any()))


def frames_to_keep(parts: ClipParts) -> Array:
    """(T,) mask of the source's own choice of frames, else of those with a known object pose."""
    if parts.object_known is not None:
        return parts.object_known
    return np.ones(parts.frames, bool) if parts.motion is None else base.finite_frames(parts.motion)


def refuse_other_frames(where: str, sequence: Sequence, stored: CrossChecks) -> None:
    """Refuse hands or stored points whose number of frames differs from the object's."""
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
    """One recording per run of frames with a known object pose, its first frame in its name."""
    if not object_known.any():
        raise InputError(f"{whole.name}: expected the object's pose in some frame, got none")
    stretches = base.stretches(object_known, after_jump)
    if len(stretches) == 1 and object_known.all():
        return [whole]
    found = []
    for span in stretches:
        if any(bool(hand.valid[span].any()) for hand in whole.sequence.hands):
            name, part = f"{whole.name}_{span.start:05d}", builders.stretch_of(whole.sequence, span)
            checks = whole.cross_checks[span]
            found.append(Recording(name, part, whole.mesh_names, checks))
    if not found:
        raise InputError(f"{whole.name}: expected a hand and the object in one frame, got none")
    return found
