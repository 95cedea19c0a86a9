"""OakInk's image set as it is distributed:
image/anno/general_info/{seq}__{ts}__{sbj}__{frame}__{cam}.

hand_anno holds hand_pose (16, 4) quaternions with the real part first, hand_shape and hand_tsl in
the world (convention W, absolute pose); obj_anno is object to world, for the mesh with its bounding
box centred; cam_extr is world to camera, in which hand_j stands. Right hands only, metres, 30
frames a second.
"""

from pathlib import Path

import numpy as np

from geneoh.errors import InputError
from geneoh.readers.base import (
    CrossChecks,
    ReaderOptions,
    Recording,
    SourceClip,
    clip_name,
    finite_frames,
)
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    mano_track,
    object_track,
    quats_wxyz,
    recordings,
    sequence_of,
)
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import FRAME_LIMIT, Array, Record, read_array, read_record

CONVENTION = ManoConvention(origin=False)
FPS = 30.0


def find(path: Path) -> list[SourceClip]:
    """Every person in every sequence."""
    folders = path.rglob("general_info") if path.is_dir() else []
    return [
        SourceClip(clip_name(Path("__".join(key)), 1), folder / "__".join(key))
        for folder in sorted(folders)
        for key in sorted({key_of(p)[:3] for p in folder.glob("*.pkl") if len(key_of(p)) == 5})
    ]


def key_of(path: Path) -> tuple[str, ...]:
    """Sequence, time stamp, person, frame and camera out of a file's name."""
    return tuple(path.stem.split("__"))


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """One person's hand and the object, in the world, from whichever camera has each frame."""
    folder, name = clip.path.parent, clip.path.name
    chosen: dict[int, Path] = {}
    for file in sorted(folder.glob(f"{glob_safe(name)}__*.pkl")):
        frame = key_of(file)[3]
        if frame.isdigit() and int(frame) < FRAME_LIMIT:
            chosen.setdefault(int(frame), file)
    if not chosen:
        raise InputError(f"{clip.path}: expected frames of this sequence, got none; download them")
    frames = max(chosen) + 1
    pose, trans = np.full((frames, 16, 3), np.nan), np.full((frames, 3), np.nan)
    motion, joints = np.full((frames, 4, 4), np.nan), np.full((frames, 21, 3), np.nan)
    betas = []
    for frame, file in chosen.items():
        record = read_record(file)
        hand = record.record("hand_anno")
        pose[frame] = quats_wxyz(hand.array("hand_pose", (16, 4)))
        trans[frame] = hand.array("hand_tsl", (3,))
        betas.append(hand.array("hand_shape", (10,)))
        motion[frame] = record.array("obj_anno", (4, 4))
        joints[frame] = read_joints(folder.parent / "hand_j" / file.name, record)
    complete = np.isfinite(joints[np.isfinite(trans).all(1)]).all()
    numbers = ManoParameters(
        "right",
        pose.reshape(frames, 48),
        trans,
        np.mean(betas, axis=0),
        joints=joints if complete else None,
    )
    track = mano_track(numbers, CONVENTION, known, str(clip.path))
    item = key_of(clip.path)[0].split("_")[0]
    models = known.objects or folder.parents[1] / "obj"
    places = [models / f"{item}{ending}" for ending in (".obj", ".ply")]
    mesh = read_mesh(find_mesh(places, item), centred=True)
    sequence = sequence_of(
        [track], object_track([mesh], motion[:, None]), known.rate(FPS), f"OakInk {name}"
    )
    return recordings(
        clip.name,
        sequence,
        object_known=finite_frames(motion),
        mesh_names=(f"oakink_{item}",),
        evidence=CrossChecks(joints={"right": joints}),
    )


def glob_safe(name: str) -> str:
    """A name without the characters that a pattern would read."""
    return "".join(f"[{c}]" if c in "*?[" else c for c in name)


def read_joints(file: Path, record: Record) -> Array:
    """(21, 3) keypoints in the world; NaN without the file of them."""
    if not file.is_file():
        return np.full((21, 3), np.nan)
    joints = read_array(file, (21, 3))
    to_world = np.linalg.inv(record.array("cam_extr", (4, 4)))
    return joints @ to_world[:3, :3].T + to_world[:3, 3]
