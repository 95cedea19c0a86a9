"""A body under the names of smplx and AMASS, beside the hands in files that geneoh writes."""

from pathlib import Path

import numpy as np

from geneoh.files.npz import Arrays, read_archive
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.readers.bodies.base import BodyRecording
from geneoh.readers.bodies.read import read_body
from geneoh.readers.bodies.smpl import OFFSETS, UP

JAW_AND_EYES = 9
"""Numbers of SMPL-X between body and hands, which we leave at zero."""


def body_fields(body: BodyRecording) -> Arrays:
    """A body in the world of its file, with absolute finger poses (`flat_hand_mean=True`).

    `global_orient`, `body_pose`, `left_hand_pose`, `right_hand_pose` and `transl` are the arguments
    of smplx; `poses`, `trans` and `mocap_frame_rate` say the same as AMASS does, for the SMPL-X
    add-on of Blender.
    """
    motion = body.file_motion
    turns = matrix_to_axis_angle(motion.rotations).flatten(1).cpu().numpy()
    transl = (motion.root - body.rest_root).cpu().numpy()
    offsets = body.skeleton.offsets.clone()
    offsets[0] = body.rest_root
    face = np.zeros((len(turns), JAW_AND_EYES), dtype=turns.dtype)
    return {
        "global_orient": turns[:, :3],
        "body_pose": turns[:, 3:66],
        "left_hand_pose": turns[:, 66:111],
        "right_hand_pose": turns[:, 111:],
        "transl": transl,
        "poses": np.concatenate([turns[:, :66], face, turns[:, 66:]], axis=1),
        "trans": transl,
        "betas": np.zeros(10, np.float32) if body.betas is None else body.betas.cpu().numpy(),
        "gender": np.array(body.gender),
        "flat_hand_mean": np.array(True),
        "mocap_frame_rate": np.array(body.fps),
        OFFSETS: offsets.cpu().numpy(),
        UP: np.array(body.up),
    }


def own_body(path: Path) -> BodyRecording | None:
    """The body beside the hands in a file that geneoh wrote; None where there is none."""
    if path.suffix.lower() != ".npz" or OFFSETS not in read_archive(path):
        return None
    return read_body(path)
