"""HOI4D as it is distributed, rigid and articulated: hands and object in a moving camera's frame.

handpose/refinehandpose_{side}/{seq}/{frame}.pickle, HOI4D_annotations/{seq}/objpose/{frame}.json
and 3Dseg/output.log, HOI4D_CAD_Model_for_release/{rigid/{Category}/{NNN}.obj,
articulated/{Category}/{NNN}/objs/new-{k}-align.obj}. Convention O, absolute pose, metres, 15 frames
a second; a missing hand file is a frame without that hand. The camera's poses take all to the
world.
"""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
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
    Track,
    hand_in,
    mano_track,
    object_track,
    recordings,
    sequence_of,
)
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import (
    Array,
    Record,
    as_record,
    frame_number,
    read_json,
    read_record,
    read_text,
)

CONVENTION = ManoConvention(origin=True)
FPS = 15.0
CATEGORIES = {
    **{1: "ToyCar", 2: "Mug", 3: "Laptop", 4: "StorageFurniture", 5: "Bottle", 6: "Safe"},
    **{7: "Bowl", 8: "Bucket", 9: "Scissors", 11: "Pliers", 12: "Kettle", 13: "Knife"},
    **{14: "TrashCan", 17: "Lamp", 18: "Stapler", 20: "Chair"},
}
SIDES: tuple[Side, Side] = ("right", "left")
SWAPPED = ("Laptop", "Scissors")
"""Their first pose belongs to part 1, their second to part 0."""


def find(path: Path) -> list[SourceClip]:
    """Every sequence that has object poses."""
    folders = sorted({p.parent for p in path.rglob("objpose")}) if path.is_dir() else []
    return [SourceClip(clip_name(folder, 7), folder) for folder in folders]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Both hands and the object's parts, in the world where the camera's poses are there."""
    parts = clip.path.parts[-7:]
    if len(clip.path.parents) < 9:
        raise InputError(f"{clip.path}: expected .../HOI4D_annotations/ZY.../H*/C*/N*/S*/s*/T*")
    root = clip.path.parents[7]
    files = {frame_number(p): p for p in (clip.path / "objpose").glob("*.json")}
    hands: dict[Side, dict[int, Path]] = {side: hand_files(root, side, parts) for side in SIDES}
    numbers = [frame for found in (files, *hands.values()) for frame in found]
    if not numbers:
        raise InputError(f"{clip.path}: expected frames in objpose, got none; download them")
    frames = max(numbers) + 1
    poses = read_poses(files, frames)
    present = finite_frames(poses)
    tracks = [read_hand(found, side, frames, known) for side, found in hands.items() if found]
    cameras, notes = read_cameras(clip.path / "3Dseg/output.log", frames)
    said: list[str] = []
    if cameras is not None:
        said += wrong_cameras(cameras[present], poses[present])
        tracks = [(hand_in(hand, cameras), more) for hand, more in tracks]
        poses = cameras[:, None] @ poses
    category, meshes = read_meshes(parts, poses.shape[1], root, known)
    sequence = sequence_of(
        tracks, object_track(meshes, poses), known.rate(FPS), f"HOI4D {clip.name}", *notes
    )
    names = tuple(f"hoi4d_{category}_{parts[3]}_{k}" for k in range(len(meshes)))
    said += wrong_order(meshes, poses[present])
    return recordings(
        clip.name,
        sequence,
        object_known=present,
        mesh_names=names,
        evidence=CrossChecks(said=tuple(said)),
    )


def hand_files(root: Path, side: Side, parts: tuple[str, ...]) -> dict[int, Path]:
    """The files of one hand by frame; their numbers come with and without leading zeros."""
    folder = root / "handpose" / f"refinehandpose_{side}" / Path(*parts)
    return {frame_number(path): path for path in folder.glob("*.pickle")}


def read_hand(files: dict[int, Path], side: Side, frames: int, known: ReaderOptions) -> Track:
    """One hand in the camera's frame."""
    pose, trans, betas = np.full((frames, 48), np.nan), np.full((frames, 3), np.nan), []
    for frame, path in files.items():
        record = read_record(path)
        pose[frame] = record.array("poseCoeff", (48,))
        trans[frame] = record.array("trans", (3,))
        betas.append(record.array("beta", (10,)))
    where = str(next(iter(files.values())).parent)
    return mano_track(
        ManoParameters(side, pose, trans, np.mean(betas, axis=0)), CONVENTION, known, where
    )


def read_poses(files: dict[int, Path], frames: int) -> Array:
    """(T, Q, 4, 4) of the parts to the camera; NaN where there is no file."""
    parts = {frame: pose_list(path) for frame, path in files.items()}
    count = max((len(found) for found in parts.values()), default=0)
    if not count:
        raise InputError("objpose: expected files with 'dataList', got none; download them")
    poses = np.full((frames, count, 4, 4), np.nan)
    for frame, found in parts.items():
        if len(found) == count:
            poses[frame] = np.stack([part_pose(part) for part in found])
    return poses


def pose_list(path: Path) -> list[Record]:
    """The parts in one annotation, named dataList or, in older files, objects; none where it says
    that it is not effective."""
    record = as_record(read_json(path), str(path))
    if "isEffective" in record and record.number("isEffective") == 0:
        return []
    items = record.items("dataList" if "dataList" in record else "objects")
    return [as_record(item, f"{path} part {index}") for index, item in enumerate(items)]


def part_pose(part: Record) -> Array:
    """(4, 4) of one part: v_camera = R v + centre, R from intrinsic XYZ angles."""
    centre, turn = part.record("center"), part.record("rotation")
    pose = np.eye(4)
    angles = [turn.number(axis) for axis in "xyz"]
    pose[:3, :3] = Rotation.from_euler("XYZ", angles).as_matrix()
    pose[:3, 3] = [centre.number(axis) for axis in "xyz"]
    return pose


def read_cameras(path: Path, frames: int) -> tuple[Array | None, tuple[str, ...]]:
    """(T, 4, 4) camera to world, as the blocks of an Open3D trajectory stand in the file.

    Each block is a heading of three numbers and the four rows of its matrix.
    """
    if not path.is_file():
        return None, ("camera frame: there are no camera poses",)
    rows = [line.split() for line in read_text(path).splitlines() if line.strip()]
    if len(rows) < 5 * frames:
        return None, (f"camera frame: camera poses of {len(rows) // 5} of {frames} frames",)
    try:
        blocks = [rows[5 * t + 1 : 5 * t + 5] for t in range(frames)]
        cameras = np.array(blocks, dtype=np.float64).reshape(frames, 4, 4)
    except ValueError:
        raise InputError(f"{path}: expected an Open3D trajectory; it is damaged") from None
    if not np.allclose(cameras[:, 3], [0, 0, 0, 1], atol=1e-3):
        raise InputError(f"{path}: expected 4x4 matrices that end in 0 0 0 1; it is damaged")
    return cameras, ()


def read_meshes(
    parts: tuple[str, ...], count: int, root: Path, known: ReaderOptions
) -> tuple[str, list[Mesh]]:
    """The category and the mesh of each pose, in the order of the poses."""
    category = CATEGORIES.get(frame_number(Path(parts[2])), parts[2])
    models = known.objects or root / "HOI4D_CAD_Model_for_release"
    instance = f"{frame_number(Path(parts[3])):03d}"
    if count == 1:
        rigid = [models / kind / category / f"{instance}.obj" for kind in ("rigid", ".")]
        return category, [read_mesh(find_mesh(rigid, f"{category} {instance}"))]
    swapped = (category in SWAPPED) != known.swap_parts
    order = reversed(range(count)) if swapped else range(count)
    folder = models / "articulated" / category / instance / "objs"
    files = [find_mesh([folder / f"new-{k}-align.obj"], f"{category} {instance}") for k in order]
    return category, [read_mesh(file) for file in files]


def wrong_order(meshes: list[Mesh], poses: Array) -> list[str]:
    """Whether two parts come together only with their poses exchanged."""
    if len(meshes) != 2 or not len(poses):
        return []
    apart, exchanged = (widest_gap(pair, poses) for pair in (meshes, meshes[::-1]))
    if apart > 0.02 and exchanged < 0.5 * apart:
        return [
            f"parts: the two parts come {1000 * apart:.0f} mm apart, and {1000 * exchanged:.0f} mm "
            "with their poses exchanged: the order of the parts is the other one here, "
            "pass --swap-parts",
        ]
    return []


def wrong_cameras(cameras: Array, poses: Array) -> list[str]:
    """Whether the object moves less with the camera's poses taken as world to camera."""
    if len(cameras) < 3:
        return []
    inverse = np.linalg.inv(cameras)
    read, other = (
        float(np.linalg.norm(np.diff((way @ poses[:, 0])[:, :3, 3], axis=0), axis=1).mean())
        for way in (cameras, inverse)
    )
    if other < 0.5 * read and read - other > 0.002:
        return [
            f"cameras: the object moves {1000 * read:.1f} mm a frame, and {1000 * other:.1f} mm "
            "with the camera's poses inverted: output.log holds world to camera here"
        ]
    return []


def widest_gap(meshes: list[Mesh], poses: Array) -> float:
    """Largest distance in metres between the nearest vertices of two parts, over some frames."""
    gaps = []
    for pose in poses[:: max(1, len(poses) // 5)]:
        first, second = (
            mesh.verts.double().numpy()[:: max(1, len(mesh.verts) // 500)] @ part[:3, :3].T
            + part[:3, 3]
            for mesh, part in zip(meshes, pose, strict=True)
        )
        gaps.append(np.linalg.norm(first[:, None] - second[None], axis=-1).min())
    return float(max(gaps))
