"""Inputs that must be refused in one sentence, each with the words that the sentence must hold.

Every case starts from a folder with a good `hand.npz` and a good `object.obj` and spoils one thing.
"""

import io
import os
import pickle
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

FRAMES = 6
BOX_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 0.06 - 0.03
BOX_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


@dataclass(frozen=True)
class BadInput:
    """One way to be wrong."""

    name: str
    words: tuple[str, ...]
    """Each must be in the message."""
    spoil: Callable[[Path], None] = lambda folder: None
    """Changes the good files of a folder into bad ones."""
    options: tuple[str, ...] = ()
    """Further options of the command."""
    in_reading: bool = True
    """Whether reading the npz already refuses it, without its mesh."""


def good_arrays() -> dict[str, np.ndarray]:
    """A right hand of plausible keypoints that stays 8 cm above a box, in the `joints` layout."""
    finger, along = np.meshgrid(np.arange(5), np.arange(1, 5), indexing="ij")
    tips = np.stack([0.03 * along + 0.06, 0.02 * finger - 0.04, 0 * along], -1)
    joints = np.concatenate([np.zeros((1, 3)), tips.reshape(20, 3)]) + np.array([-0.1, 0, 0.08])
    return {
        "joints": np.repeat(joints[None].astype(np.float32), FRAMES, 0),
        "side": np.array("right"),
        "fps": np.array(30.0),
        "object_rotation": np.tile(np.eye(3, dtype=np.float32), (FRAMES, 1, 1, 1)),
        "object_translation": np.zeros((FRAMES, 1, 3), np.float32),
    }


def write_mesh(path: Path, corners: np.ndarray, faces: np.ndarray = BOX_FACES) -> None:
    """A mesh as an OBJ file."""
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in corners]
    path.write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in faces + 1), ""]))


def write_good(folder: Path) -> None:
    """The files that every case starts from."""
    np.savez(folder / "hand.npz", **good_arrays())
    write_mesh(folder / "object.obj", BOX_CORNERS)


def with_arrays(**changes: object) -> Callable[[Path], None]:
    """Replace fields of the hand's file; None takes a field out, a function changes it."""

    def spoil(folder: Path) -> None:
        arrays = good_arrays()
        for name, change in changes.items():
            value = change(arrays[name].copy()) if callable(change) else change
            arrays = {key: array for key, array in arrays.items() if key != name}
            if value is not None:
                arrays[name] = np.asarray(value)
        np.savez(folder / "hand.npz", **arrays)

    return spoil


def with_nan_in(frame: int, value: float = np.nan) -> Callable[[np.ndarray], np.ndarray]:
    """Put NaN, or another number, into one frame of a field."""

    def change(array: np.ndarray) -> np.ndarray:
        array[frame] = value
        return array

    return change


def truncate(folder: Path) -> None:
    """Cut the end of the npz off, as a full disk or a broken download does."""
    path = folder / "hand.npz"
    path.write_bytes(path.read_bytes()[:-200])


def flip_byte(folder: Path) -> None:
    """Change one byte in the middle of the first array."""
    path = folder / "hand.npz"
    data = bytearray(path.read_bytes())
    data[len(data) // 8] ^= 0xFF
    path.write_bytes(bytes(data))


CANARY = "canary"


class Hostile:
    """Unpickling this makes the folder `canary` in the working directory."""

    def __reduce__(self):
        return os.mkdir, (CANARY,)


def hostile_pickle(folder: Path) -> None:
    """A pickle under the name of an npz."""
    (folder / "hand.npz").write_bytes(pickle.dumps(Hostile()))


def hostile_member(folder: Path) -> None:
    """An npz whose joints are a pickled object."""
    np.savez(folder / "hand.npz", **{**good_arrays(), "joints": np.array(Hostile(), dtype=object)})


def object_array(folder: Path) -> None:
    """An npz with a dict in it, as GRAB ships them."""
    joints = np.array({"joints": 1}, dtype=object)
    np.savez(folder / "hand.npz", **{**good_arrays(), "joints": joints})


def single_npy(folder: Path) -> None:
    """A .npy under the name of an npz."""
    with (folder / "hand.npz").open("wb") as file:
        np.save(file, good_arrays()["joints"])


def lying_header(folder: Path) -> None:
    """An npz whose array claims a terabyte and holds nothing."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f4", "fortran_order": False, "shape": (2**38,)}
    )
    with zipfile.ZipFile(folder / "hand.npz", "w") as archive:
        archive.writestr("joints.npy", header.getvalue())


def empty_mesh(folder: Path) -> None:
    """A mesh file without a face."""
    (folder / "object.obj").write_text("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\n")


def flat_mesh(folder: Path) -> None:
    """A mesh whose every face has lost its area."""
    write_mesh(folder / "object.obj", BOX_CORNERS * [1, 0, 0])


def nan_mesh(folder: Path) -> None:
    """A mesh with a vertex that is nowhere."""
    corners = BOX_CORNERS.copy()
    corners[0, 0] = np.nan
    write_mesh(folder / "object.obj", corners)


def text_mesh(folder: Path) -> None:
    """A text under the name of a mesh."""
    (folder / "object.obj").write_text("this is not a mesh\n")


def far_object(folder: Path) -> None:
    """An object three metres from the hand."""
    with_arrays(object_translation=np.full((FRAMES, 1, 3), 3.0))(folder)


def millimetre_mesh(folder: Path) -> None:
    """A box 60 m long: it was meant in millimetres."""
    write_mesh(folder / "object.obj", BOX_CORNERS * 1000)


REFUSED = (
    BadInput(
        "The file is not there", ("no such file",), lambda folder: (folder / "hand.npz").unlink()
    ),
    BadInput("The download broke off", ("truncated or damaged",), truncate),
    BadInput("A byte has flipped", ("damaged",), flip_byte),
    BadInput("The file is a pickle", ("pickle", "never"), hostile_pickle),
    BadInput("pickled member", ("joints", "pickle", "never"), hostile_member),
    BadInput("The npz holds a Python object", ("joints", "Python objects"), object_array),
    BadInput("single npy", ("npz", "single .npy"), single_npy),
    BadInput("lying header", ("joints", "declares", "damaged"), lying_header),
    BadInput(
        "Keypoints of an npz are flat, (T, 63)",
        ("joints", "(T, 21, 3)", "(6, 63)", "reshape"),
        with_arrays(joints=lambda joints: joints.reshape(FRAMES, 63)),
    ),
    BadInput("16 joints", ("(T, 21, 3)", "(6, 16, 3)"), with_arrays(joints=lambda j: j[:, :16])),
    BadInput(
        "Numbers are texts",
        ("joints", "array of numbers"),
        with_arrays(joints=lambda joints: joints.astype(str)),
    ),
    BadInput("no frames", ("joints", "at least one frame"), with_arrays(joints=lambda j: j[:0])),
    BadInput(
        "Hand and object differ in length",
        ("same number of frames", "6", "4"),
        with_arrays(joints=lambda joints: joints[:4]),
    ),
    BadInput(
        "NaN in a frame that is marked valid",
        ("finite", "3", "mark them as not valid"),
        with_arrays(joints=with_nan_in(3), valid=np.ones(FRAMES, bool)),
    ),
    BadInput(
        "infinite object",
        ("object", "finite", "2"),
        with_arrays(object_translation=with_nan_in(2, np.inf)),
    ),
    BadInput(
        "Every frame is invalid", ("at least one frame",), with_arrays(valid=np.zeros(FRAMES, bool))
    ),
    BadInput(
        "NaN everywhere",
        ("at least one frame",),
        with_arrays(joints=lambda joints: joints * np.nan),
    ),
    BadInput("mask of words", ("valid", "boolean"), with_arrays(valid=["yes"] * FRAMES)),
    BadInput(
        "confidence in percent",
        ("confidence", "between 0 and 1", "90"),
        with_arrays(confidence=np.full(FRAMES, 90.0)),
    ),
    BadInput("no hand", ("right_joints", "global_orient"), with_arrays(joints=None)),
    BadInput("The side is not said", ("--side left or --side right",), with_arrays(side=None)),
    BadInput("wrong side", ("side", "'left' or 'right'", "'both'"), with_arrays(side="both")),
    BadInput(
        "The side is contradicted",
        ("left hand is asked", "'side' says right"),
        options=("--side", "left"),
    ),
    BadInput(
        "Fields of two layouts",
        ("one layout", "joints", "hand_trans", "remove"),
        with_arrays(hand_trans=np.zeros((FRAMES, 3))),
    ),
    BadInput("other format", ("format", "geneoh-sequence"), with_arrays(format="npz")),
    BadInput(
        "newer version",
        ("version", "2"),
        with_arrays(format="geneoh-sequence", version=np.array(2)),
    ),
    BadInput(
        "A mesh, but no poses",
        ("object_rotation", "obj_pose", "object's motion"),
        with_arrays(object_rotation=None, object_translation=None),
        in_reading=False,  # without a mesh it is a hand alone
    ),
    BadInput(
        "half an object",
        ("object_rotation", "object_translation"),
        with_arrays(object_translation=None),
    ),
    BadInput(
        "two objects",
        ("given once", "obj_pose", "remove"),
        with_arrays(obj_pose=np.tile(np.eye(4), (FRAMES, 1, 1))),
    ),
    BadInput(
        "transposed obj_pose",
        ("obj_pose", "last row", "transpose"),
        with_arrays(
            object_rotation=None,
            object_translation=None,
            obj_pose=np.tile(np.eye(4) + 0.3 * np.eye(4)[::-1] * [1, 0, 0, 0], (FRAMES, 1, 1)),
        ),
    ),
    BadInput(
        "Rotations as axis-angle",
        ("object_rotation", "(T, Q, 3, 3)", "axis-angle"),
        with_arrays(object_rotation=np.zeros((FRAMES, 3))),
    ),
    BadInput(
        "Rotations that mirror",
        ("rotation", "determinant -1", "reflection"),
        with_arrays(object_rotation=lambda rotation: -rotation),
    ),
    BadInput(
        "Rotations that scale",
        ("rotation", "a scale"),
        with_arrays(object_rotation=lambda rotation: 0.01 * rotation),
    ),
    BadInput("A rate of 0", ("fps", "1 to 1000"), with_arrays(fps=np.array(0.0))),
    BadInput(
        "a word for a list of flags",
        ("valid", "same number of frames"),
        with_arrays(valid="x" * 10000),
    ),
    BadInput(
        "an object that is nowhere",
        ("object", "10000 m", "3e+38"),
        with_arrays(object_translation=lambda array: array + np.float32(3e38)),
    ),
    BadInput(
        "A coordinate of 3e38",
        ("right hand", "3e+38", "within 10000 m"),
        with_arrays(joints=lambda array: array + np.float32(3e38)),
    ),
    BadInput(
        "Seconds for a rate",
        ("fps", "pass that", "as seconds per frame"),
        with_arrays(fps=np.array(0.0333)),
    ),
    BadInput("almost no frame rate", ("fps", "1 to 1000"), with_arrays(fps=np.array(1e-40))),
    BadInput("A rate of a million", ("fps", "1 to 1000"), with_arrays(fps=np.array(1e6))),
    BadInput("nan frame rate", ("fps", "nan"), with_arrays(fps=np.array(np.nan))),
    BadInput(
        "Keypoints in millimetres",
        ("metres", "millimetres, divide by 1000", "--keypoint-unit mm"),
        with_arrays(joints=lambda joints: 1000 * joints),
    ),
    BadInput("tiny hand", ("metres",), with_arrays(joints=lambda joints: 0.001 * joints)),
    BadInput(
        "The object is 3 m away",
        ("metres", "must come near the object"),
        far_object,
        in_reading=False,
    ),
    BadInput(
        "The mesh is not there",
        ("object.obj", "no such file"),
        lambda f: (f / "object.obj").unlink(),
        in_reading=False,
    ),
    BadInput("A point cloud", ("object.obj", "points and no face"), empty_mesh, in_reading=False),
    BadInput("A mesh without area", ("object.obj", "no area"), flat_mesh, in_reading=False),
    BadInput("A NaN in the mesh", ("object.obj", "finite"), nan_mesh, in_reading=False),
    BadInput("A text for a mesh", ("object.obj",), text_mesh, in_reading=False),
    BadInput(
        "A mesh in millimetres",
        ("object.obj", "60 m long", "pass --unit mm", "0.001"),
        millimetre_mesh,
        in_reading=False,
    ),
    BadInput(
        "Two meshes for one part",
        ("1 rigid part,", "2 meshes"),
        options=("--obj", "object.obj"),
        in_reading=False,
    ),
    BadInput(
        "MANO without its files",
        ("MANO_RIGHT.pkl", "nowhere"),
        options=("--hand", "mano", "--mano", "nowhere"),
        in_reading=False,
    ),
    BadInput(
        "A preset that does not exist",
        ("preset", "fast", "'slow'"),
        options=("--preset", "slow"),
        in_reading=False,
    ),
)
"""Input that must end with exit code 2 and one line on standard error."""

TOLD = (
    BadInput(
        "NaN in a frame",
        ("not observed", "1 of 6 frames hold NaN"),
        with_arrays(joints=with_nan_in(3)),
    ),
    BadInput(
        "A pose is lost in one frame",
        ("1 frame without a pose of the object",),
        with_arrays(object_translation=with_nan_in(2)),
    ),
    BadInput("No frame rate", ("30 frames a second assumed",), with_arrays(fps=None)),
    BadInput(
        "A name has a slip",
        ("'confidense' is not read", "is it 'confidence'?"),
        with_arrays(confidense=np.ones(FRAMES)),
    ),
)
"""Input that is cleaned all the same (exit code 0), with these words said to the user."""
