"""The user's SMPL-H or SMPL-X model: only its joints at rest are read, no mesh."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from torch import Tensor

from geneoh.body.skeleton import BODY_JOINTS, JOINT_NAMES, PARENTS, Skeleton
from geneoh.bundle import Bundle
from geneoh.readers import foreign_files
from geneoh.readers.records import Array, Record, float32

HAND_STARTS = {52: 22, 55: 25}
"""First joint of the left hand by the number of joints: SMPL-H, and SMPL-X with jaw and eyes."""
OFFICIAL = "use the official SMPL-H or SMPL-X model"


@dataclass(frozen=True)
class RestBody(Bundle):
    """The joints of one person at rest."""

    skeleton: Skeleton
    rest_root: Float[Tensor, " 3"]
    """The pelvis in the model's own frame, metres: SMPL's translation plus this is the pelvis."""


def read_model(path: Path, betas: Float[Tensor, " S"] | None = None) -> RestBody:
    """The rest joints of a person with some betas, from the official model's file (npz or pkl), in
    which no code is run; `InputError` for other files."""
    record = foreign_files.read_record(path)
    verts = record.array("v_template", ("V", 3))
    regressor = record.numbers("J_regressor")
    if regressor.ndim != 2 or regressor.shape[1] != len(verts):
        raise record.refuse("J_regressor", "a matrix over the vertices", OFFICIAL)
    if len(regressor) not in HAND_STARTS:
        raise record.refuse("J_regressor", "a matrix of 52 (SMPL-H) or 55 joints", OFFICIAL)
    hands = HAND_STARTS[len(regressor)]
    chosen = [*range(BODY_JOINTS), *range(hands, hands + 30)]
    tree = record.array("kintree_table", (2, "J"))[0]
    wanted = [chosen[parent] for parent in PARENTS[1:]]
    if len(tree) <= max(chosen) or tree[chosen[1:]].tolist() != wanted:
        raise record.refuse("kintree_table", f"the tree of {len(JOINT_NAMES)} joints", OFFICIAL)
    joints = regressor @ (verts + _shape_of(record, len(verts), betas))
    places = float32(joints[chosen])
    offsets = places - places[[0, *PARENTS[1:]]]
    return RestBody(Skeleton(offsets), places[0])


def _shape_of(record: Record, count: int, betas: Float[Tensor, " S"] | None) -> Array:
    """(V, 3) shape offsets that betas add to the vertices at rest."""
    if betas is None or not bool(betas.any()) or "shapedirs" not in record:
        return np.zeros((count, 3))
    dirs = record.array("shapedirs", (count, 3, "S"))
    known = min(len(betas), dirs.shape[-1])
    return dirs[..., :known] @ betas[:known].double().numpy()
