"""The object's motion out of the fields of a file."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.readers.fields import Fields
from geneoh.readers.npz_layouts import OBJECT_FIELDS, quoted
from geneoh.sequence.sequence import ObjectTrack

MOTION_MISSING = (
    "neither; add them, for an object that does not move the identity and zeros in every frame"
)


def read_object(fields: Fields, meshes: tuple[Mesh, ...]) -> ObjectTrack:
    """The object's motion, from rotation and translation or from 4x4 matrices.

    Raises:
        InputError: no motion, two of them, or one that is not finite or not rigid.
    """
    pair = [name for name in OBJECT_FIELDS[:2] if name in fields]
    if ("obj_pose" in fields) == bool(pair):
        raise InputError(
            f"{fields.file}: the object's motion must be given once, as 'object_rotation' with "
            f"'object_translation' or as 'obj_pose', got "
            + (f"{quoted(pair)} and 'obj_pose'; remove one of them" if pair else MOTION_MISSING)
        )
    if "obj_pose" in fields:
        matrix = fields.floats("obj_pose", ("T", 4, 4), ("T", "Q", 4, 4), unit="object to world")
        assert matrix is not None, "the field is there"
        matrix = matrix if matrix.ndim == 4 else matrix[:, None]
        refuse_bottom_row(fields, matrix)
        return ObjectTrack(meshes, matrix[..., :3, :3].clone(), matrix[..., :3, 3].clone())
    if len(pair) == 1:
        other = next(name for name in OBJECT_FIELDS[:2] if name != pair[0])
        raise InputError(f"{fields.file}: '{pair[0]}' needs '{other}', got none; add it")
    fields.refuse_lengths(*pair)
    rotation = fields.floats(
        "object_rotation",
        *(("T", "Q", 3, 3), ("T", 3, 3)),
        unit="as matrices",
        cure="turn axis-angle or quaternions into matrices",
    )
    translation = fields.floats("object_translation", ("T", "Q", 3), ("T", 3), unit="in metres")
    assert rotation is not None, "the field is there"
    assert translation is not None, "the field is there"
    rotation = rotation if rotation.ndim == 4 else rotation[:, None]
    translation = translation if translation.ndim == 3 else translation[:, None]
    if rotation.shape[1] != translation.shape[1]:
        raise InputError(
            f"{fields.file}: rotation and translation must have the same number of parts, got "
            f"{rotation.shape[1]} in 'object_rotation' and {translation.shape[1]} in "
            "'object_translation'; give one of each per part"
        )
    return ObjectTrack(meshes, rotation, translation)


def refuse_bottom_row(fields: Fields, matrix: Float[Tensor, "T Q 4 4"]) -> None:
    """Refuse 4x4 matrices that do not act on column vectors."""
    expected = matrix.new_tensor([0.0, 0.0, 0.0, 1.0])
    if not torch.allclose(matrix[..., 3, :].nan_to_num(), expected, atol=1e-4):
        row = matrix[0, 0, 3].tolist()
        raise InputError(
            f"{fields.file}: 'obj_pose' must have 0 0 0 1 as its last row, got {row} in the first "
            "frame; transpose it if its translation stands there"
        )
