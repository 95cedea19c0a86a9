"""TACO as it is distributed: the right hand with its tool, the left hand with its target.

Hand_Poses/{triplet}/{seq}/{side}_hand.pkl, {side}_hand_shape.pkl (torch tensors in pickles, also of
a GPU); Object_Poses/{triplet}/{seq}/{tool|target}_{id}.npy; Object_Models/{id}_cm.obj in
centimetres. Translation of the wrist, absolute pose, left hand as shipped, world frame with z up,
30 frames a second.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers.base import ReaderOptions, SourceClip, ancestor
from geneoh.readers.builders import ManoConvention, ManoParameters
from geneoh.readers.dataset_reader import ClipParts, DatasetReader
from geneoh.readers.foreign_files import read_array, read_record
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import Array

CENTIMETRES = 0.01
HOLDS: dict[str, Side] = {"tool": "right", "target": "left"}
"""The hand that holds each object."""


class TacoReader(DatasetReader):
    """Each hand with what it holds, in the world."""

    patterns = ("*_hand.pkl",)
    clip_is_folder = True
    name_parts = 2
    convention = ManoConvention("wrist")
    content = "a hand, and poses of its object in the same folder below Object_Poses"

    def parts(self, clip: SourceClip, options: ReaderOptions) -> Iterator[ClipParts]:
        """One interaction for each hand and its object."""
        root = ancestor(clip.path, 3)
        triplet, sequence = clip.path.parts[-2:]
        folder = options.objects or root / "Object_Models"
        for role, side in HOLDS.items():
            poses = sorted((root / "Object_Poses" / triplet / sequence).glob(f"{role}_*.npy"))
            if not poses or not (clip.path / f"{side}_hand.pkl").is_file():
                continue
            name = poses[0].stem.removeprefix(f"{role}_")
            motion = read_array(poses[0], ("T", 4, 4))
            mesh = read_mesh(find_mesh([folder / f"{name}_cm.obj"], f"object {name}"), CENTIMETRES)
            yield ClipParts(
                f"TACO {triplet} {sequence} {role}",
                [read_hand(clip.path, side, len(motion))],
                {f"taco_{name}": mesh},
                motion,
                name=f"{clip.name}_{role}",
            )


def read_hand(folder: Path, side: Side, frames: int) -> ManoParameters:
    """One hand, in as many frames as the object has."""
    record = read_record(folder / f"{side}_hand.pkl")
    keys = sorted(record.values, key=str)
    if len(keys) != frames:
        raise InputError(
            f"{record.where}: expected {frames} frames, as the object has, got {len(keys)}; "
            "the files are of different sequences or versions"
        )
    steps = [record.record(key) for key in keys]
    return ManoParameters(
        side,
        np.stack([step.array("hand_pose", (48,)) for step in steps]),
        np.stack([step.array("hand_trans", (3,)) for step in steps]),
        read_shape(folder / f"{side}_hand_shape.pkl"),
    )


def read_shape(path: Path) -> Array | None:
    """(10,) betas, if the file is there."""
    return read_record(path).array("hand_shape", (10,)) if path.is_file() else None


READER = TacoReader()
