"""The user's own MANO for data sets, whose MANO parameters follow several conventions.

Poses are absolute, relative to a mean pose, or coefficients of pose components; the translation
moves the origin of the model (x = LBS + t) or the wrist; and betas belong to one of two left hands
(see `geneoh.hand.mano`). The mean pose, the components and the wrist's place in the model are in
the user's files.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch

from geneoh.choices import Side
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.mano import AS_SHIPPED, ManoName, load_mano, load_pose_space
from geneoh.hand.model import HandModel
from geneoh.hand.skeleton import forward_kinematics
from geneoh.readers.records import Array, Record

RIM = (108, 79, 78, 121, 214, 215, 279, 239, 234, 92, 38, 122, 118, 117, 119, 120)
"""Vertices around the open wrist, which move rigidly with it."""

MEAN_WRIST_OFFSET = (0.096, 0.006, 0.006)
"""J0 of MANO's right mean hand in metres; other betas move it by some 5 mm. The left has -x."""

MEAN_OFFSET_NOTE = (
    "the wrist was placed with the offset of MANO's mean hand, some 5 mm off for other hands; "
    "pass --mano to have it exact"
)


def mean_wrist_offset(side: Side) -> Array:
    """(3,) from MANO's origin to the wrist of the mean hand, metres."""
    x, y, z = MEAN_WRIST_OFFSET
    return np.array([x if side == "right" else -x, y, z])


@dataclass(frozen=True)
class Mano:
    """One side of MANO with its pose space, metres and radians."""

    model: HandModel
    mean: Array
    """(45,) the mean pose, which flat_hand_mean=False adds to a pose."""
    components: Array
    """(45, 45) rows of the pose components; not of unit length."""

    def wrist_offset(self, betas: Array) -> Array:
        """J0(betas): (3,) from the origin of the model to the wrist of the rest pose."""
        return self.model.rest_wrist(torch.from_numpy(betas).float()).double().numpy()

    def keypoints(self, pose: Array, wrist: Array, betas: Array) -> Array:
        """(T, 21, 3) keypoints, OpenPose order, of (T, 16, 3) absolute poses."""
        offsets = self.model.shaped(torch.from_numpy(betas).float()).offsets.double()
        rotations = axis_angle_to_matrix(torch.from_numpy(pose))
        offsets = offsets.expand(len(pose), 20, 3)
        return forward_kinematics(rotations, torch.from_numpy(wrist), offsets)[0].numpy()


@lru_cache(maxsize=8)
def read_mano(folder: Path, side: Side, name: ManoName = AS_SHIPPED) -> Mano:
    """One side of MANO; `MissingAssetError` without a file, `InputError` for another layout."""
    space = load_pose_space(side, folder)
    mean, components = space.mean.double().numpy(), space.components.double().numpy()
    return Mano(load_mano(side, folder, name=name), mean, components)


def pose_of_coefficients(
    record: Record, name: str, coefficients: Array, mano: Mano, *, add_mean: bool
) -> Array:
    """(T, 45) absolute pose from a field's (T, C) coefficients of MANO's first components."""
    count = coefficients.shape[-1]
    if count > len(mano.components):
        raise record.refuse(name, f"at most {len(mano.components)} coefficients")
    return coefficients @ mano.components[:count] + (mano.mean if add_mean else np.zeros(45))
