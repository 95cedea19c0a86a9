"""What an adapter is given and gives: the caller's knowledge in, recordings out.

An adapter is a module with two functions, `find(path)` and `read(clip, options)`, that alone knows
its source's units, axes, translation, mean pose, left hand, frame rate and file names. What a
source says twice (keypoints next to parameters, moved vertices next to poses) goes into
`CrossChecks`, with which `convention_check` tests the file against its own convention.
"""

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Shaped

from geneoh.bundle import Bundle
from geneoh.choices import Side, Translation
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.readers.mano import ManoSource, mano_of
from geneoh.readers.records import Array
from geneoh.sequence.sequence import Sequence


@dataclass(frozen=True)
class ReaderOptions:
    """What the caller knows and a source leaves open."""

    mano_dir: Path | None = None
    """Folder of the user's MANO files."""
    body: Path | None = None
    """The user's SMPL+H model, for sources whose hands hang on a body."""
    objects: Path | None = None
    """Folder of the object meshes, where they do not stand where the data set has them."""
    meshes: tuple[Mesh, ...] = ()
    """The object's own meshes in metres, for sources without any."""
    object_pose: Array | None = None
    """(T, 4, 4) object to the hand's frame, for sources without any."""
    side: Side | None = None
    fps: float | None = None
    joint_order: str = "openpose"
    translation: Translation | None = None
    """What the translation of a bare parameter array moves: the wrist, or MANO's origin."""
    swap_parts: bool = False
    """The two parts of an articulated object stand in the other order than they do as a rule."""
    mean_pose: bool | None = None
    """Whether a bare parameter array is relative to MANO's mean pose."""
    focal: float | None = None
    """Of the camera, pixels."""

    @property
    def mano(self) -> ManoSource | None:
        """The user's MANO files, if there are any."""
        return mano_of(self.mano_dir)

    def rate(self, default: float) -> float:
        """Frames a second of a source, unless the caller knows better."""
        return default if self.fps is None else self.fps


@dataclass(frozen=True)
class SourceClip:
    """One recording that was found: a name for what is made from it, and where it stands."""

    name: str
    path: Path


@dataclass(frozen=True)
class CrossChecks(Bundle):
    """What a source says a second time, in the frame of the sequence, metres."""

    joints: dict[Side, Shaped[Array, "T 21 3"]] = field(default_factory=dict)
    """Stored keypoints in OpenPose order, NaN where there are none."""
    rim: dict[Side, Shaped[Array, "T 3"]] = field(default_factory=dict)
    """A point of the stored mesh that moves rigidly with the wrist."""
    tolerance: float = 0.005
    """Metres that stored keypoints may stand off: where they are another annotation, more."""
    object_points: tuple[Shaped[Array, "T P 3"], Shaped[Array, "T P 3"]] | None = None
    """Stored points of the moved object, and the same ones from its mesh and pose."""
    said: tuple[str, ...] = ()
    """Contradictions that only the adapter can see, in words."""


@dataclass(frozen=True)
class Recording:
    """One sequence that was read, with the names of its meshes for files of their own."""

    name: str
    sequence: Sequence
    mesh_names: tuple[str, ...] = ()
    evidence: CrossChecks = field(default_factory=CrossChecks)


def clips(
    path: Path, pattern: str, name_parts: int, *, directories: bool = False
) -> list[SourceClip]:
    """What lies at or below a path and matches a pattern, in the order of names.

    Args:
        path: a file or folder as the user gave it.
        pattern: such as "*.npz", against the name.
        name_parts: how many parts of the path the clip's name keeps.
        directories: look for folders and not for files.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file or folder; check the path")
    found = [path] if path.match(pattern) and path.is_dir() == directories else []
    if not found and path.is_dir():
        found = sorted(p for p in path.rglob(pattern) if p.is_dir() == directories)
    return [SourceClip(clip_name(p, name_parts), p) for p in found]


def clip_name(path: Path, parts: int) -> str:
    """The last parts of a path without ending, fit for a file name."""
    words = [*path.resolve().parts[-parts:-1], path.name.split(".")[0]]
    return "/".join("".join(c if c.isalnum() or c in "-_+" else "_" for c in w) for w in words)


def finite_frames(values: Array) -> Array:
    """(T,) for each frame, whether all of its numbers are finite."""
    return np.asarray(np.isfinite(values.reshape(len(values), -1)).all(axis=1))


def runs(present: Array, after_jump: Array | None = None) -> list[slice]:
    """The longest stretches of frames that are all there.

    Args:
        present: (T,) whether a frame is there.
        after_jump: (T,) whether a frame does not follow from the one before it.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], present, [False]])))
    jumps = np.flatnonzero(np.zeros(len(present), dtype=bool) if after_jump is None else after_jump)
    stretches = []
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        cuts = [start, *(int(cut) for cut in jumps if start < cut < stop), stop]
        stretches += [slice(a, b) for a, b in pairwise(cuts)]
    return stretches
