"""Any array of MANO parameters: 'pose' (T, 48), 'trans' (T, 3) and 'betas' in an npz or a pickle.

A bare npy holds them side by side, 51 or 61 numbers a frame. What the translation moves is never
guessed (--translation wrist or origin); the pose is taken as absolute unless --mean-pose. NaN
means not observed.
"""

from pathlib import Path

from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.readers import base
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.records import Record


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The one hand of a file, with the caller's object."""
    value = read_values(clip.path)
    record = Record(str(clip.path), value) if isinstance(value, dict) else columns(clip.path, value)
    side = options.side_of(record)
    if options.translation is None:
        raise InputError(
            f"{clip.path}: what the translation moves is not said; pass --translation wrist, "
            "or --translation origin for that of smplx and manopth"
        )
    betas = record.optional_array("betas", (10,), ("T", 10))
    hand = base.ManoParameters(
        side,
        record.array("pose", ("T", 48), ("T", 16, 3)).reshape(-1, 48),
        record.array("trans", ("T", 3)),
        None if betas is None else betas.reshape(-1, 10).mean(0),
    )
    yield base.ClipParts(
        f"{clip.path.name} (MANO parameters)",
        [hand],
        notes=() if options.mean_pose is not None else ("the pose is taken as absolute",),
        convention=base.ManoConvention(options.translation, mean_added=bool(options.mean_pose)),
    )


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


READER = DatasetReader(parts, ("*.npy", "*.npz", "*.pkl"), fps_assumed=True)
