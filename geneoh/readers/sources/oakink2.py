"""OakInk2 as it is distributed: anno_preview/{seq}.pkl, one pickle for each sequence.

raw_mano[frame] holds rh__ and lh__ pose_coeffs (1, 16, 4) quaternions with the real part first, tsl
(of the wrist) and betas as torch tensors, absolute pose, left hand as shipped; obj_transf[object]
[frame] is object to world, metres. Frames are numbered by the motion capture, 120 a second; where
numbers are left out, time went on.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.readers import base
from geneoh.readers.builders import hand_by_frame
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.foreign_files import by_frame, read_record
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import FRAME_LIMIT, Record, as_record

CAPTURE_FPS = 120.0
"""Of the motion capture; frames that were left out make it less."""


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands with each object that moves, in the world."""
    record = read_record(clip.path)
    numbers = record.integers("mocap_frame_id_list")
    steps = np.diff(numbers)
    if not numbers or (steps <= 0).any() or numbers[-1] - numbers[0] > FRAME_LIMIT:
        raise record.refuse("mocap_frame_id_list", "frame numbers that rise")
    stride = int(np.median(steps)) if len(steps) else 1
    # Numbers that are left out are a gap in time: they stay frames, without hand or object.
    frames = {number: t for t, number in enumerate(range(numbers[0], numbers[-1] + 1, stride))}
    hands = [read_hand(record.record("raw_mano"), side, frames) for side in ("right", "left")]
    for item in record.texts("obj_list"):
        places = record.record("obj_transf").record(item)
        poses = {t: places.array(n, (4, 4)) for n, t in frames.items() if n in places}
        motion = by_frame(poses, len(frames), 4, 4)
        if not np.isfinite(motion).all((1, 2)).any():
            continue
        name = "".join(c if c.isalnum() else "_" for c in item)
        yield base.ClipParts(
            f"OakInk2 {clip.name} {item}",
            hands,
            {f"oakink2_{name}": find_mesh(mesh_files(item, clip.path, options), item)},
            motion,
            name=f"{clip.name}_{name}",
            fps=CAPTURE_FPS / stride,
        )


def read_hand(hands: Record, side: Side, frames: dict[int, int]) -> base.ManoParameters:
    """One hand; NaN in the frames that lack it."""
    prefix = f"{side[0]}h__"
    steps = {
        t: as_record(hands.values[number], f"{hands.where} {number}")
        for number, t in frames.items()
        if hands.values.get(number) is not None
    }
    names = [f"{prefix}{name}" for name in ("pose_coeffs", "tsl", "betas")]
    steps = {t: step for t, step in steps.items() if step.values.get(names[0]) is not None}
    return hand_by_frame(side, steps, len(frames), *names, quaternions=True)


def mesh_files(item: str, path: Path, options: base.ReaderOptions) -> list[Path]:
    """Where an object's mesh may be, which is used as it is."""
    root = path.parents[1]
    name = item.replace("..", "_").replace("/", "_")
    folders = [root / kind / "align_ds" / name for kind in ("object_raw", "object_repair")]
    if options.objects is not None:
        folders.insert(0, options.objects / name)
    files = [
        file
        for folder in folders
        if folder.is_dir()
        for file in sorted(folder.iterdir())
        if file.suffix in (".obj", ".ply")
    ]
    return [*files, folders[0] / f"{name}.obj"]


READER = DatasetReader(
    parts,
    ("*.pkl",),
    choose=lambda found, path: (file for file in found if file.parent.name == "anno_preview"),
    content="an object with poses",
)
