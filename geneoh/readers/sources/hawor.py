"""HaWoR's world results: world_space_res.pth, a joblib dump of five arrays, hand 0 left, hand 1
right.

trans (2, T, 3) of MANO's origin, rot (2, T, 3), hand_pose (2, T, 45) absolute, betas (2, T, 10),
valid (2, T); the world of its camera tracking, metres. Left poses are a left hand's, for MANO_LEFT
with mirrored shape directions. Frames that HaWoR filled in are marked valid like observed ones.
SLAM/hawor_slam_w_scale_{first}_{last}.npz beside it has the camera in each frame: traj (T, 7) of
translation and quaternion xyzw, camera to world, and the scale from its translations to metres.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import SIDES
from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.hand.mano import MENDED
from geneoh.readers import base, foreign_files
from geneoh.readers.dataset_reader import reads
from geneoh.readers.nested_lists import Shape
from geneoh.readers.records import AS_DISTRIBUTED, FRAME_LIMIT, Array, Record, described
from geneoh.readers.transforms import rigid_of_xyzw

FIELDS: dict[str, Shape] = {
    **{"trans": (2, "T", 3), "rot": (2, "T", 3), "hand_pose": (2, "T", 45)},
    **{"betas": (2, "T", 10), "valid": (2, "T")},
}


@reads(
    "world_space_res.pth",
    any_file=True,
    name_parts=2,
    fps=None,
    convention=base.ManoConvention("origin", left_hand=MENDED),
    takes=("object_pose", "object_pose_frame"),
)
def hawor(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Up to two hands in the world, with the caller's object."""
    values = read_values(clip.path)
    if not isinstance(values, list | tuple) or len(values) != len(FIELDS):
        raise InputError(
            f"{clip.path}: expected the five arrays of HaWoR's world result, "
            f"got {described(values)}; {AS_DISTRIBUTED}"
        )
    record = Record(str(clip.path), dict(zip(FIELDS, values, strict=True)))
    arrays = [record.array(name, shape) for name, shape in FIELDS.items()]
    trans, rot, fingers, betas, valid = arrays
    frames = valid.shape[1]
    if frames > FRAME_LIMIT or any(array.shape[1] != frames for array in arrays):
        raise record.refuse("valid", f"as many frames as the other arrays, {FRAME_LIMIT} at most")
    hands = []
    for index, side in enumerate(SIDES):
        seen = valid[index] > 0.5
        if seen.any():
            pose = np.concatenate([rot[index], fingers[index]], axis=1)
            pose[~seen] = np.nan
            shape = betas[index, seen].mean(0)
            hands.append(base.ManoParameters(side, pose, trans[index], shape))
    note = "frames that HaWoR filled in count as seen: it marks them so"
    camera, about_camera = camera_of(clip.path.parent / "SLAM", frames)
    notes = (note, *about_camera)
    yield base.ClipParts(f"HaWoR {clip.name}", hands, notes=notes, camera_poses=camera)


def camera_of(folder: Path, frames: int) -> tuple[Array | None, tuple[str, ...]]:
    """(T, 4, 4) camera to world, metres, None without HaWoR's tracking; and a note."""
    files = sorted(folder.glob("hawor_slam_w_scale_*.npz"))
    if not files:
        return None, ()
    record = foreign_files.read_record(files[-1])
    track = record.array("traj", ("N", 7))
    poses = rigid_of_xyzw(np.roll(track, 4, axis=1))
    poses[:, :3, 3] *= record.finite("scale")
    if len(poses) != frames or not np.isfinite(poses).all():
        note = f"the camera of {files[-1].name} is left out: it is not known in all {frames} frames"
        return None, (note,)
    return poses, ()
