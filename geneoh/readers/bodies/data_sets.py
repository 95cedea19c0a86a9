"""Data sets of bodies with fingers: their recordings, and their sentences on the hands.

BOTH57M: files of clips, each with sentences on its hands. Motion-X: `motion_data/smplx_322` with
`texts/semantic_labels` (of a recording) and `texts/hand_texts` (of each frame). AMASS: no
sentences.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

from geneoh.choices import BodySource
from geneoh.errors import InputError
from geneoh.readers.base import paths_matching
from geneoh.readers.bodies.base import BodyRecording
from geneoh.readers.bodies.read import read_bodies, read_body
from geneoh.readers.foreign_files import read_json, read_text
from geneoh.readers.records import as_record

FILES: dict[BodySource, tuple[str, ...]] = {
    "both57m": ("*.p", "*.pkl"),
    "motionx": ("*.npy",),
    "amass": ("*_poses.npz", "*_stageii.npz"),
}
"""Names of the files that hold bodies."""
MOTION_DATA = ("motion_data", "smplx_322")
"""Folders of Motion-X's bodies; the arrays in `face_motion_data` are no bodies."""
SAME_RECORDING = (r"subset_\d+/", r"(?i:_clip_?\d+)+$", r"(?<=/)M(?=\d{6}$)")
"""Parts of Motion-X's names in which clips of one recording, or a clip and its mirror, differ."""


@dataclass(frozen=True)
class SourceBody:
    """One clip of a data set."""

    body: BodyRecording
    """Its `sentences` hold for all frames."""
    group: str
    """The recording or the person; clips of one group are too similar for a validation split."""
    by_frame: Mapping[int, str] = field(default_factory=dict)
    """Sentences on the hands in single frames, by frame number."""


def body_files(source: BodySource, path: Path) -> list[Path]:
    """The files of bodies at or below a path; `InputError` where there are none."""
    found = sorted(chain.from_iterable(paths_matching(path, name) for name in FILES[source]))
    expected = " or ".join(FILES[source])
    if source == "motionx":
        folders = {file: file.resolve().parents for file in found}
        found = [f for f in found if MOTION_DATA in {(p.parent.name, p.name) for p in folders[f]}]
        expected += f" below {'/'.join(MOTION_DATA)}"
    if not found:
        raise InputError(
            f"{path}: expected {expected}, as in the data set {source}, got none; check the path"
        )
    return found


def read_source_bodies(
    source: BodySource, file: Path, model: Path | None = None
) -> Iterator[SourceBody]:
    """The clips in one of the files, `InputError` where it holds no body that can be read; `model`
    is the user's SMPL-H or SMPL-X."""
    if source == "both57m":  # the files do not say which clips are of one person
        for number, body in enumerate(read_bodies(file, model=model)):
            yield SourceBody(body, f"{file} {number}")
    elif source == "amass":  # all recordings of a person are in one folder
        yield SourceBody(read_body(file, model=model), str(file.resolve().parent))
    else:
        yield motion_x(file, model)


def motion_x(file: Path, model: Path | None) -> SourceBody:
    """One recording of Motion-X, with its texts where they are downloaded."""
    root = next(p for p in file.resolve().parents if (p.parent.name, p.name) == MOTION_DATA)
    name = file.resolve().relative_to(root).with_suffix("").as_posix()
    texts, group = root.parents[1] / "texts", f"/{name}"
    for part in SAME_RECORDING:
        group = re.sub(part, "", group)
    body = read_body(file, model=model)
    labels, by_frame = texts / "semantic_labels" / f"{name}.txt", {}
    if labels.exists():  # HumanML3D has parts of speech after a #
        lines = (line.partition("#")[0].strip() for line in read_text(labels).splitlines())
        body = replace(body, sentences=tuple(line for line in lines if line))
    if (hands := texts / "hand_texts" / f"{name}.json").exists():
        record = as_record(read_json(hands), str(hands))
        by_frame = {int(frame): record.text(frame) for frame in record.values if frame.isdecimal()}
    return SourceBody(body, group, by_frame)
