"""Object meshes: found by name, brought to metres, written beside sequences and named in them."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from geneoh.choices import Unit
from geneoh.errors import InputError
from geneoh.files.npz import Arrays
from geneoh.files.outputs import is_ours
from geneoh.geometry.mesh import METRES, Mesh
from geneoh.geometry.mesh_files import MESH_SUFFIXES, load_mesh
from geneoh.readers.npz.layouts import MESH_FIELDS
from geneoh.readers.records import Array, Notes, Record
from geneoh.sequence.sequence import ObjectTrack

FILES, HASHES = MESH_FIELDS
IN_NO_FILE = "the object's mesh was made in memory, and no file is known that holds it"
"""What is said of a sequence that has hashes of its meshes alone."""


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
    """The mesh file beside a file that has its name, where there is one; no GLB of ours."""
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
    """An object with the separate meshes of its one file, if each has a pose, and a note on it."""
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


def obj_text(mesh: Mesh) -> str:
    """A mesh as OBJ; nine digits are enough to read every float32 back exactly."""
    verts = "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in mesh.verts.tolist())
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + 1).tolist())
    return verts + faces


def mesh_arrays(meshes: tuple[Mesh, ...], folder: Path) -> Arrays:
    """SHA-256 of meshes' contents, and the paths from a folder where all of them are in files."""
    if not meshes:
        return {}
    arrays = {HASHES: np.array([mesh.sha256 for mesh in meshes])}
    sources = [mesh.source for mesh in meshes if mesh.source is not None]
    if len(sources) == len(meshes):
        arrays[FILES] = np.array([_seen_from(folder, source) for source in sources])
    return arrays


def _seen_from(folder: Path, file: Path) -> str:
    """The path from a folder to a file, so that both can be moved together."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # another drive of Windows
        return str(file.absolute())


def find_meshes(record: Record, folder: Path) -> tuple[tuple[Mesh, ...], str]:
    """The meshes that a file names, if all are there and as they were; else none, and why."""
    if FILES not in record:
        return (), IN_NO_FILE if HASHES in record else ""
    names = record.texts(FILES)
    hashes = record.texts(HASHES) if HASHES in record else []
    meshes: list[Mesh] = []
    for index, name in enumerate(names):
        path = folder / name
        if not path.is_file():
            return (), f"the object's mesh {name} is not there any more"
        try:
            same = known_mesh(path, hashes[index : index + 1] if hashes else None)
        except InputError as error:
            return (), f"the object's mesh cannot be used: {error}"
        if same is None:
            return (), f"the object's mesh {name} is another one than it was"
        meshes.append(same)
    return tuple(meshes), ""


def known_mesh(path: Path, hashes: list[str] | None) -> Mesh | None:
    """The mesh or part of a file with one of some hashes, in any unit; without, all in metres."""
    for unit in reversed(METRES):  # metres first
        whole = load_mesh(path, unit)
        for mesh in (whole, *whole.parts):
            if hashes is None or mesh.sha256 in hashes:
                return mesh
    return None
