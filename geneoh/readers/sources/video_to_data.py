"""NVIDIA's video_to_data: the folder result/ of a reconstruction, with result.npz and mesh.obj.

hand_{side}_wrist_orient_in_camera (T, 3), _wrist_trans_in_camera (T, 3) of MANO's origin,
_finger_pose (T, 15, 3) absolute, _betas (10,), _scale (T,) and _is_valid (T,), in the frame of the
camera at each time; camera_to_world_transform (T, 4, 4) and camera_is_valid (T,).
object_to_camera_transform (T, 4, 4), whose rotation may include a scale, object_scale of the mesh
and object_is_valid (T,). Metres. Orientations, fingers and betas are those of MANO's right hand:
for a left hand they are mirrored back here, but its translation is not mirrored.
"""

import numpy as np

from geneoh.choices import SIDES, Side
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mirror import mirror_axis_angle
from geneoh.hand.mano import MENDED
from geneoh.readers import base
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import read_record
from geneoh.readers.meshes import find_mesh
from geneoh.readers.nested_lists import Shape
from geneoh.readers.records import Array, Notes, Record
from geneoh.readers.transforms import refuse_other_matrices

CAMERA, OBJECT = "camera_to_world_transform", "object_to_camera_transform"
OF_HANDS: dict[str, Shape] = {
    **{"wrist_orient_in_camera": ("T", 3), "wrist_trans_in_camera": ("T", 3)},
    **{"finger_pose": ("T", 15, 3), "scale": ("T",), "is_valid": ("T",)},
}
FIELDS: dict[str, Shape] = {
    **{CAMERA: ("T", 4, 4), "camera_is_valid": ("T",)},
    **{OBJECT: ("T", 4, 4), "object_is_valid": ("T",)},
    **{f"hand_{side}_{name}": shape for side in SIDES for name, shape in OF_HANDS.items()},
}
"""The fields with a value for each frame."""

ROUNDING = 1e-4
"""Difference of a factor from 1 up to which it is 1, as the files have float32."""
SAME_SIZE = 0.01
"""Largest relative difference of the size of a hand from MANO's that needs no note."""


@reads(
    "result.npz",
    name_parts=2,
    name_above=1,
    any_file=True,
    fps=None,
    convention=base.ManoConvention("origin", left_hand=MENDED),
)
def video_to_data(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Up to two hands and the object, in the world."""
    record = read_record(clip.path)
    arrays = {name: record.array(name, shape) for name, shape in FIELDS.items()}
    record.refuse_lengths(*FIELDS)
    hidden = arrays["camera_is_valid"] < 0.5
    camera = np.where(hidden[:, None, None], np.eye(4), arrays[CAMERA])  # of no kept frame
    refuse_other_matrices(record, CAMERA, camera[:, :3, :3])
    hands, notes = [], []
    for side in SIDES:
        own = {name: arrays[f"hand_{side}_{name}"] for name in OF_HANDS}
        lost = hidden | (own["is_valid"] < 0.5)
        betas = record.array(f"hand_{side}_betas", (10,))
        hands.append(read_hand(side, own, lost, betas, camera))
        notes += about_size(side, own["scale"][~lost])
    lost = hidden | (arrays["object_is_valid"] < 0.5)
    poses, scale = rigid_poses(record, arrays[OBJECT], lost)
    mesh = find_mesh([clip.path.with_name("mesh.obj")], "the object")
    factor = scale * record.finite("object_scale")
    if factor <= 0:
        raise record.refuse("object_scale", "a factor above 0")
    if abs(factor - 1) > ROUNDING:
        notes.append(f"the object is {factor:.3g} times mesh.obj; geneoh convert writes its mesh")
        mesh = Mesh(mesh.verts * factor, mesh.faces)
    about = {"notes": tuple(notes), "camera_poses": camera}
    meshes, motion = {"video_to_data": mesh}, camera @ poses
    yield base.ClipParts(f"video_to_data {clip.name}", hands, meshes, motion, **about)


def read_hand(
    side: Side, own: dict[str, Array], lost: Array, betas: Array, camera: Array
) -> base.ManoParameters:
    """One hand in the frame of the camera, NaN in the frames in which it is lost."""
    orientation = own["wrist_orient_in_camera"][:, None]
    pose = np.concatenate([orientation, own["finger_pose"]], axis=1)
    pose[lost] = np.nan
    if side == "left":
        pose = mirror_axis_angle(pose)
    shift = own["wrist_trans_in_camera"]
    return base.ManoParameters(side, pose, shift, betas, to_world=camera)


def about_size(side: Side, sizes: Array) -> Notes:
    """A note where a hand has another size than MANO's, which geneoh's hands cannot have."""
    size = float(np.median(sizes)) if len(sizes) else 1.0
    if abs(size - 1) <= SAME_SIZE:
        return ()
    return (f"the {side} hand is {size:.2f} times as large as its betas say, which is left out",)


def rigid_poses(record: Record, poses: Array, lost: Array) -> tuple[Array, float]:
    """(T, 4, 4) poses without their scale, NaN where the object is lost; and the scale."""
    poses = np.where(lost[:, None, None], np.nan, poses)
    sizes = np.cbrt(np.linalg.det(poses[~lost, :3, :3]))
    scale = float(np.median(sizes)) if len(sizes) and np.isfinite(sizes).all() else 1.0
    if scale <= 0:
        raise record.refuse(OBJECT, "poses that neither mirror nor flatten the object")
    poses[:, :3, :3] /= scale
    refuse_other_matrices(record, OBJECT, poses[:, :3, :3])
    return poses, scale
