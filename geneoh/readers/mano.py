"""The user's own MANO for data sets, which write its numbers in many dialects.

Relative to a mean pose or not, as coefficients of components, with the translation of the model's
origin (convention O, x = LBS + t) or of the wrist (convention W), and with one of two left hands
(see `geneoh.hand.mano`). What pins these down stands in the user's files.
"""

from collections.abc import Callable
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


@dataclass(frozen=True)
class Mano:
    """One side, with how it writes poses, metres and radians."""

    model: HandModel
    mean: Array
    """(45,) what flat_hand_mean=False adds to a pose."""
    components: Array
    """(45, 45) rows of the pose components; not of unit length."""

    def wrist_offset(self, betas: Array) -> Array:
        """J0(betas): the wrist of the rest pose, which convention O leaves out of t."""
        return self.model.rest_wrist(torch.from_numpy(betas).float()).double().numpy()

    def keypoints(self, pose: Array, wrist: Array, betas: Array) -> Array:
        """(T, 21, 3) keypoints, OpenPose order, of (T, 16, 3) absolute poses."""
        offsets = self.model.shaped(torch.from_numpy(betas).float()).offsets.double()
        turns = axis_angle_to_matrix(torch.from_numpy(pose))
        offsets = offsets.expand(len(pose), 20, 3)
        return forward_kinematics(turns, torch.from_numpy(wrist), offsets)[0].numpy()


ManoSource = Callable[[Side, ManoName], Mano]
"""Gives one side as a data set means it; `MissingAssetError` where the user has no such file."""


def mano_of(folder: Path | None) -> ManoSource | None:
    """The user's MANO files, read when they are first asked for; None without a folder."""
    return None if folder is None else lambda side, name: read_mano(Path(folder), side, name)


@lru_cache(maxsize=8)
def read_mano(folder: Path, side: Side, name: ManoName = AS_SHIPPED) -> Mano:
    """One side of MANO from the user's files.

    Raises:
        MissingAssetError: no such file.
        InputError: not MANO's layout.
    """
    space = load_pose_space(side, folder)
    return Mano(
        load_mano(side, folder, name=name),
        space.mean.double().numpy(),
        space.components.double().numpy(),
    )


def decoded(record: Record, name: str, coefficients: Array, mano: Mano, *, mean: bool) -> Array:
    """(T, 45) absolute pose from coefficients of the components, the mean added or not."""
    count = coefficients.shape[-1]
    if count > 45:
        raise record.refuse(name, "at most 45 coefficients")
    return coefficients @ mano.components[:count] + (mano.mean if mean else np.zeros(45))
