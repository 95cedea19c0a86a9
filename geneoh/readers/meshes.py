"""Object meshes: found by name, brought to metres, cut into parts, written as OBJ."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch

from geneoh.choices import Unit
from geneoh.errors import InputError
from geneoh.files.outputs import is_ours
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import MESH_SUFFIXES, load_mesh
from geneoh.readers.records import Array, Notes
from geneoh.sequence.sequence import ObjectTrack


def find_mesh(
    places: Sequence[Path], what: str, unit: Unit = "m", *, centred: bool = False
) -> Mesh:
    """The mesh at the first of some paths that is a file, see `read_mesh`; `InputError` if none."""
    for place in places:
        if place.is_file():
            return read_mesh(place, unit, centred=centred)
    raise InputError(
        f"{places[0]}: expected the mesh of {what}, got no such file; "
        "download the data set's object models, or pass their folder with --objects"
    )


def mesh_beside(path: Path) -> tuple[Path, ...]:
    """The mesh file beside a file with the same stem, if any, except files that geneoh wrote."""
    meshes = (path.with_suffix(suffix) for suffix in MESH_SUFFIXES)
    return tuple(mesh for mesh in meshes if mesh.is_file() and not is_ours(mesh))[:1]


def read_mesh(path: Path, unit: Unit = "m", *, centred: bool = False) -> Mesh:
    """The one rigid mesh of a file, in metres; if `centred`, its middle at the origin."""
    mesh = load_mesh(path, unit, tidy=False)
    if not centred:
        return Mesh(mesh.verts, mesh.faces, mesh.source)
    verts = mesh.verts.double()
    return Mesh((verts - (verts.amax(0) + verts.amin(0)) / 2).float(), mesh.faces)


def with_parts(motion: ObjectTrack) -> tuple[ObjectTrack, Notes]:
    """The object with the separate meshes of its one file as parts, if each has a pose; a note."""
    meshes = motion.meshes[0].parts if len(motion.meshes) == 1 else ()
    held = f"the object's mesh file holds {len(meshes)} separate meshes"
    if len(meshes) == motion.rotation.shape[1]:
        return replace(motion, meshes=meshes), (f"{held}, taken as its parts in this order",)
    if meshes and motion.rotation.shape[1] == 1:
        cure = f"give poses of {len(meshes)} parts, or one file with --obj per part, if they move"
        return motion, (f"{held}, taken as one rigid body; {cure}",)
    return motion, ()


def part_of_mesh(mesh: Mesh, chosen: Array, name: str) -> Mesh:
    """The faces whose corners are all chosen, with their vertices; `InputError` if none is."""
    inside = torch.from_numpy(chosen)[mesh.faces].all(-1)
    if not bool(inside.any()):
        raise InputError(f"{name}: expected a part with faces, got none; check the parts' file")
    used, faces = torch.unique(mesh.faces[inside], return_inverse=True)
    return Mesh(mesh.verts[used], faces)


def obj_text(mesh: Mesh) -> str:
    """A mesh as OBJ; nine digits are enough to read every float32 back exactly."""
    verts = "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in mesh.verts.tolist())
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist())
    return verts + faces
