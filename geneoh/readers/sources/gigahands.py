"""GigaHands: a file of poses for each object of a recording, and files of the recording's hands.

hand_poses/{session}/: params/{n}.json has poses (N, 48), Rh (N, 3), Th (N, 3) and shapes (1, 10)
of "left" and "right", left hand as shipped. As in EasyMocap, fingers are relative to MANO's mean
pose, and Rh turns the hand about MANO's origin before Th moves it. The rows are the frames of the
video in keypoints_3d/{n}/chosen_frames_{left,right}.json, both lists merged.
keypoints_3d_mano_align/{n}.json: (N, 42, 3) keypoints of these hands, the left one first.

object_poses/{scene}/{object}/{session}_{n}/pose/optimized_pose.json: for some frames of the video,
by number, mesh_translation and mesh_rotation, the quaternion wxyz of the inverse rotation. Meshes
are in object_meta/ or scans_publish/{scene}/{object}/. In the demo, hand_pose(s)/ and
object_pose(s)/ have a folder {session}-{n} each, the latter with mesh/ and pose/. Metres, 30 frames
a second.
"""

import re
from pathlib import Path

import numpy as np

from geneoh.choices import SIDES, Side
from geneoh.errors import InputError
from geneoh.geometry.mesh_files import MESH_SUFFIXES
from geneoh.readers import base, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import by_frame, read_json
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import FRAME_LIMIT, Array, Record, as_record

HANDS = ("hand_poses", "hand_pose", "handposes")
"""Names of the folder of hands."""
MESHES = ("object_meta", "scans_publish")
"""Names of the folder of meshes."""
LONGEST_GAP = 30
"""Most frames between two poses of an object that are interpolated: a second."""
FIT_TOLERANCE = 0.01
"""Largest error in metres of the stored keypoints, which EasyMocap takes from other vertices."""


@reads(
    "optimized_pose.json",
    clip_is_folder=True,
    name_parts=3,
    name_above=1,
    convention=base.ManoConvention("wrist", mean_added=True),
    takes=("objects",),
)
def gigahands(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands with one object, in the frames from its first pose to its last."""
    folder = clip.path.parent
    files, number = hand_files(folder)
    poses, first = object_poses(clip.path / "optimized_pose.json")
    frames = len(poses)
    rows = rows_by_frame(files / "keypoints_3d" / number, first, frames)
    path = files / "params" / f"{number}.json"
    params = as_record(read_json(path), str(path))
    count = max(len(params.record(side).array("Th", ("T", 3))) for side in SIDES)
    points = stored_points(files / "keypoints_3d_mano_align" / f"{number}.json", count)
    joints: dict[Side, Array] = {
        side: placed(each, rows[side], frames, path) for side, each in points.items()
    }
    hands = [read_hand(params.record(s), s, rows[s], frames, joints.get(s), options) for s in SIDES]
    mesh = find_mesh(mesh_files(folder, options), folder.parent.name)
    name = folder.parent.name if mesh.source is None else mesh.source.stem
    yield base.ClipParts(
        f"GigaHands {clip.name}",
        hands,
        {f"gigahands_{base.fit_for_name(name)}": mesh},
        poses,
        object_known=near(np.flatnonzero(base.finite_frames(poses)), frames),
        cross_checks=base.CrossChecks(joints, tolerance=FIT_TOLERANCE),
        first=first,
    )


def hand_files(folder: Path) -> tuple[Path, str]:
    """The folder of the hands of a recording, and the recording's number in three digits."""
    words = re.fullmatch(r"(.+)[_-](\d{1,6})", folder.name)
    if words is None:
        raise InputError(
            f"{folder}: expected a folder named by session and number, such as "
            "p003-instrument_0033, got another name; rename it as it is distributed"
        )
    number = f"{int(words[2]):03d}"
    roots = [above / name for above in folder.parents[:5] for name in HANDS]
    places = [root / name for root in roots for name in (words[1], folder.name)]
    for place in places:
        if (place / "params" / f"{number}.json").is_file():
            return place, number
    raise InputError(
        f"{folder}: expected its hands in hand_poses/{words[1]}/params/{number}.json beside "
        f"{folder.parents[2].name}/, got no such file; unpack hand_poses.tar.gz there"
    )


def object_poses(path: Path) -> tuple[Array, int]:
    """(T, 4, 4) object to world from its first pose on, NaN between poses; the first's number."""
    record = as_record(read_json(path), str(path))
    if not record.values or not all(re.fullmatch(r"\d{1,9}", str(name)) for name in record.values):
        raise InputError(f"{path}: expected poses by the number of the frame, got none; copy it")
    numbers = {int(name): record.record(name) for name in record.values}
    first, last = min(numbers), max(numbers)
    if last - first >= FRAME_LIMIT:
        raise InputError(f"{path}: expected {FRAME_LIMIT} frames at most; copy it again")
    found = {number - first: pose_of(each) for number, each in numbers.items()}
    return by_frame(found, last - first + 1, 4, 4), first


def pose_of(record: Record) -> Array:
    """(4, 4) pose of an object in one frame; NaN where its quaternion is none."""
    rotation = record.array("mesh_rotation", (4,), (3,))
    turn = rotation[None] if len(rotation) == 3 else -transforms.axis_angles_of_wxyz(rotation[None])
    shift = record.array("mesh_translation", (3,))
    return transforms.rigid_matrices(transforms.rotation_matrices(turn)[0], shift)


def rows_by_frame(folder: Path, first: int, frames: int) -> dict[Side, dict[int, int]]:
    """For each hand, the row of each of the frames in which it was tracked."""
    chosen = {}
    for side in SIDES:
        path = folder / f"chosen_frames_{side}.json"
        chosen[side] = set(Record(str(path), {"frames": read_json(path)}).integers("frames"))
    merged = sorted(set().union(*chosen.values()))
    at = {frame: row for row, frame in enumerate(merged) if 0 <= frame - first < frames}
    return {
        side: {frame - first: row for frame, row in at.items() if frame in chosen[side]}
        for side in SIDES
    }


def stored_points(path: Path, count: int) -> dict[Side, Array]:
    """(N, 21, 3) stored keypoints of each hand; none without their file."""
    if not path.is_file():
        return {}
    record = Record(str(path), {"keypoints": read_json(path)})
    points = record.array("keypoints", (count, 42, 3), (count, 126)).reshape(count, 2, 21, 3)
    return {side: points[:, index] for index, side in enumerate(("left", "right"))}


def placed(values: Array, rows: dict[int, int], frames: int, path: Path) -> Array:
    """(T, ...) rows of values at their frames, NaN in others."""
    if max(rows.values(), default=0) >= len(values):
        raise InputError(
            f"{path}: expected {max(rows.values()) + 1} rows or more, as the chosen frames in "
            f"keypoints_3d say, got {len(values)}; its files are of different versions"
        )
    return by_frame({t: values[row] for t, row in rows.items()}, frames, *values.shape[1:])


def read_hand(
    record: Record,
    side: Side,
    rows: dict[int, int],
    frames: int,
    joints: Array | None,
    options: base.ReaderOptions,
) -> base.ManoParameters:
    """One hand in the world; stored keypoints count where there is no MANO to compute them."""
    path = Path(record.where)
    pose, turn, shift = (
        placed(record.array(name, ("T", width)), rows, frames, path)
        for name, width in (("poses", 48), ("Rh", 3), ("Th", 3))
    )
    betas = record.array("shapes", ("T", 10)).mean(0)
    mano = options.mano(side)
    whole = transforms.rotation_matrices(turn)
    if mano is not None:
        shift = shift + whole @ mano.wrist_offset(betas)
    orientation = transforms.axis_angles(whole @ transforms.rotation_matrices(pose[:, :3]))
    pose = np.concatenate([orientation, pose[:, 3:]], axis=1)
    return base.ManoParameters(side, pose, shift, betas, joints if mano is None else None)


def near(known: Array, frames: int) -> Array:
    """(T,) mask of the frames with a known pose, or between two that are close in time."""
    mask = np.zeros(frames, bool)
    for start, end in zip(known, [*known[1:], frames - 1], strict=True):
        mask[start : end + 1 if end - start <= LONGEST_GAP else start + 1] = True
    return mask


def mesh_files(folder: Path, options: base.ReaderOptions) -> list[Path]:
    """Candidate files of an object's mesh, in whose folder's name "-" may stand for "_"."""
    scene, item = folder.parents[1].name, folder.parent.name
    roots = [above / name for above in folder.parents[:5] for name in MESHES]
    if options.objects is not None:
        roots = [options.objects, *roots]
    folders = [root / scene / name for root in roots for name in (item, item.replace("_", "-"))]
    found = [
        file
        for each in (folder / "mesh", *folders)
        if each.is_dir()
        for file in sorted(each.iterdir())
        if file.suffix.lower() in MESH_SUFFIXES
    ]
    return [*found, folders[0] / f"{item}.obj"]
