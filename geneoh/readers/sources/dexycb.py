"""DexYCB as it is distributed: {date}-subject-{nn}/{timestamp}/ with meta.yml and pose.npz.

pose.npz is in the world frame: pose_y (T, n, 7) quaternion xyzw and translation, pose_m (T, 1, 51)
orientation, 45 coefficients of MANO's components, translation (of MANO's origin, relative to the
mean pose, left hand as shipped). Labels of single cameras hold keypoints, -1 where there is no
hand. Metres, 30 frames a second.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers import base, builders, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import read_record, read_yaml
from geneoh.readers.mano import Mano
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import Array, Record

YCB = (
    *("002_master_chef_can", "003_cracker_box", "004_sugar_box", "005_tomato_soup_can"),
    *("006_mustard_bottle", "007_tuna_fish_can", "008_pudding_box", "009_gelatin_box"),
    *("010_potted_meat_can", "011_banana", "019_pitcher_base", "021_bleach_cleanser"),
    *("024_bowl", "025_mug", "035_power_drill", "036_wood_block", "037_scissors"),
    *("040_large_marker", "051_large_clamp", "052_extra_large_clamp", "061_foam_brick"),
)
"""Names of the objects 1 to 21."""
NO_OBJECT = np.array([0.0, 0, 0, 1, 0, 0, 0])
"""Pose of an object that was not found."""
NO_HAND = -1
"""Value of every coordinate in a label without a hand."""


# `mean_added` stays False: `hand_of_rows` has added the mean pose already.
@reads("meta.yml", clip_is_folder=True, name_parts=2, convention=base.ORIGIN, takes=("objects",))
def dexycb(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The hand and the object that it grasps; the other objects on the table are left out."""
    meta, poses = read_yaml(clip.path / "meta.yml"), read_record(clip.path / "pose.npz")
    root = base.ancestor(clip.path, 2)
    placed = poses.array("pose_y", ("T", "Q", 7))
    grasped, ids = meta.integer("ycb_grasp_ind"), meta.integers("ycb_ids")
    if not 0 <= grasped < min(len(ids), placed.shape[1]) or not 1 <= ids[grasped] <= len(YCB):
        raise InputError(f"{meta.where}: expected a grasped object of 1 to 21, got {ids}; copy it")
    name = YCB[ids[grasped] - 1]
    folder = options.objects or root / "models"
    mesh = find_mesh([folder / name / "textured_simple.obj"], name)
    side: Side = "left" if "left" in meta.items("mano_sides") else "right"
    joints = read_labels(clip.path, root, meta, len(placed))
    if mano := options.mano(side):
        hands, notes = [read_pose(poses, meta, side, root, mano)], ()
    elif joints is not None:
        hands = [builders.hand_track(side, joints)]
        notes = ("keypoints of one camera only; --mano gives the pose",)
    else:
        raise InputError(
            f"{clip.path}: the pose is coefficients of MANO's components and there are no labels "
            f"with keypoints, {builders.NO_MANO}"
        )
    found = (placed != NO_OBJECT).any(-1, keepdims=True)
    motion = transforms.rigid_of_xyzw(np.where(found, placed, np.nan)[:, grasped])
    meshes = {f"dexycb_{name}": mesh}
    checks = base.CrossChecks(base.by_side(side, joints))
    yield base.ClipParts(
        f"DexYCB {clip.name}", hands, meshes, motion, notes=notes, cross_checks=checks
    )


def read_pose(
    poses: Record, meta: Record, side: Side, root: Path, mano: Mano
) -> base.ManoParameters:
    """MANO parameters in the world; a frame of zeros has no hand."""
    values = poses.array("pose_m", ("T", 1, 51))[:, 0].copy()
    values[~np.abs(values).any(1)] = np.nan
    person = meta.texts("mano_calib")
    if not person:
        raise meta.refuse("mano_calib", "a list of one name")
    calibration = root / "calibration" / f"mano_{person[0].replace('/', '_')}" / "mano.yml"
    betas = read_yaml(calibration).array("betas", (10,))
    return builders.hand_of_rows(poses, "pose_m", side, values, betas, mano)


def read_labels(folder: Path, root: Path, meta: Record, frames: int) -> Array | None:
    """(T, 21, 3) keypoints in the world, from the first camera that has labels."""
    for serial in meta.items("serials"):
        files = [folder / str(serial) / f"labels_{t:06d}.npz" for t in range(frames)]
        if any(file.is_file() for file in files):
            extrinsics = root / f"calibration/extrinsics_{meta.text('extrinsics')}/extrinsics.yml"
            to_world = read_yaml(extrinsics).array(str(serial), (12,)).reshape(3, 4)
            return np.stack([label_joints(file, to_world) for file in files])
    return None


def label_joints(file: Path, to_world: Array) -> Array:
    """(21, 3) of one frame; NaN without a file or a hand."""
    if not file.is_file():
        return np.full((21, 3), np.nan)
    joints = read_record(file).array("joint_3d", (1, 21, 3))[0]
    if (joints == NO_HAND).all():
        return np.full((21, 3), np.nan)
    return transforms.moved_points(joints, to_world)
