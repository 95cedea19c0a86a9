"""OakInk's image set and OakInk2 as they are distributed.

Both: (16, 4) quaternions wxyz, absolute pose, translation of the wrist in the world, metres; object
poses are object to world.

OakInk: image/anno/general_info/{seq}__{ts}__{sbj}__{frame}__{cam}. hand_anno holds hand_pose,
hand_shape and hand_tsl; obj_anno is for the mesh with its bounding box centred; cam_extr is world
to camera, which is the frame of hand_j. Right hands only, 30 frames a second.

OakInk2: anno_preview/{seq}.pkl, one pickle for each sequence. raw_mano[frame] holds rh__ and lh__
pose_coeffs, tsl and betas as torch tensors, left hand as shipped; obj_transf[object][frame]. Frames
are numbered by the motion capture, 120 a second; missing numbers are gaps in time.
"""

from collections.abc import Iterable
from dataclasses import replace
from glob import escape
from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers import base, builders, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import by_frame, field_by_frame, read_array, read_record
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import FRAME_LIMIT, Array, Record, as_record

CAPTURE_FPS = 120.0
"""Frame rate of OakInk2's motion capture; annotations with a stride have a lower one."""


def _sequences(found: Iterable[Path], path: Path) -> Iterable[Path]:
    """For the annotation file of each frame, the path of its sequence and person."""
    for file in found:
        words = _words_of(file)
        if file.parent.name == "general_info" and len(words) == 5:
            yield file.with_name("__".join(words[:3]))


@reads("*__*__*__*__*.pkl", choose=_sequences, takes=("objects",))
def oakink(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """One person's hand and the object, in the world, from whichever camera has each frame."""
    folder, name = clip.path.parent, clip.path.name
    files: dict[int, Path] = {}
    for file in sorted(folder.glob(f"{escape(name)}__*.pkl")):
        frame = _words_of(file)[3]
        if frame.isdecimal() and int(frame) < FRAME_LIMIT:
            files.setdefault(int(frame), file)
    if not files:
        raise InputError(f"{clip.path}: expected frames of this sequence, got none")
    frames = max(files) + 1
    records = {frame: read_record(file) for frame, file in files.items()}
    hands = {frame: record.record("hand_anno") for frame, record in records.items()}
    places = {frame: folder.parent / "hand_j" / file.name for frame, file in files.items()}
    stored = {frame: _read_joints(file, records[frame]) for frame, file in places.items()}
    joints = by_frame(stored, frames, 21, 3)
    names = ("hand_pose", "hand_tsl", "hand_shape")
    hand = builders.hand_by_frame("right", hands, frames, *names, quaternions=True)
    item = _words_of(clip.path)[0].split("_")[0]
    models = options.objects or folder.parents[1] / "obj"
    meshes = [models / f"{item}{ending}" for ending in (".obj", ".ply")]
    hand = replace(hand, joints=builders.joints_if_complete(joints, hand.translation))
    named = {f"oakink_{item}": find_mesh(meshes, item, centred=True)}
    motion = field_by_frame(records, "obj_anno", frames, 4, 4)
    checks = base.CrossChecks({"right": joints})
    yield base.ClipParts(f"OakInk {name}", [hand], named, motion, cross_checks=checks)


def _words_of(path: Path) -> list[str]:
    """Sequence, time stamp, person, frame and camera out of a file's name."""
    return path.stem.split("__")


def _read_joints(file: Path, record: Record) -> Array:
    """(21, 3) keypoints in the world; NaN without the file of them."""
    if not file.is_file():
        return np.full((21, 3), np.nan)
    joints = read_array(file, (21, 3))
    to_world = transforms.inverse(record.array("cam_extr", (4, 4)), record.where)
    return transforms.moved_points(joints, to_world)


@reads(
    "*.pkl",
    choose=lambda found, path: (file for file in found if file.parent.name == "anno_preview"),
    content="an object with poses",
    takes=("objects",),
)
def oakink2(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands with each object that moves, in the world."""
    record = read_record(clip.path)
    numbers = record.integers("mocap_frame_id_list")
    steps = np.diff(numbers)
    if not numbers or (steps <= 0).any() or numbers[-1] - numbers[0] > FRAME_LIMIT:
        raise record.refuse("mocap_frame_id_list", "frame numbers that rise")
    stride = int(np.median(steps)) if len(steps) else 1
    # the nearest frame of each number: missing numbers leave gaps
    frames = {number: round((number - numbers[0]) / stride) for number in numbers}
    if len(set(frames.values())) < len(frames):
        raise record.refuse("mocap_frame_id_list", f"frame numbers about {stride} apart")
    count = max(frames.values()) + 1
    stored = record.record("raw_mano")
    hands = [_read_hand(stored, side, frames, count) for side in ("right", "left")]
    for item in record.texts("obj_list"):
        places = record.record("obj_transf").record(item)
        poses = {t: places.array(n, (4, 4)) for n, t in frames.items() if n in places}
        motion = by_frame(poses, count, 4, 4)
        if not np.isfinite(motion).all((1, 2)).any():
            continue
        name = "".join(c if c.isalnum() else "_" for c in item)
        meshes = {f"oakink2_{name}": find_mesh(_mesh_files(item, clip.path, options), item)}
        how = {"name": f"{clip.name}_{name}", "fps": CAPTURE_FPS / stride}
        yield base.ClipParts(f"OakInk2 {clip.name} {item}", hands, meshes, motion, **how)


def _read_hand(
    hands: Record, side: Side, frames: dict[int, int], count: int
) -> base.ManoParameters:
    """One hand in `count` frames; NaN in those that lack it."""
    there = {n: t for n, t in frames.items() if hands.values.get(n) is not None}
    steps = {t: as_record(hands.values[n], f"{hands.where} {n}") for n, t in there.items()}
    names = [f"{side[0]}h__{name}" for name in ("pose_coeffs", "tsl", "betas")]
    steps = {t: step for t, step in steps.items() if step.values.get(names[0]) is not None}
    return builders.hand_by_frame(side, steps, count, *names, quaternions=True)


def _mesh_files(item: str, path: Path, options: base.ReaderOptions) -> list[Path]:
    """Candidate files of an object's mesh, which is used without scaling or centring."""
    root = path.parents[1]
    name = item.replace("..", "_").replace("/", "_")
    folders = [root / kind / "align_ds" / name for kind in ("object_raw", "object_repair")]
    if options.objects is not None:
        folders.insert(0, options.objects / name)
    found = [file for folder in folders if folder.is_dir() for file in sorted(folder.iterdir())]
    meshes = [file for file in found if file.suffix in (".obj", ".ply")]
    return [*meshes, folders[0] / f"{name}.obj"]
