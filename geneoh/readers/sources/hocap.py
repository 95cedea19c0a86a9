"""HO-Cap as it is distributed: subject_{k}/{date}_{time}/ with meta.yaml, poses_m.npy, poses_o.npy.

In the world frame: poses_m (2, T, 51), the right hand first, orientation, 45 coefficients of MANO's
components, translation (of MANO's origin, relative to the mean pose, left hand as shipped); poses_o
(Q, T, 7) quaternion xyzw and translation; a missing hand or object has -1 everywhere. meta.yaml
names the objects, the hands and the subject, whose betas are in calibration/mano/{subject}.yaml.
Meshes are in models/{object}/. Metres; RealSense cameras take 30 frames a second.
"""

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.readers import base, builders, transforms
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import read_array, read_yaml
from geneoh.readers.meshes import find_mesh
from geneoh.readers.records import Array, Record

HANDS: dict[Side, int] = {"right": 0, "left": 1}
"""Index of each hand in poses_m."""
NOTHING = -1
"""Value of every number of a missing hand or object."""
MESHES = ("cleaned_mesh_10000.obj", "textured_mesh.obj")


# `mean_added` stays False: `hand_of_rows` has added the mean pose already.
@reads(
    "poses_m.npy",
    clip_is_folder=True,
    name_parts=2,
    fps=None,
    convention=base.ORIGIN,
    content="an object with poses",
    takes=("objects",),
)
def hocap(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands with each object that moves; objects at rest are left out."""
    meta = read_yaml(clip.path / "meta.yaml")
    root = base.ancestor(clip.path, 2)
    placed = read_array(clip.path / "poses_o.npy", ("Q", "T", 7))
    names, sides = meta.texts("object_ids"), meta.texts("mano_sides")
    if len(names) != len(placed):
        raise InputError(
            f"{meta.where}: expected {len(placed)} 'object_ids', as poses_o.npy has, got "
            f"{len(names)}; the files are of different sequences or versions"
        )
    stored = clip.path / "poses_m.npy"
    poses = Record(str(stored), {"poses_m": read_array(stored, (2, "T", 51))})
    betas = read_yaml(root / "calibration/mano" / f"{meta.text('subject_id')}.yaml")
    shape = betas.array("betas", (10,))
    hands = [_read_hand(poses, side, shape, options) for side in HANDS if side in sides]
    motions = dict(zip(names, map(transforms.rigid_of_xyzw, known(placed)), strict=True))
    folder = options.objects or root / "models"
    for name in base.moving_objects(motions):
        mesh = find_mesh([folder / name / file for file in MESHES], f"object {name}")
        source, part = f"HO-Cap {clip.name} {name}", f"{clip.name}_{name}"
        yield base.ClipParts(source, hands, {f"hocap_{name}": mesh}, motions[name], name=part)


def known(values: Array) -> Array:
    """The rows, with NaN in those of a missing hand or object."""
    absent = (values == NOTHING).all(-1, keepdims=True)
    return np.where(absent, np.nan, values)


def _read_hand(
    poses: Record, side: Side, betas: Array, options: base.ReaderOptions
) -> base.ManoParameters:
    """One hand of `poses_m`, whose coefficients need the user's MANO."""
    mano = builders.mano_of_coefficients(options, side, poses.where)
    values = known(poses.array("poses_m", (2, "T", 51))[HANDS[side]])
    return builders.hand_of_rows(poses, "poses_m", side, values, betas, mano)
