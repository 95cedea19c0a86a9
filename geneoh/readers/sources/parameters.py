"""Any array of MANO parameters: 'pose' (T, 48), 'trans' (T, 3) and 'betas' in an npz or a pickle.

A bare npy holds them side by side, 51 or 61 numbers a frame. What the translation moves is never
guessed (--translation wrist or origin); the pose is taken as absolute unless --mean-pose. NaN
stands for what was not observed.
"""

from pathlib import Path

import numpy as np

from geneoh.errors import InputError
from geneoh.pickles.files import read_values
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, clips
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    mano_track,
    object_of,
    recordings,
    sequence_of,
)
from geneoh.readers.records import Record

FPS = 30.0


def find(path: Path) -> list[SourceClip]:
    """Every array file and pickle."""
    return [clip for ending in ("npy", "npz", "pkl") for clip in clips(path, f"*.{ending}", 1)]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """One hand."""
    value = read_values(clip.path)
    record = Record(str(clip.path), value) if isinstance(value, dict) else columns(clip.path, value)
    side = known.side or (record.text("side") if "side" in record else None)
    if side not in ("left", "right"):
        raise InputError(f"{clip.path}: which hand it holds is not said; pass --side left or right")
    if known.translation is None:
        raise InputError(
            f"{clip.path}: what the translation moves is not said; pass --translation wrist, or "
            "--translation origin for that of smplx and manopth"
        )
    pose = record.array("pose", ("T", 48), ("T", 16, 3)).reshape(-1, 48)
    betas = record.array("betas", (10,), ("T", 10)).reshape(-1, 10) if "betas" in record else None
    dialect = ManoConvention(known.translation == "origin", mean_added=bool(known.mean_pose))
    numbers = ManoParameters(
        side, pose, record.array("trans", ("T", 3)), None if betas is None else betas.mean(0)
    )
    track = mano_track(numbers, dialect, known, str(clip.path))
    motion, notes = object_of(known, len(pose), str(clip.path))
    sequence = sequence_of(
        [track],
        motion,
        known.rate(FPS),
        f"{clip.path.name} (MANO parameters)",
        *notes,
        *(() if known.fps else (f"{FPS:g} frames a second assumed; --fps says otherwise",)),
        *(() if known.mean_pose is not None else ("the pose is taken as absolute",)),
    )
    names = tuple(f"{clip.name}_{index}" for index in range(len(motion.meshes)))
    everywhere = np.ones(len(pose), dtype=bool)
    return recordings(clip.name, sequence, object_known=everywhere, mesh_names=names)


def columns(path: Path, value: object) -> Record:
    """The fields of a bare array."""
    array = Record(str(path), {"array": value}).array("array", ("T", 51), ("T", 61), ("T", 48))
    if array.shape[1] == 48:
        raise InputError(
            f"{path}: 48 parameters are a pose without a place, got no translation; save 'pose' "
            "and 'trans' together with numpy.savez"
        )
    fields = {"pose": array[:, :48], "trans": array[:, 48:51]}
    return Record(str(path), {**fields, "betas": array[:, 51:]} if array.shape[1] == 61 else fields)
