"""TACO as it is distributed: the right hand with its tool, the left hand with its target.

Hand_Poses/{triplet}/{seq}/{side}_hand.pkl, {side}_hand_shape.pkl (torch tensors in pickles, also of
a GPU); Object_Poses/{triplet}/{seq}/{tool|target}_{id}.npy; Object_Models/{id}_cm.obj in
centimetres. Translation of the wrist, absolute pose, left hand as shipped, world frame with z up,
30 frames a second.
"""

from dataclasses import replace
from pathlib import Path

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers import base
from geneoh.readers.builders import hand_by_frame
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.foreign_files import read_array, read_record
from geneoh.readers.meshes import find_mesh

CENTIMETRES = 0.01
HOLDS: dict[str, Side] = {"tool": "right", "target": "left"}
"""The hand that holds each object."""


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Each hand with what it holds, in the world."""
    root = base.ancestor(clip.path, 3)
    triplet, sequence = clip.path.parts[-2:]
    folder = options.objects or root / "Object_Models"
    for role, side in HOLDS.items():
        poses = sorted((root / "Object_Poses" / triplet / sequence).glob(f"{role}_*.npy"))
        if not poses or not (clip.path / f"{side}_hand.pkl").is_file():
            continue
        name = poses[0].stem.removeprefix(f"{role}_")
        motion = read_array(poses[0], ("T", 4, 4))
        mesh = find_mesh([folder / f"{name}_cm.obj"], f"object {name}", CENTIMETRES)
        yield base.ClipParts(
            f"TACO {triplet} {sequence} {role}",
            [read_hand(clip.path, side, len(motion))],
            {f"taco_{name}": mesh},
            motion,
            name=f"{clip.name}_{role}",
        )


def read_hand(folder: Path, side: Side, frames: int) -> base.ManoParameters:
    """One hand, in as many frames as the object has, with betas where there is a file of them."""
    record = read_record(folder / f"{side}_hand.pkl")
    keys = sorted(record.values, key=str)
    if len(keys) != frames:
        raise InputError(
            f"{record.where}: expected {frames} frames, as the object has, got {len(keys)}; "
            "the files are of different sequences or versions"
        )
    steps = {frame: record.record(key) for frame, key in enumerate(keys)}
    hand = hand_by_frame(side, steps, frames, "hand_pose", "hand_trans")
    shape = folder / f"{side}_hand_shape.pkl"
    betas = read_record(shape).array("hand_shape", (10,)) if shape.is_file() else None
    return replace(hand, betas=betas)


READER = DatasetReader(
    parts,
    ("*_hand.pkl",),
    clip_is_folder=True,
    name_parts=2,
    content="a hand, and poses of its object in the same folder below Object_Poses",
)
