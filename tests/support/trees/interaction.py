"""The known interaction that every data set in miniature holds.

An object that turns and travels with a right hand and a left hand that ride along, so that a
reading in another convention shows.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from trees.mano_files import FLIP, SIDES, Hand

FRAMES = 9


CAMERA_TURN = np.array([0.005, -0.02, 0.01])


@dataclass(frozen=True)
class Scene:
    """The known interaction, float64; dicts by side."""

    pose: dict[str, np.ndarray]
    wrist: dict[str, np.ndarray]
    betas: dict[str, np.ndarray]
    joints: dict[str, np.ndarray]
    mano: dict[str, Hand]
    rotation: np.ndarray
    shift: np.ndarray
    verts: np.ndarray
    faces: np.ndarray
    angle: np.ndarray
    """(T,) of a second part."""

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.shift)

    def origin(self, side: str, left="as shipped") -> np.ndarray:
        """(T, 3) translation of MANO's origin."""
        return self.wrist[side] - self.mano[side].wrist_offset(self.betas[side], left)

    def matrices(self) -> np.ndarray:
        """(T, 4, 4) of the object to the world."""
        return rigid(self.rotation, self.shift)


def rigid(rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
    result = np.tile(np.eye(4), (len(rotation), 1, 1))
    result[:, :3, :3], result[:, :3, 3] = rotation, shift
    return result


def turns(vectors: np.ndarray) -> np.ndarray:
    return Rotation.from_rotvec(vectors).as_matrix()


def vectors(rotations: np.ndarray) -> np.ndarray:
    return Rotation.from_matrix(rotations).as_rotvec()


@cache
def scene(left: str = "as shipped", frames: int = FRAMES) -> Scene:
    """The interaction, with keypoints as the given left hand has them."""
    draw, time = np.random.default_rng(1), np.arange(frames)[:, None]
    rotation = turns(time * [0.05, 0.12, -0.08] + [0.3, 0.1, 0.2])
    shift = [0.1, 0.2, 0.9] + time * [0.01, 0.004, 0.006]
    pose, wrist, betas, joints, mano = {}, {}, {}, {}, {}
    right_pose = 0.1 * draw.standard_normal((1, 16, 3)) + 0.01 * draw.standard_normal(
        (frames, 16, 3)
    )
    right_pose[:, 1:, 2] += 0.4
    for side in SIDES:
        mano[side] = Hand(side)
        place = np.array([0.1, 0.05, 0.02]) * (FLIP if side == "left" else 1)
        pose[side] = right_pose * (-FLIP if side == "left" else 1)
        start = turns(pose[side][0, 0])
        pose[side][:, 0] = vectors(rotation @ start)
        wrist[side] = rotation @ place + shift
        betas[side] = draw.standard_normal(10)
        joints[side] = mano[side].keypoints(pose[side], wrist[side], betas[side], left)
    box = trimesh.creation.box((0.06, 0.08, 0.05))
    verts = np.array(box.vertices, dtype=np.float32).astype(np.float64)
    angle = np.linspace(0.3, 0.9, frames)
    faces = np.array(box.faces)
    return Scene(pose, wrist, betas, joints, mano, rotation, shift, verts, faces, angle)


def flat(pose: np.ndarray) -> np.ndarray:
    return pose.reshape(len(pose), 48)


def cameras(frames: int = FRAMES) -> np.ndarray:
    """(T, 4, 4) of a slowly moving camera to the world."""
    time = np.arange(frames)[:, None]
    return rigid(turns(time * CAMERA_TURN), time * [0.002, 0.001, 0.0])


def opened(s: Scene) -> np.ndarray:
    """(T, 4, 4) of a second part that opens about the hinge x = 0 of the first."""
    hinge = turns(s.angle[:, None] * [0.0, 0.0, -1.0])
    return rigid(s.rotation @ hinge, s.shift)


def lid(s: Scene) -> np.ndarray:
    """Vertices of the second part, which stands on the first one's edge."""
    return s.verts + [0.0, 0.08, 0.0]
