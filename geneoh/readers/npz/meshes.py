"""How an npz refers to its object's meshes: by file paths, and by hashes of their contents."""

import os
from pathlib import Path

import numpy as np

from geneoh.errors import InputError
from geneoh.files.npz import Arrays
from geneoh.geometry.mesh import METRES, Mesh
from geneoh.geometry.mesh_files import load_mesh
from geneoh.readers.npz.layouts import MESH_FIELDS
from geneoh.readers.records import Notes, Record

FILES, HASHES = MESH_FIELDS
IN_NO_FILE = "the object's mesh was made in memory, and no file is known that holds it"
"""Note on a sequence with hashes but no paths of its meshes."""


def folder_of(path: Path) -> Path:
    """The folder that a file lies in, behind links: paths of meshes are relative to it."""
    return Path(os.path.realpath(path)).parent


def mesh_arrays(meshes: tuple[Mesh, ...], folder: Path) -> Arrays:
    """SHA-256 hashes of meshes, and their paths relative to a folder if every mesh has a file."""
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
        seen = Path(os.path.relpath(file, folder))
        if os.path.exists(file) and not os.path.exists(folder / seen):  # `..` behind a link
            seen = Path(os.path.relpath(os.path.realpath(file), os.path.realpath(folder)))
        return seen.as_posix()
    except ValueError:  # another drive of Windows
        return str(file.absolute())


def find_meshes(record: Record, folder: Path) -> tuple[tuple[Mesh, ...], str]:
    """The meshes that an npz names, if all files exist and are unchanged; else none, and why."""
    if FILES not in record:
        return (), IN_NO_FILE if HASHES in record else ""
    names = record.texts(FILES)
    hashes = record.texts(HASHES) if HASHES in record else []
    meshes: list[Mesh] = []
    for index, name in enumerate(names):
        path = folder / name
        if not os.path.isfile(path):
            return (), f"the object's mesh {name} is not there any more"
        try:
            same = known_mesh(path, hashes[index : index + 1] if hashes else None)
        except InputError as error:
            return (), f"the object's mesh cannot be used: {error}"
        if same is None:
            return (), f"the object's mesh {name} was changed since then"
        meshes.append(same)
    return tuple(meshes), ""


def notes_on_meshes(record: Record, meshes: tuple[Mesh, ...]) -> Notes:
    """A note where none of a caller's meshes, nor of their parts, is one that an npz has hashes of.

    The poses in the npz may be wrong for another mesh, which may have another origin or size.

    Raises:
        InputError: the meshes are those of the npz, in another order than that of its parts.
    """
    if HASHES not in record:
        return ()
    stored, given = record.texts(HASHES), [mesh.sha256 for mesh in meshes]
    if given != stored and sorted(given) == sorted(stored):
        numbers = ", ".join(str(stored.index(each) + 1) for each in given)
        raise InputError(
            f"{record.where}: expected the meshes in the order of the parts, got those of the "
            f"parts {numbers}; exchange them"
        )
    if any(each.sha256 in stored for mesh in meshes for each in (mesh, *mesh.parts)):
        return ()
    return ("the mesh in --obj is another one than the file was written with",)


def known_mesh(path: Path, hashes: list[str] | None) -> Mesh | None:
    """The mesh in a file, or its part, that has one of `hashes` in some unit, if any does.

    Without hashes it is the whole mesh, read in metres.
    """
    for unit in reversed(METRES):  # metres first
        whole = load_mesh(path, unit)
        for mesh in (whole, *whole.parts):
            if hashes is None or mesh.sha256 in hashes:
                return mesh
    return None
