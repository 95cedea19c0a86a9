"""FPHAB with Hasson's fits: Subject_{k}/{action}/{rep}/ below fhbhands_fits and the annotations.

pkls.pkl holds a dict of frames with fullpose (48,) absolute, trans (3,) of convention O in metres
and shape, in the colour camera's frame; object_pose.txt a frame number and a 4x4 in columns,
millimetres; skeleton.txt keypoints in FPHAB's order, millimetres, which the camera's extrinsic
takes to it. Object models are in metres. Right hands, 30 frames a second.
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
    recordings,
    sequence_of,
)
from geneoh.readers.joint_orders import ORDERS
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import FRAME_LIMIT, Array, frame_number, read_numbers, read_record

CONVENTION = ManoConvention(origin=True)
FPS = 30.0
MILLIMETRES = 0.001
OBJECTS = {"juice": "juice_bottle", "liquid_soap": "liquid_soap", "milk": "milk", "salt": "salt"}
"""Objects with poses, by what the action's name says."""
EXTRINSIC = np.array(
    [
        [0.999988496304, -0.00468848412856, 0.000982563360594, 25.7],
        [0.00469115935266, 0.999985218048, -0.00273845880292, 1.22],
        [-0.000969709653873, 0.00274303671904, 0.99999576807, 3.902],
        [0, 0, 0, 1],
    ]
)
"""Depth to colour camera, millimetres, from the data set's README."""
SENSOR_TOLERANCE = 0.04
"""Metres between the magnetic sensors' keypoints, which lie on the skin, and a fit of MANO."""
OPENPOSE_FROM_F = ORDERS["fphab"].entries


def find(path: Path) -> list[SourceClip]:
    """Every repetition that has fits."""
    files = sorted(path.rglob("pkls.pkl")) if path.is_dir() else [path]
    return [
        SourceClip(clip_name(file.parent, 3), file.parent)
        for file in files
        if file.name == "pkls.pkl"
    ]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """The right hand and its object, in the colour camera's frame."""
    record = read_record(clip.path / "pkls.pkl")
    fits = {frame_number(Path(str(key))): record.record(key) for key in record.values}
    if not fits:
        raise InputError(f"{record.where}: expected frames, got none; copy it again")
    root, way = clip.path.parents[3], Path(*clip.path.parts[-3:])
    placed = read_objects(annotation(root, "Object_6D_pose_annotation_v1", way, "object_pose.txt"))
    frames = max(*fits, *placed) + 1
    pose, trans = np.full((frames, 48), np.nan), np.full((frames, 3), np.nan)
    for frame, fit in fits.items():
        pose[frame], trans[frame] = fit.array("fullpose", (48,)), fit.array("trans", (3,))
    betas = np.mean([fit.array("shape", (10,)) for fit in fits.values()], axis=0)
    motion = np.full((frames, 4, 4), np.nan)
    for frame, matrix in placed.items():
        motion[frame] = EXTRINSIC @ matrix
    motion[:, :3, 3] *= MILLIMETRES
    joints = read_skeleton(root, way, frames)
    name = next((full for part, full in OBJECTS.items() if part in clip.path.parent.name), None)
    if name is None:
        raise InputError(f"{clip.path}: expected an action with juice, soap, milk or salt")
    folder = (known.objects or root / "Object_models") / f"{name}_model"
    mesh = read_mesh(find_mesh([folder / f"{name}_model.ply"], name))
    sequence = sequence_of(
        [mano_track(ManoParameters("right", pose, trans, betas), CONVENTION, known, record.where)],
        object_track([mesh], motion[:, None]),
        known.rate(FPS),
        f"FPHAB {clip.name} (fits of Hasson et al.)",
    )
    return recordings(
        clip.name,
        sequence,
        object_known=finite_frames(motion),
        mesh_names=(f"fphab_{name}",),
        evidence=CrossChecks(
            joints={} if joints is None else {"right": joints}, tolerance=SENSOR_TOLERANCE
        ),
    )


def annotation(root: Path, folder: str, way: Path, file: str) -> Path:
    """An annotation's file; the folder's name comes with and without _1."""
    places = [root / f"{folder}{ending}" / way / file for ending in ("_1", "")]
    return next((place for place in places if place.is_file()), places[0])


def read_objects(path: Path) -> dict[int, Array]:
    """4x4 object to depth camera in millimetres, by frame."""
    return {int(row[0]): row[1:].reshape(4, 4).T for row in frame_rows(path, 17)}


def frame_rows(path: Path, count: int) -> Array:
    """Rows that start with a frame's number."""
    rows = read_numbers(path, count)
    first = rows[:, 0]
    if not (np.isfinite(first) & (first >= 0) & (first < FRAME_LIMIT)).all():
        raise InputError(f"{path}: expected frame numbers in front, got {first[:3]}; copy it again")
    return rows


def read_skeleton(root: Path, way: Path, frames: int) -> Array | None:
    """(T, 21, 3) annotated keypoints in the colour camera's frame, metres."""
    path = annotation(root, "Hand_pose_annotation_v1", way, "skeleton.txt")
    if not path.is_file():
        return None
    joints = np.full((frames, 21, 3), np.nan)
    for row in frame_rows(path, 64):
        if row[0] < frames:
            points = row[1:].reshape(21, 3)[list(OPENPOSE_FROM_F)]
            joints[int(row[0])] = points @ EXTRINSIC[:3, :3].T + EXTRINSIC[:3, 3]
    return joints * MILLIMETRES
