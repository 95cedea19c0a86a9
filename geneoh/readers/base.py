"""Data types that readers share: the caller's options, the parts of a clip, and recordings."""

import fnmatch
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path, PurePath
from typing import Any

import numpy as np
from jaxtyping import Shaped

from geneoh.bundle import Bundle
from geneoh.choices import OF_SOURCES, JointOrder, PoseFrame, Side, Translation, Unit
from geneoh.errors import ConfigError, InputError
from geneoh.files.reading import note_read, refuse_missing
from geneoh.geometry.mesh import Mesh
from geneoh.hand.mano import AS_SHIPPED, ManoName, find_mano, mano_folder
from geneoh.readers.mano import Mano, read_mano
from geneoh.readers.pose_matching import PoseTrack
from geneoh.readers.records import Array, Notes, Record
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.windows import runs

Place = tuple[float | int, float | int, float | int]
"""A point of the world, metres."""
ImageSize = tuple[int, int]
"""Width and height in pixels."""


@dataclass(frozen=True)
class ReaderOptions:
    """Options by which the caller supplies what a source's files leave open."""

    mano_dir: Path | None = None
    """Folder of the user's MANO files. None leaves it to the environment variable
    GENEOH_MANO_DIR."""
    body: Path | None = None
    """The user's SMPL+H model, for sources whose hands are posed with a body."""
    objects: Path | None = None
    """Folder of the object meshes, where they are not in their usual place."""
    meshes: tuple[Mesh, ...] = ()
    """The object's own meshes in metres, for sources without any."""
    object_pose: PoseTrack | None = None
    """Poses of the object, for sources without any."""
    object_pose_frame: PoseFrame = "world"
    """The frame that these poses lead to."""
    side: Side | None = None
    """The hand to read; for files that do not name a side, the side of the hand in them."""
    fps: float | None = None
    """Frames a second, in place of the source's own frame rate."""
    joint_order: JointOrder = "openpose"
    """Order of a bare array of keypoints."""
    keypoint_unit: Unit | None = None
    """Unit of a bare array of keypoints, by default metres."""
    translation: Translation | None = None
    """Point that the translation of a bare parameter array places: the wrist, or MANO's origin."""
    swap_parts: bool = False
    """HOI4D: whether the poses of two parts are in another order than usual in their category."""
    mean_pose: bool | None = None
    """Whether a bare parameter array is relative to MANO's mean pose."""
    focal: float | None = None
    """Focal length of the camera in pixels, for image-based estimators."""
    image_size: ImageSize | None = None
    """Size of its images, with whose landmarks and `focal` MediaPipe's hands get their places."""
    camera: Place | None = None
    """Position of the camera in the world, metres, instead of the source's own."""
    camera_pose: PoseTrack | None = None
    """Poses of a moving camera, camera to world, for hands and object in its frame."""

    def __post_init__(self) -> None:
        """Find the folder of MANO; `ConfigError` for a focal length not above 0 and finite, with
        which hands would be behind the camera, or nowhere."""
        object.__setattr__(self, "mano_dir", mano_folder(self.mano_dir))
        if self.focal is not None and not 0 < self.focal < math.inf:
            raise ConfigError(
                f"--focal: expected a length in pixels above 0, got {self.focal:g}; correct it"
            )

    def mano(self, side: Side, left_hand: ManoName = AS_SHIPPED) -> Mano | None:
        """The user's MANO model of one side; None where no folder is known."""
        if self.mano_dir is None:
            return None
        note_read(find_mano(side, self.mano_dir))  # `read_mano` reads it once for all clips
        return read_mano(self.mano_dir, side, left_hand)


def place_of(given: Any, caller: str) -> Place:
    """A camera's position passed from Python, as numbers or as a text for `place_in`."""
    if not isinstance(given, str):
        record = Record(caller, {"camera": given}, "give X, Y and Z in metres, or 'origin'")
        x, y, z = record.array("camera", (3,)).tolist()
        return x, y, z
    try:
        return place_in(given)
    except InputError as error:
        raise InputError(f"{caller}: 'camera' must be a place: {error}") from None


def place_in(text: str) -> Place:
    """A point from the text `X,Y,Z`, metres, or `origin`; `InputError` for anything else."""
    try:
        x, y, z = (0.0, 0.0, 0.0) if text.lower() == "origin" else map(float, text.split(","))
    except ValueError:
        raise InputError(
            f"expected three numbers X,Y,Z in metres, or origin, got {text!r}; correct it"
        ) from None
    return x, y, z


def image_size_of(given: Any) -> ImageSize:
    """The size of images in the text `WIDTHxHEIGHT`, or a pair; `ConfigError` for anything else."""
    sides = given.lower().split("x") if isinstance(given, str) else given
    try:
        width, height = (int(str(side)) for side in sides)
    except (TypeError, ValueError):
        width = height = 0
    if min(width, height) < 1:
        raise ConfigError(
            f"--image-size: expected WIDTHxHEIGHT in pixels, such as 1280x720, got {given!r:.60}; "
            "correct it"
        )
    return width, height


MOVED_DISTANCE = 0.03
"""Distance in metres from its median position beyond which an object counts as moved."""

OF_SOME = (*OF_SOURCES, "object_pose", "camera_pose", "joint_order", "keypoint_unit")
"""Options that only some sources accept; each reader lists those that it accepts."""


@dataclass(frozen=True)
class SourceClip:
    """One clip of a source: the name for its outputs, and its file or folder."""

    name: str
    path: Path


@dataclass(frozen=True)
class ManoConvention:
    """How a source uses MANO."""

    translation: Translation
    """Point that the translation places: the wrist, or the origin of the model (x = LBS + t)."""
    mean_added: bool = False
    """Whether MANO's mean pose has to be added to the stored poses (flat_hand_mean=False)."""
    left_hand: ManoName = AS_SHIPPED
    """The variant of MANO's left hand that the betas belong to; see `geneoh.hand.mano`."""


WRIST, ORIGIN = ManoConvention("wrist"), ManoConvention("origin")


@dataclass(frozen=True)
class ManoParameters:
    """One hand as a source stores it; frames that are NaN were not observed."""

    side: Side
    pose: Array
    """(T, 48) or (T, 16, 3) axis-angle, global orientation first."""
    translation: Array
    """(T, 3) metres."""
    betas: Array | None = None
    """(10,)"""
    joints: Array | None = None
    """(T, 21, 3) stored keypoints in OpenPose order, in the frame of `translation`."""
    confidence: Array | None = None
    """(T, 21) confidence of each keypoint, from 0 to 1."""
    template: Array | None = None
    """(778, 3) the person's own mesh in the rest pose, which replaces the betas."""
    to_world: Array | None = None
    """(T, 4, 4) from the frame of these parameters to the world frame of the sequence."""

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.pose)


@dataclass(frozen=True)
class CrossChecks(Bundle):
    """Redundant data of a source, in metres in the world frame of the sequence, with which
    `convert --check` compares what was read (`geneoh.readers.checks.convention`)."""

    joints: dict[Side, Shaped[Array, "T 21 3"]] = field(default_factory=dict)
    """Stored keypoints in OpenPose order, NaN where there are none."""
    rim: dict[Side, Shaped[Array, "T 3"]] = field(default_factory=dict)
    """A point of the stored hand mesh that moves rigidly with the wrist."""
    tolerance: float = 0.005
    """Largest error of stored keypoints in metres; larger where they were annotated separately."""
    object_points: tuple[Shaped[Array, "T P 3"], Shaped[Array, "T P 3"]] | None = None
    """Stored points of the moved object, and the same ones from its mesh and pose."""
    contradictions: tuple[str, ...] = ()
    """Contradictions that only the reader of the source can see, as sentences."""


def by_side(side: Side, points: Array | None) -> dict[Side, Array]:
    """The stored points of one hand by its side; empty where there are none."""
    return {} if points is None else {side: points}


@dataclass(frozen=True)
class ClipParts:
    """Hands and one object as a source stores them, from which a sequence is built."""

    source: str
    """Source and clip, with which `Sequence.source` begins."""
    hands: list[ManoParameters] | list[HandTrack]
    """As the source stores them; those that were not observed in any frame are left out."""
    meshes: dict[str, Mesh] = field(default_factory=dict)
    """One mesh in metres for each part of the object, by the name of its file."""
    motion: Array | None = None
    """(T, 4, 4) or (T, Q, 4, 4) object to world in metres, NaN where unknown; None for a source
    without an object, for which the caller's poses are used."""
    object_track: ObjectTrack | None = None
    """The object's track, with the caller's meshes, where a source that usually has no object
    stores one."""
    name: str = ""
    """Name of the recording, by default the clip's."""
    fps: float | None = None
    """Frames a second, where the clips of the source differ in it."""
    notes: Notes = ()
    """Assumptions that were made, as sentences."""
    cross_checks: CrossChecks = field(default_factory=CrossChecks)
    object_known: Array | None = None
    """(T,) mask of the frames to keep, by default those in which the motion is known."""
    after_jump: Array | None = None
    """(T,) mask of the frames that do not directly follow the previous one in time."""
    first: int = 0
    """Number that the source gives its first frame."""
    stamps: Record | None = None
    """Fields with the times or numbers of the frames, which may be uneven; they replace `fps`."""
    convention: ManoConvention | None = None
    """How this clip uses MANO, where the clips of the source differ in it."""
    camera: Place | Array | None = None
    """Position of the camera whose images the hands were estimated from, metres, world; None where
    unknown."""
    camera_poses: Array | None = None
    """(T, 4, 4) poses of a moving camera, camera to world, metres, which include its positions."""

    @property
    def frames(self) -> int:
        """Number of frames T of the hands; 1 without any."""
        return self.hands[0].frames if self.hands else 1


Parts = Iterator[ClipParts]
"""The interactions in one clip of a source."""


@dataclass(frozen=True)
class Recording:
    """One sequence, with the names under which its meshes are written to files."""

    name: str
    sequence: Sequence
    mesh_names: tuple[str, ...] = ()
    cross_checks: CrossChecks = field(default_factory=CrossChecks)


def paths_matching(path: Path, pattern: str) -> Iterator[Path]:
    """Sorted paths at or below `path` that match a pattern of files ("*.npz") or folders ("meta/").

    The name of `path` itself is matched regardless of case.
    """
    refuse_missing(path)
    name, folders = pattern.rstrip("/"), pattern.endswith("/")
    if PurePath(path.name.lower()).match(name.lower()) and path.is_dir() == folders:
        yield path
    elif path.is_dir():
        yield from sorted(below(path, name, folders=folders))


def below(folder: Path, pattern: str, *, folders: bool = False) -> Iterator[Path]:
    """Files, or folders, at any depth of a folder, whose name matches a pattern.

    Other than `Path.rglob` it follows links to folders, last, and each real folder once.
    """
    real: set[str] = set()
    waiting = [str(folder)]
    while waiting:
        for place, inside, files in os.walk(waiting.pop(0)):
            if (there := os.path.realpath(place)) in real:
                inside.clear()
                continue
            real.add(there)
            paths = [os.path.join(place, each) for each in inside]
            waiting.extend(sorted(filter(os.path.islink, paths)))
            named = fnmatch.filter(inside if folders else files, pattern)
            yield from (Path(place, each) for each in named)


def clip_name(path: Path, parts: int) -> str:
    """The last `parts` components of a path, without the ending, as a name for files."""
    words = [*path.resolve().parts[-parts:-1], path.name.split(".")[0]]
    return "/".join(map(fit_for_name, words))


def fit_for_name(text: str) -> str:
    """The text for a file name: characters other than letters, digits and -_+ become "_"."""
    return "".join(c if c.isalnum() or c in "-_+" else "_" for c in text)


def ancestor(path: Path, levels: int) -> Path:
    """The folder `levels` above a path, or the topmost one where there are fewer levels."""
    return [path, *path.parents][min(levels, len(path.parents))]


def finite_frames(values: Array) -> Array:
    """(T,) mask of the frames whose numbers are all finite."""
    return np.asarray(np.isfinite(values).all(axis=tuple(range(1, values.ndim))))


def moving_objects(motions: Mapping[str, Array]) -> list[str]:
    """Names of the objects that move by more than `MOVED_DISTANCE`, from (T, 4, 4) poses in metres.

    Most objects on a table are never handled. If none moves, all that have poses are returned.
    """
    known = {name: motion[finite_frames(motion), :3, 3] for name, motion in motions.items()}
    known = {name: places for name, places in known.items() if len(places)}

    def leaves(places: Array) -> bool:
        distance = np.linalg.norm(places - np.median(places, axis=0), axis=1)
        return bool(distance.max() > MOVED_DISTANCE)

    return [name for name, places in known.items() if leaves(places)] or list(known)


def stretches(present: Array, after_jump: Array | None) -> list[slice]:
    """The longest runs of frames in the mask `present`, cut before each jump in time."""
    jumps = [] if after_jump is None else np.flatnonzero(after_jump).tolist()
    found = []
    for run in runs(present):
        cuts = [run.start, *(cut for cut in jumps if run.start < cut < run.stop), run.stop]
        found += [slice(a, b) for a, b in pairwise(cuts)]
    return found
