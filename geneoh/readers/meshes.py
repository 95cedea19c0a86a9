"""Object meshes of data sets: found by name, brought to metres, written beside the sequences."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh, load_mesh
from geneoh.readers.records import Array
from geneoh.sequence.sequence import ObjectTrack


def find_mesh(
    places: Sequence[Path], what: str, scale: float = 1.0, *, centred: bool = False
) -> Mesh:
    """The mesh at the first of some paths that is a file, see `read_mesh`.

    `InputError` where there is none; it names the first path.
    """
    for place in places:
        if place.is_file():
            return read_mesh(place, scale, centred=centred)
    raise InputError(
        f"{places[0]}: expected the mesh of {what}, got no such file; "
        "download the data set's object models, or pass their folder with --objects"
    )


def read_mesh(path: Path, scale: float = 1.0, *, centred: bool = False) -> Mesh:
    """A mesh in metres; `scale` is metres per unit of the file.

    With `centred` the middle of its bounding box is moved to the origin.
    """
    mesh = load_mesh(path, tidy=False)
    verts = mesh.verts.double() * scale
    if centred:
        verts = verts - (verts.amax(0) + verts.amin(0)) / 2
    return Mesh(verts.float(), mesh.faces)


def with_parts(motion: ObjectTrack) -> tuple[ObjectTrack, tuple[str, ...]]:
    """An object whose one file holds several meshes, as these where there is a pose for each.

    Also what was made of such a file, in words.
    """
    meshes = motion.meshes[0].parts if len(motion.meshes) == 1 else ()
    held = f"the object's mesh file holds {len(meshes)} separate meshes"
    if len(meshes) == motion.rotation.shape[1]:
        return replace(motion, meshes=meshes), (f"{held}, taken as its parts in this order",)
    if meshes and motion.rotation.shape[1] == 1:
        cure = f"give poses of {len(meshes)} parts, or one file with --obj per part, if they move"
        return motion, (f"{held}, taken as one rigid body; {cure}",)
    return motion, ()


def part_of_mesh(mesh: Mesh, chosen: Array, name: str) -> Mesh:
    """The faces of which all corners are chosen, with their vertices; `InputError` for none."""
    inside = torch.from_numpy(chosen)[mesh.faces].all(-1)
    if not bool(inside.any()):
        raise InputError(f"{name}: expected a part with faces, got none; check the parts' file")
    used, faces = torch.unique(mesh.faces[inside], return_inverse=True)
    return Mesh(mesh.verts[used], faces)


def mesh_from(verts: Array, faces: Array) -> Mesh:
    """A mesh from arrays that a source holds."""
    return Mesh(
        torch.from_numpy(np.array(verts, dtype=np.float32)),
        torch.from_numpy(np.array(faces, dtype=np.int64)),
    )


def obj_text(mesh: Mesh) -> str:
    """A mesh as OBJ; nine digits are enough to read every float32 back exactly."""
    verts = "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in mesh.verts.tolist())
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist())
    return verts + faces
