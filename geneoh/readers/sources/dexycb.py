"""DexYCB as it is distributed: {date}-subject-{nn}/{timestamp}/ with meta.yml and pose.npz.

pose.npz is in the world frame: pose_y (T, n, 7) quaternion xyzw and translation, pose_m (T, 1, 51)
orientation, 45 coefficients of MANO's components, translation (convention O, relative to the mean
pose, MANO_LEFT as shipped). Labels of single cameras hold keypoints, -1 where there is no hand.
"""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers.base import CrossChecks, ReaderOptions, Recording, SourceClip, clips
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    joints_track,
    mano_track,
    object_track,
    recordings,
    sequence_of,
)
from geneoh.readers.mano import decoded
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import Array, Record, read_record, read_text

CONVENTION = ManoConvention(origin=True)
"""After decoding, in which the mean pose is added."""
FPS = 30.0
YCB = (
    *("002_master_chef_can", "003_cracker_box", "004_sugar_box", "005_tomato_soup_can"),
    *("006_mustard_bottle", "007_tuna_fish_can", "008_pudding_box", "009_gelatin_box"),
    *("010_potted_meat_can", "011_banana", "019_pitcher_base", "021_bleach_cleanser"),
    *("024_bowl", "025_mug", "035_power_drill", "036_wood_block", "037_scissors"),
    *("040_large_marker", "051_large_clamp", "052_extra_large_clamp", "061_foam_brick"),
)
"""Objects 1 to 21."""


def find(path: Path) -> list[SourceClip]:
    """Every sequence."""
    return [
        SourceClip(clip.name.rpartition("/")[0] or clip.name, clip.path.parent)
        for clip in clips(path, "meta.yml", 3)
    ]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """The hand and the object that it grasps; the other objects on the table are left out."""
    meta = read_yaml(clip.path / "meta.yml")
    root = clip.path.parents[1]
    poses = read_record(clip.path / "pose.npz")
    grasped = int(meta.number("ycb_grasp_ind"))
    ids = [int(number) for number in meta.numbers("ycb_ids").ravel()]
    placed = poses.array("pose_y", ("T", "Q", 7))
    if not 0 <= grasped < min(len(ids), placed.shape[1]) or not 1 <= ids[grasped] <= len(YCB):
        raise InputError(f"{meta.where}: expected a grasped object of 1 to 21, got {ids}; copy it")
    name = YCB[ids[grasped] - 1]
    motion, present = object_motion(placed[:, grasped])
    folder = known.objects or root / "models"
    mesh = read_mesh(find_mesh([folder / name / "textured_simple.obj"], name))
    side: Side = "left" if "left" in meta.items("mano_sides") else "right"
    joints = read_labels(clip.path, root, meta, len(placed))
    if known.mano is None:
        if joints is None:
            raise InputError(
                f"{clip.path}: the pose is coefficients of MANO's components, got no MANO files "
                "and no labels with keypoints; pass --mano with the folder of your MANO files"
            )
        hand = joints_track(side, joints), ("keypoints of one camera only; --mano gives the pose",)
    else:
        hand = mano_track(read_pose(poses, meta, side, root, known), CONVENTION, known, poses.where)
    sequence = sequence_of(
        [hand], object_track([mesh], motion[:, None]), known.rate(FPS), f"DexYCB {clip.name}"
    )
    return recordings(
        clip.name,
        sequence,
        object_known=present,
        mesh_names=(f"dexycb_{name}",),
        evidence=CrossChecks(joints={} if joints is None else {side: joints}),
    )


def read_pose(
    poses: Record, meta: Record, side: Side, root: Path, known: ReaderOptions
) -> ManoParameters:
    """MANO's numbers in the world; a frame of zeros has no hand."""
    values = poses.array("pose_m", ("T", 1, 51))[:, 0].copy()
    values[~np.abs(values).any(1)] = np.nan
    assert known.mano is not None, "asked before"
    mano = known.mano(side, CONVENTION.hand)
    pose = decoded(poses, "pose_m", values[:, 3:48], mano, mean=True)
    calibration = read_yaml(root / "calibration" / f"mano_{first(meta, 'mano_calib')}" / "mano.yml")
    return ManoParameters(
        side,
        np.concatenate([values[:, :3], pose], axis=1),
        values[:, 48:],
        calibration.array("betas", (10,)),
    )


def object_motion(placed: Array) -> tuple[Array, Array]:
    """(T, 4, 4) of the object to the world, and the frames in which it was found."""
    absent = np.array([0.0, 0, 0, 1, 0, 0, 0])
    present = np.isfinite(placed).all(1) & (np.abs(placed - absent).max(1) > 0)
    present &= np.abs(placed[:, :4]).sum(1) > 0.1
    motion = np.full((len(placed), 4, 4), np.nan)
    motion[present] = np.eye(4)
    if present.any():
        motion[present, :3, :3] = Rotation.from_quat(placed[present, :4]).as_matrix()
        motion[present, :3, 3] = placed[present, 4:]
    return motion, present


def read_labels(folder: Path, root: Path, meta: Record, frames: int) -> Array | None:
    """(T, 21, 3) keypoints in the world, from the first camera that has labels."""
    serials = [str(serial) for serial in meta.items("serials")]
    for serial in serials:
        files = [folder / serial / f"labels_{t:06d}.npz" for t in range(frames)]
        if any(file.is_file() for file in files):
            extrinsics = root / f"calibration/extrinsics_{meta.text('extrinsics')}/extrinsics.yml"
            to_world = read_yaml(extrinsics).array(serial, (12,)).reshape(3, 4)
            return np.stack([label_joints(file, to_world) for file in files])
    return None


def label_joints(file: Path, to_world: Array) -> Array:
    """(21, 3) of one frame; NaN without a file or a hand."""
    if not file.is_file():
        return np.full((21, 3), np.nan)
    joints = read_record(file).array("joint_3d", (1, 21, 3))[0]
    if (joints == -1).all():
        return np.full((21, 3), np.nan)
    return joints @ to_world[:, :3].T + to_world[:, 3]


def first(meta: Record, name: str) -> str:
    """The first of a list of texts."""
    items = meta.items(name)
    if not items:
        raise meta.refuse(name, "a list of one name")
    return str(items[0]).replace("/", "_")


def read_yaml(path: Path) -> Record:
    """The little of YAML that the data set uses: names with a value or with a list, two levels.

    Names below `extrinsics:` are raised to the top.
    """
    values: dict[str, object] = {}
    name = ""
    for line in read_text(path).splitlines():
        words = line.strip()
        if words.startswith("- ") and isinstance(values.get(name), list):
            values[name].append(scalar(words[2:]))  # type: ignore[union-attr]
        elif ":" in words:
            name, _, rest = (part.strip() for part in words.partition(":"))
            name = name.strip("'\"")
            values[name] = [] if not rest else listed(rest)
    return Record(str(path), values)


def listed(text: str) -> object:
    """A value, or a list in brackets."""
    if text.startswith("[") and text.endswith("]"):
        return [scalar(part.strip()) for part in text[1:-1].split(",") if part.strip()]
    return scalar(text)


def scalar(text: str) -> object:
    """A number where it is one and stands without quotes, else text."""
    if text[:1] in ("'", '"') and text[-1:] == text[:1]:
        return text[1:-1]
    try:
        return float(text)
    except ValueError:
        return text
