"""Sequences from arrays in memory, by the names and with the checks of the file format."""

import difflib
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from geneoh.arguments import checked_call
from geneoh.bundle import unmasked
from geneoh.choices import SIDES
from geneoh.errors import InputError
from geneoh.geometry.mesh_files import MeshInput, meshes_of
from geneoh.readers.clock import CLOCK_NAMES, TIME_NAMES, dates_in, is_column, length_of
from geneoh.readers.npz.files import sequence_in
from geneoh.readers.npz.layouts import (
    CAMERA_FIELDS,
    CAMERA_NAMES,
    CAMERA_POSES,
    FORMAT,
    OBJECT_FIELDS,
    OWN_FIELDS,
    own_names,
    quoted,
)
from geneoh.readers.records import RESHAPE, Record
from geneoh.sequence.sequence import Sequence
from geneoh.sequence.validation import check_sequence

FIELDS = (*OWN_FIELDS, *OBJECT_FIELDS, *CAMERA_FIELDS, CAMERA_POSES, "hand_model")
FIELDS += ("timestamps", "frame_ids")
MESH_NAMES = ("obj", "object", "mesh")
"""Wrong names under which callers may pass `meshes`."""
NAMES = (*FIELDS, *CLOCK_NAMES)
"""All names of arrays, including other names of timestamps."""


@checked_call
def from_arrays(
    *, fps: float | int | None = None, meshes: MeshInput = (), source: str = "arrays", **arrays: Any
) -> Sequence:
    """A sequence from numpy arrays, torch tensors or nested lists in memory.

        sequence = geneoh.from_arrays(
            right_joints=joints,  # (T, 21, 3)
            object_rotation=rotation,  # (T, 3, 3), or (T, Q, 3, 3) for an object of Q parts
            object_translation=translation,  # (T, 3) or (T, Q, 3)
            fps=30,
            meshes="mug.obj",
        )

    Args:
        fps: frames a second; not needed beside times such as `timestamps`.
        meshes: meshes of the object in metres, one per rigid part: a mesh, its file, or a list of
            them; without any, the hand is cleaned alone.
        source: name of the sequence in messages.
        arrays: the fields of the file format by name. For each hand `right_joints` (T, 21, 3),
            world frame, metres, OpenPose order, or `right_pose` (T, 16, 3), absolute axis-angle in
            radians, with `right_wrist` (T, 3), metres; optional are `right_valid` (T,),
            `right_confidence` (T, 21), 0 to 1, and `right_betas` (10,); the same with `left_`.
            `hand_model` names the model of the betas. Frames with NaN count as not observed. For
            the object `object_rotation` and `object_translation`, object to world. For hands that
            were estimated from images `camera_position` or `camera_ray`, the direction from the
            camera, (3,) or (T, 3), in the world frame. If all of this is in the frame of a camera
            that moves, its poses `camera_to_world` (T, 4, 4). If frames were dropped or are uneven,
            `timestamps` (T,), seconds or numpy dates, or `frame_ids` (T,) beside `fps`; the frames
            are then resampled to an even rate.

    Raises:
        InputError: an array has a wrong shape, a name is unknown, or the numbers cannot be an
            interaction; the message says which and what to do.
    """
    loaded = meshes_of(meshes)
    for name in arrays:
        if name not in NAMES:
            raise InputError(f"{source}: '{name}' is no field of a sequence; {meant(name)}")
    values = {name: array_of(value) for name, value in arrays.items()}
    record = Record(source, values, RESHAPE)
    check_times(record)
    if fps is not None:
        values["fps"] = np.array(fps)
    elif not values.keys() & TIME_NAMES.keys():
        raise InputError(
            f"{source}: expected 'fps', the number of frames a second, got none; give it, or the "
            "times of the frames in seconds as 'timestamps'"
        )
    sequence, notes = sequence_in(record, FORMAT, loaded)
    sequence = replace(sequence, source="; ".join((source, *notes)), assumed=notes)
    check_sequence(sequence, source)
    return sequence


def meant(name: str) -> str:
    """The name that an unknown field name probably stands for, as the end of a message."""
    if name in MESH_NAMES:
        return "did you mean 'meshes'?"
    if name in CAMERA_NAMES:
        return f"did you mean '{CAMERA_POSES}'?"
    sided = [each for side in SIDES if (each := f"{side}_{name}") in OWN_FIELDS]
    close = sided or difflib.get_close_matches(name, NAMES, 1)
    if close:
        return f"did you mean {' or '.join(map(repr, close))}?"
    return f"the fields are {quoted(FIELDS)}"


def check_times(record: Record) -> None:
    """Refuse timestamps that are not one number or date per frame; in a file they are skipped."""
    values = dict(record.values) | dates_in(record)
    names = [own_names(side)[name] for side in SIDES for name in ("joints", "pose")]
    frames = next((length_of(values[name]) for name in names if name in values), 0)
    for name in CLOCK_NAMES:
        if name in values and not is_column(values[name], frames):
            raise InputError(
                f"{record.where}: '{name}' must be one number for each of the {frames} frames, got "
                f"{np.asarray(values[name]).dtype} of shape {np.shape(values[name])}; correct it "
                "or leave it out"
            )


def array_of(value: Any) -> Any:
    """A tensor, an array or nested lists as a numpy array; ragged lists unchanged."""
    if isinstance(value, Tensor):
        # numpy has no bfloat16
        value = value.float() if value.dtype == torch.bfloat16 else value
        return value.detach().cpu().numpy()
    try:
        array = np.asarray(unmasked(value))
    except ValueError:
        return value
    return value if array.dtype == object and isinstance(value, list) else array
