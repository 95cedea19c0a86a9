"""What a reader is given and gives: the caller's options in, recordings out."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Shaped

from geneoh.bundle import Bundle
from geneoh.choices import JointOrder, Side, Translation, Unit
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.readers.mano import ManoSource, mano_of
from geneoh.readers.records import Array, Place
from geneoh.sequence.sequence import Sequence


@dataclass(frozen=True)
class ReaderOptions:
    """What the caller knows and a source leaves open."""

    mano_dir: Path | None = None
    """Folder of the user's MANO files."""
    body: Path | None = None
    """The user's SMPL+H model, for sources whose hands are posed with a body."""
    objects: Path | None = None
    """Folder of the object meshes, where they are not in their usual place."""
    meshes: tuple[Mesh, ...] = ()
    """The object's own meshes in metres, for sources without any."""
    object_pose: Array | None = None
    """(T, 4, 4) object to the hand's frame, for sources without any."""
    side: Side | None = None
    """The hand to read; for sources that do not say it, the hand that they hold."""
    fps: float | None = None
    """Frames a second, instead of the source's own."""
    joint_order: JointOrder = "openpose"
    """Order of a bare array of keypoints."""
    keypoint_unit: Unit | None = None
    """Unit of a bare array of keypoints, by default metres."""
    translation: Translation | None = None
    """What the translation of a bare parameter array moves: the wrist, or MANO's origin."""
    swap_parts: bool = False
    """The poses of an articulated object's two parts are stored in the other order than usual."""
    mean_pose: bool | None = None
    """Whether a bare parameter array is relative to MANO's mean pose."""
    focal: float | None = None
    """Focal length of the camera in pixels, for image-based estimators."""
    camera: Place | None = None
    """Position of the camera in the world, metres, instead of the source's own."""

    @property
    def mano(self) -> ManoSource | None:
        """The user's MANO files, if there are any."""
        return mano_of(self.mano_dir)

    def rate(self, default: float) -> float:
        """Frames a second of a source, unless the caller knows better."""
        return default if self.fps is None else self.fps


@dataclass(frozen=True)
class SourceClip:
    """One clip that was found: a name for what is made from it, and its file or folder."""

    name: str
    path: Path


@dataclass(frozen=True)
class CrossChecks(Bundle):
    """What a source states a second time, in the frame of the sequence, in metres.

    `convention_check` compares it with the sequence as it was read.
    """

    joints: dict[Side, Shaped[Array, "T 21 3"]] = field(default_factory=dict)
    """Stored keypoints in OpenPose order, NaN where there are none."""
    rim: dict[Side, Shaped[Array, "T 3"]] = field(default_factory=dict)
    """A point of the stored hand mesh that moves rigidly with the wrist."""
    tolerance: float = 0.005
    """Metres that stored keypoints may be off: more where they are a separate annotation."""
    object_points: tuple[Shaped[Array, "T P 3"], Shaped[Array, "T P 3"]] | None = None
    """Stored points of the moved object, and the same ones from its mesh and pose."""
    contradictions: tuple[str, ...] = ()
    """Contradictions that only the reader of the source can see, as sentences."""


@dataclass(frozen=True)
class Recording:
    """One sequence that was read, with the names of its meshes for files of their own."""

    name: str
    sequence: Sequence
    mesh_names: tuple[str, ...] = ()
    cross_checks: CrossChecks = field(default_factory=CrossChecks)


def paths_matching(path: Path, pattern: str) -> Iterator[Path]:
    """What is at or below a path and matches a pattern, in the order of names.

    Args:
        path: a file or folder as the user gave it.
        pattern: for the name of a file, such as "*.npz", or of a folder, such as "meta/".

    Raises:
        InputError: no such path.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file or folder; check the path")
    name, folders = pattern.rstrip("/"), pattern.endswith("/")
    if path.match(name) and path.is_dir() == folders:
        yield path
    elif path.is_dir():
        yield from sorted(p for p in path.rglob(name) if p.is_dir() == folders)


def clip_name(path: Path, parts: int) -> str:
    """The last parts of a path without ending, fit for a file name."""
    words = [*path.resolve().parts[-parts:-1], path.name.split(".")[0]]
    return "/".join("".join(c if c.isalnum() or c in "-_+" else "_" for c in w) for w in words)


def ancestor(path: Path, levels: int) -> Path:
    """The folder so many levels above a path; the topmost one where there are fewer."""
    return path.parents[min(levels, len(path.parents)) - 1] if path.parents else path


def finite_frames(values: Array) -> Array:
    """(T,) whether all numbers of a frame are finite."""
    return np.asarray(np.isfinite(values.reshape(len(values), -1)).all(axis=1))


def runs(present: Array, after_jump: Array | None = None) -> list[slice]:
    """The longest stretches of frames that are all present.

    Args:
        present: (T,) whether a frame is present.
        after_jump: (T,) whether a frame does not follow from the one before it.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], present, [False]])))
    jumps = np.flatnonzero(np.zeros(len(present), dtype=bool) if after_jump is None else after_jump)
    stretches = []
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        cuts = [start, *(int(cut) for cut in jumps if start < cut < stop), stop]
        stretches += [slice(a, b) for a, b in pairwise(cuts)]
    return stretches
