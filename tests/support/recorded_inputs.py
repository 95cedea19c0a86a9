"""Files of the example recording that a tracker or a user spoiled, as hand.npz and object.obj."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from bad_inputs import BOX_CORNERS, write_mesh

import geneoh
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.sequence.placing import placed

EXAMPLES = Path(__file__).parents[2] / "examples"
CLEAN, NOISY = EXAMPLES / "taco_clean.npz", EXAMPLES / "taco_noisy.npz"
OBJECT = EXAMPLES / "taco_object.obj"
LENGTH = 146
"""Frames of the example recording."""


def recorded_keypoints() -> np.ndarray:
    """Keypoints of the frames of `recorded`."""
    with np.load(CLEAN) as arrays:
        return arrays["left_joints"][60:72]


def recorded(**changes: object) -> Callable[[Path], None]:
    """Frames of the example recording, of a left hand that moves the object, in `joints` layout."""

    def write(folder: Path) -> None:
        sequence = geneoh.load(CLEAN, obj=OBJECT)[60:72]
        joints = sequence.hands[0].joints
        assert joints is not None
        fields = {
            "joints": joints.numpy(),
            "side": "left",
            "fps": 30.0,
            "object_rotation": sequence.object.rotation.numpy(),
            "object_translation": sequence.object.translation.numpy(),
            **changes,
        }
        np.savez(folder / "hand.npz", **fields)
        (mesh,) = sequence.object.meshes
        write_mesh(folder / "object.obj", mesh.verts.numpy(), mesh.faces.numpy())

    return write


def write_example(folder: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays as hand.npz, with the mesh of the examples beside it."""
    np.savez(folder / "hand.npz", **arrays)
    (folder / "object.obj").write_bytes(OBJECT.read_bytes())


def with_repeated_poses(folder: Path) -> None:
    """Frames of the recording whose object was seen in every second one."""
    with np.load(CLEAN) as arrays:
        seen = 60 + np.array([0, 2, 2, 4, 4, 6, 6, 8, 8, 10, 10, 11])
        fields = {name: arrays[name][seen] for name in ("object_rotation", "object_translation")}
    recorded(**fields)(folder)


def on_a_line(path: np.ndarray) -> np.ndarray:
    """A path with four of its twelve frames on a line between the others."""
    share = np.arange(1, 5).reshape(-1, *[1] * (path.ndim - 1)) / 5
    line = path[3] + share * (path[8] - path[3])
    return np.concatenate([path[:4], line, path[8:]]).astype(np.float32)


def with_hands_on_a_line(folder: Path) -> None:
    """The recording with interpolated keypoints in some frames."""
    recorded(joints=on_a_line(recorded_keypoints()))(folder)


def with_poses_on_a_line(folder: Path) -> None:
    """The recording with interpolated poses in some frames."""
    with np.load(CLEAN) as arrays:
        path = on_a_line(arrays["object_translation"][60:72])
    recorded(object_translation=path)(folder)


def that_stays_behind(*names: str) -> Callable[[Path], None]:
    """The recording with arrays of hand or object that keep one pose for a while, and jitter."""

    def write(folder: Path) -> None:
        arrays, frames = dict(np.load(CLEAN)), np.arange(LENGTH)
        frames[42:50] = 41
        shift = np.random.default_rng(0).normal(scale=0.001, size=(LENGTH, 1, 3))
        shifts = {"left_joints": shift, "left_wrist": shift[:, 0], "object_translation": shift}
        for name in names:
            arrays[name] = (arrays[name][frames] + shifts.get(name, 0.0)).astype(np.float32)
        write_example(folder, arrays)

    return write


def with_faulty_frame(
    wrong: Callable[[np.ndarray], np.ndarray],
) -> Callable[[Path], None]:
    """The recording with another hand in its fifth frame."""
    joints = recorded_keypoints().copy()
    joints[5] = wrong(joints)
    return recorded(joints=joints)


def reflected_at_the_palm(joints: np.ndarray) -> np.ndarray:
    """One frame whose palm stays where it is, of a hand of the other side."""
    normal = np.cross(joints[5] - joints[0], joints[17] - joints[0])
    normal /= np.linalg.norm(normal)
    return joints - 2 * ((joints - joints[0]) @ normal)[:, None] * normal


def transposed(folder: Path) -> None:
    """The noisy example with the rotations of its object the wrong way round."""
    arrays = dict(np.load(NOISY))
    arrays["object_rotation"] = arrays["object_rotation"].swapaxes(-1, -2)
    write_example(folder, arrays)


def late(folder: Path) -> None:
    """The example recording with a hand that comes six frames late."""
    arrays = dict(np.load(CLEAN))
    for name in ("left_joints", "left_pose", "left_wrist"):
        arrays[name] = np.concatenate([arrays[name][:1].repeat(6, 0), arrays[name][:-6]])
    write_example(folder, arrays)


def sway(frames: int) -> Rigid:
    """The motion from the world to a camera that sways."""
    time = torch.arange(frames) / 30
    waves = torch.stack([torch.sin(pace * time) for pace in (2.1, 2.9, 3.7)], 1)
    return Rigid(axis_angle_to_matrix(0.25 * waves), 0.05 * waves)


def by_a_moving_camera(folder: Path, **camera: np.ndarray) -> None:
    """The example recording in the frame of a camera that sways, perhaps with its poses."""
    sequence = geneoh.load(CLEAN, obj=OBJECT)
    seen = placed(sequence, sway(sequence.frames))
    (hand,), motion = seen.hands, seen.object
    arrays = dict(np.load(CLEAN))
    write_example(
        folder,
        arrays
        | {
            "left_joints": hand.joints.numpy(),
            "left_pose": hand.pose.numpy(),
            "left_wrist": hand.wrist.numpy(),
            "object_rotation": motion.rotation.numpy(),
            "object_translation": motion.translation.numpy(),
        }
        | camera,
    )


def by_a_known_camera(folder: Path) -> None:
    """The same with the poses of the camera."""
    by_a_moving_camera(folder, camera_to_world=sway(LENGTH).inverse().matrices().numpy())


def by_an_inverted_camera(folder: Path) -> None:
    """The same with inverted poses of the camera."""
    by_a_moving_camera(folder, camera_to_world=sway(LENGTH).matrices().numpy())


def cut(folder: Path) -> None:
    """Fifty frames of the example recording, of which the second half is elsewhere."""
    arrays = dict(np.load(CLEAN))
    frames = len(arrays["left_valid"])
    arrays |= {n: v[50:100] for n, v in arrays.items() if v.ndim and len(v) == frames}
    for name in ("left_joints", "left_wrist", "object_translation"):
        arrays[name][25:] += 0.5
    write_example(folder, arrays)


def frames_with_contact() -> dict[str, np.ndarray]:
    """Arrays of ninety frames of the example recording in which the hand is at its object."""
    arrays = dict(np.load(CLEAN))
    frames = len(arrays["left_valid"])
    return arrays | {n: v[20:110] for n, v in arrays.items() if v.ndim and len(v) == frames}


def in_a_box(folder: Path) -> None:
    """The example recording with the box around its object instead of the mesh."""
    write_example(folder, frames_with_contact())
    verts = geneoh.load_mesh(OBJECT).verts.numpy()
    corners = (BOX_CORNERS - BOX_CORNERS.min(0)) / np.ptp(BOX_CORNERS, axis=0)
    write_mesh(folder / "object.obj", verts.min(0) + corners * np.ptp(verts, axis=0))


def beside(folder: Path) -> None:
    """The example recording with a hand that is 6 cm beside its true place all the time."""
    arrays = frames_with_contact()
    for name in ("left_joints", "left_wrist"):
        arrays[name] = arrays[name] + np.array([0.06, 0, 0], np.float32)
    write_example(folder, arrays)


def with_two_hands(
    exchanged: slice, *, same: bool = False, following: slice = slice(0, 0)
) -> Callable[[Path], None]:
    """The recording's left hand and its mirror image beside it, exchanged in some frames; or with a
    left hand that follows the right one in some frames; or the same hand under both names."""

    def write(folder: Path) -> None:
        left = recorded_keypoints()
        right = left.copy() if same else left * [-1, 1, 1] + [1 + 2 * left[:, :, 0].mean(), 0, 0]
        left[exchanged], right[exchanged] = right[exchanged], left[exchanged].copy()
        left[following] = right[following]
        recorded(joints=left)(folder)
        arrays = dict(np.load(folder / "hand.npz"))
        for name in ("joints", "side"):
            del arrays[name]
        own = {"format": "geneoh-sequence", "version": 1}
        np.savez(folder / "hand.npz", left_joints=left, right_joints=right, **own, **arrays)

    return write


def inverted(folder: Path) -> None:
    """The noisy example about its first place, with the poses of its object the wrong way round."""
    transposed(folder)
    arrays = dict(np.load(folder / "hand.npz"))
    start = arrays["object_translation"][0, 0]
    for name in ("left_joints", "left_wrist", "object_translation"):
        arrays[name] = arrays[name] - start
    shift = arrays["object_rotation"] @ arrays["object_translation"][..., None]
    arrays["object_translation"] = -shift[..., 0]
    np.savez(folder / "hand.npz", **arrays)
