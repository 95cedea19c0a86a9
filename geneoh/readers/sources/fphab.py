"""FPHAB with Hasson's fits: Subject_{k}/{action}/{rep}/ below fhbhands_fits and the annotations.

pkls.pkl holds a dict of frames with fullpose (48,) absolute, trans (3,) of MANO's origin in metres
and shape, in the colour camera's frame. Each row of object_pose.txt is a frame number and a 4x4
matrix in column-major order, each row of skeleton.txt a frame number and keypoints in FPHAB's
order; both are in millimetres, and `EXTRINSIC` maps both to the colour camera's frame. Object
models are in metres. Right hands, 30 frames a second.
"""

from pathlib import Path

import numpy as np

from geneoh.errors import InputError
from geneoh.geometry.mesh import METRES
from geneoh.readers import base, builders, joint_orders
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import by_frame, frame_number, read_numbers, read_record
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import FRAME_LIMIT, Array
from geneoh.readers.transforms import moved_points

OBJECTS = {"juice": "juice_bottle", "liquid_soap": "liquid_soap", "milk": "milk", "salt": "salt"}
"""Objects with poses, by the word for them in the action's name."""
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
"""Largest distance in metres of the magnetic sensors' keypoints, on the skin, from MANO's fit."""


@reads("pkls.pkl", clip_is_folder=True, name_parts=3, convention=base.ORIGIN, takes=("objects",))
def fphab(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The right hand and its object, in the colour camera's frame."""
    record = read_record(clip.path / "pkls.pkl")
    fits = {frame_number(Path(str(key))): record.record(key) for key in record.values}
    if not fits:
        raise InputError(f"{record.where}: expected frames, got none; copy it again")
    root, way = base.ancestor(clip.path, 4), Path(*clip.path.parts[-3:])
    objects = annotation(root, "Object_6D_pose_annotation_v1", way, "object_pose.txt")
    placed = {t: row.reshape(4, 4).T for t, row in frame_rows(objects, 16).items()}
    frames = max(*fits, *placed) + 1
    motion = by_frame({t: EXTRINSIC @ pose for t, pose in placed.items()}, frames, 4, 4)
    motion[:, :3, 3] *= METRES["mm"]
    name = next((full for part, full in OBJECTS.items() if part in clip.path.parent.name), None)
    if name is None:
        raise InputError(f"{clip.path}: expected an action with juice, soap, milk or salt")
    folder = (options.objects or root / "Object_models") / f"{name}_model"
    hand = builders.hand_by_frame("right", fits, frames, "fullpose", "trans", "shape")
    joints = base.by_side("right", read_skeleton(root, way, frames))
    checks = base.CrossChecks(joints, tolerance=SENSOR_TOLERANCE)
    meshes = {f"fphab_{name}": find_mesh([folder / f"{name}_model.ply"], name)}
    source = f"FPHAB {clip.name} (fits of Hasson et al.)"
    yield base.ClipParts(source, [hand], meshes, motion, cross_checks=checks)


def annotation(root: Path, folder: str, way: Path, file: str) -> Path:
    """An annotation's file; the folder's name comes with and without _1."""
    places = [root / f"{folder}{ending}" / way / file for ending in ("_1", "")]
    return next((place for place in places if place.is_file()), places[0])


def frame_rows(path: Path, count: int) -> dict[int, Array]:
    """Rows of `count` numbers, by the frame number in front of them."""
    rows = read_numbers(path, 1 + count)
    first = rows[:, 0]
    if not (np.isfinite(first) & (first >= 0) & (first < FRAME_LIMIT)).all():
        raise InputError(f"{path}: expected frame numbers in front, got {first[:3]}; copy it again")
    return {int(row[0]): row[1:] for row in rows}


def read_skeleton(root: Path, way: Path, frames: int) -> Array | None:
    """(T, 21, 3) annotated keypoints in the colour camera's frame, metres."""
    path = annotation(root, "Hand_pose_annotation_v1", way, "skeleton.txt")
    if not path.is_file():
        return None
    rows = {t: row.reshape(21, 3) for t, row in frame_rows(path, 63).items()}
    joints, _ = joint_orders.openpose_order(by_frame(rows, frames, 21, 3), "fphab")
    return moved_points(joints, EXTRINSIC) * METRES["mm"]
