"""What only the user's own MANO file knows: mean pose, pose components, and where its wrist stands.

Data sets give MANO's numbers in many dialects: relative to a mean pose or not, as coefficients of
components, with the translation of the model's origin (convention O, x = LBS + t) or of the wrist
(convention W). Pinning these down needs arrays that `HandModel` does not hold, so they are read
here, through the same reader that never runs a pickle.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from geneoh.datasets.records import Array, Record, read_record
from geneoh.errors import MissingAssetError
from geneoh.hand.embedded import TIP_VERTS
from geneoh.hand.model import Side
from geneoh.hand.skeleton import PARENTS, TIP_PARENTS

LeftShape = Literal["as shipped", "mirrored"]
"""MANO_LEFT comes with the shape directions of the right hand (smplx issue 48): data sets that used
the file as it is, and those that negated x of its directions, mean different hands by equal
betas."""


@dataclass(frozen=True)
class Mano:
    """The arrays of one side that a loader needs, metres and radians."""

    side: Side
    template: Array
    shape_dirs: Array
    joint_regressor: Array
    mean: Array
    """(45,) what flat_hand_mean=False adds to a pose."""
    components: Array
    """(45, 45) rows of the pose components; not of unit length."""

    def rest(self, betas: Array, left: LeftShape) -> tuple[Array, Array]:
        """The 16 joints and the 5 tips of the rest pose, in the order of the skeleton."""
        flip = np.array([-1.0, 1.0, 1.0])
        mirrored = self.side == "left" and left == "mirrored"
        shape_dirs = self.shape_dirs * flip[:, None] if mirrored else self.shape_dirs
        verts = self.template + shape_dirs[..., : len(betas)] @ betas
        return self.joint_regressor @ verts, verts[list(TIP_VERTS)]

    def wrist_offset(self, betas: Array, left: LeftShape) -> Array:
        """J0(betas): the wrist of the rest pose, which convention O leaves out of t."""
        return self.rest(betas, left)[0][0]

    def offsets(self, betas: Array, left: LeftShape) -> Array:
        """(20, 3) rest skeleton as `forward_kinematics` wants it: 15 bones, then 5 tips."""
        joints, tips = self.rest(betas, left)
        return np.concatenate(
            [joints[1:] - joints[list(PARENTS[1:])], tips - joints[list(TIP_PARENTS)]]
        )


ManoSource = Callable[[Side], Mano]
"""Gives the arrays of one side; `MissingAssetError` where the user has none."""


def mano_of(folder: Path | None) -> ManoSource | None:
    """The user's MANO files, read when they are first asked for; None without a folder."""
    return None if folder is None else lambda side: read_mano(Path(folder), side)


@lru_cache(maxsize=4)
def read_mano(folder: Path, side: Side) -> Mano:
    """One side of MANO from the official pickle.

    Raises:
        MissingAssetError: no such file.
        InputError: not MANO's layout.
    """
    path = folder / f"MANO_{side.upper()}.pkl"
    if not path.is_file():
        raise MissingAssetError(
            f"{path}: no such file; register at https://mano.is.tue.mpg.de, download the models, "
            "and pass their folder with --mano"
        )
    record = read_record(path)
    return Mano(
        side,
        template=record.array("v_template", (778, 3)),
        shape_dirs=record.array("shapedirs", (778, 3, 10)),
        joint_regressor=record.array("J_regressor", (16, 778)),
        mean=record.array("hands_mean", (45,)),
        components=record.array("hands_components", (45, 45)),
    )


def decoded(record: Record, name: str, coefficients: Array, mano: Mano) -> Array:
    """(T, 45) absolute pose from coefficients of the components, the mean added."""
    count = coefficients.shape[-1]
    if count > 45:
        raise record.refuse(name, "at most 45 coefficients")
    return coefficients @ mano.components[:count] + mano.mean
