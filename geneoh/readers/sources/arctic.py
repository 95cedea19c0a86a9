"""ARCTIC as it is distributed: raw_seqs/{sid}/{seq}.mano.npy and .object.npy,
meta/object_vtemplates/.

Hands: translation of MANO's origin, poses relative to MANO's mean pose, left hand as shipped. World
frame, 30 frames a second. The object's translation and its templates are in millimetres. An object
has a fixed bottom and a top that turns about (0, 0, -1); the bottom comes first, the whole object
moves with it.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.readers import base
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.foreign_files import read_array, read_json, read_record
from geneoh.readers.meshes import find_mesh, part_of_mesh, read_mesh
from geneoh.readers.records import Array, Record
from geneoh.readers.transforms import rigid_matrices, rotation_matrices

TEMPLATES = Path("meta/object_vtemplates")
MILLIMETRES = 0.001
HINGE = np.array([0.0, 0.0, -1.0])
"""Axis of the top in the canonical frame, through its origin."""
TOP, BOTTOM = 0, 1
"""In parts.json, by the code behind the published numbers; its documentation says the opposite."""
CONVENTION = base.ManoConvention("origin", mean_added=True)


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands and the two parts of the object."""
    record = read_record(clip.path)
    stem = clip.path.name.removesuffix(".mano.npy")
    values = read_array(clip.path.with_name(f"{stem}.object.npy"), ("T", 7))
    folder = options.objects or base.ancestor(clip.path, 3) / TEMPLATES
    meshes, contradictions = read_parts(folder, stem.split("_")[0])
    yield base.ClipParts(
        f"ARCTIC {clip.name}",
        [read_hand(record.record(side), side) for side in ("right", "left")],
        meshes,
        part_motion(values[:, 0], values[:, 1:4], values[:, 4:] * MILLIMETRES),
        cross_checks=base.CrossChecks(contradictions=contradictions),
    )


def read_hand(
    record: Record, side: Side, ending: str = "", joints: Array | None = None
) -> base.ManoParameters:
    """One hand in the world, with (T, 21, 3) stored keypoints; fields have an ending."""
    return base.ManoParameters(
        side,
        record.side_by_side(**{f"rot{ending}": 3, f"pose{ending}": 45}),
        record.array(f"trans{ending}", ("T", 3)),
        record.array(f"shape{ending}", (10,), ("T", 10)).reshape(-1, 10).mean(0),
        joints=joints,
        confidence=confidence_of(record, f"fitting_err{ending}"),
    )


def confidence_of(record: Record, name: str) -> Array | None:
    """(T, 21) confidence from the error of ARCTIC's fit, whose unit is not documented.

    1 up to the median of the sequence, beyond it the median's share of the error.
    """
    error = record.optional_array(name, ("T",), ("T", 1))
    if error is None:
        return None
    error = np.abs(error.reshape(-1))
    typical = np.nanmedian(error) if np.isfinite(error).any() else 0.0
    trust = np.where(error > typical, typical / np.maximum(error, 1e-12), 1.0)
    return np.tile(np.where(np.isfinite(error), trust, 0.0)[:, None], 21)


def part_motion(angle: Array, orient: Array, shift: Array) -> Array:
    """(T, 2, 4, 4) of bottom and top: the top is turned about the hinge, then moved as a whole."""
    whole = rotation_matrices(orient)
    opened = whole @ rotation_matrices(angle[:, None] * HINGE)
    return np.stack([rigid_matrices(whole, shift), rigid_matrices(opened, shift)], axis=1)


def read_parts(folder: Path, name: str) -> tuple[dict[str, Mesh], tuple[str, ...]]:
    """Bottom and top in metres, and what contradicts the meaning of the parts' file."""
    folder, mesh, ids = read_template(folder, name)
    where = str(folder / "mesh.obj")
    bottom, top = (part_of_mesh(mesh, ids == part, where) for part in (BOTTOM, TOP))
    meshes = {f"arctic_{name}_bottom": bottom, f"arctic_{name}_top": top}
    return meshes, exchanged_parts(folder, bottom, top)


def read_template(folder: Path, name: str) -> tuple[Path, Mesh, Array]:
    """The folder and mesh of a whole object in metres, and (V,) the part of each vertex."""
    parts = folder / name / "parts.json"
    mesh = find_mesh([folder / name / "mesh.obj"], name, MILLIMETRES)
    ids = Record(str(parts), {"parts": read_json(parts)}).array("parts", ("V",))
    if len(ids) != len(mesh.verts):
        raise InputError(
            f"{parts}: expected one number for each of {len(mesh.verts)} vertices, got {len(ids)}; "
            "it belongs to another mesh"
        )
    return folder / name, mesh, ids


def exchanged_parts(folder: Path, bottom: Mesh, top: Mesh) -> tuple[str, ...]:
    """Whether the parts' own meshes say that top and bottom are exchanged."""
    files = [folder / "bottom.obj", folder / "top.obj"]
    if not all(file.is_file() for file in files):
        return ()
    true_bottom, true_top = (middle(read_mesh(file, MILLIMETRES)) for file in files)
    straight = np.linalg.norm(middle(bottom) - true_bottom) + np.linalg.norm(middle(top) - true_top)
    crossed = np.linalg.norm(middle(bottom) - true_top) + np.linalg.norm(middle(top) - true_bottom)
    if crossed < straight:
        return ("parts: parts.json calls top what top.obj calls bottom; 0 must be the top",)
    return ()


def middle(mesh: Mesh) -> Array:
    """(3,) the middle of the bounding box."""
    return ((mesh.verts.amax(0) + mesh.verts.amin(0)) / 2).double().numpy()


READER = DatasetReader(parts, ("*.mano.npy",), name_parts=2, convention=CONVENTION)
