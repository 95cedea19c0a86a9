"""Which files an object's meshes came from, kept in a sequence's file and found again."""

import os
from pathlib import Path

import numpy as np

from geneoh.errors import InputError
from geneoh.files.npz import Arrays
from geneoh.geometry.mesh import Mesh, load_mesh
from geneoh.readers.npz_layouts import MESH_FIELDS
from geneoh.readers.records import Record

FILES, HASHES = MESH_FIELDS


def mesh_arrays(meshes: tuple[Mesh, ...], folder: Path) -> Arrays:
    """Paths of the meshes' files as seen from a folder, and the SHA-256 of their contents.

    Nothing where a mesh did not come from a file.
    """
    sources = [mesh.source for mesh in meshes if mesh.source is not None]
    if not meshes or len(sources) < len(meshes):
        return {}
    return {
        FILES: np.array([seen_from(folder, source) for source in sources]),
        HASHES: np.array([mesh.sha256 for mesh in meshes]),
    }


def seen_from(folder: Path, file: Path) -> str:
    """The path from a folder to a file, so that both can be moved together."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # another drive of Windows
        return str(file.absolute())


def find_meshes(record: Record, folder: Path) -> tuple[tuple[Mesh, ...], tuple[str, ...]]:
    """The meshes that a file in a folder names, where all are there and as they were.

    Otherwise none, and in words what to know of them. `InputError` for names that are no texts.
    """
    if FILES not in record:
        return (), ()
    names = record.texts(FILES)
    hashes = record.texts(HASHES) if HASHES in record else []
    meshes: list[Mesh] = []
    for index, name in enumerate(names):
        path = folder / name
        if not path.is_file():
            return (), (f"the object's mesh {name} is not there any more",)
        try:
            whole = load_mesh(path)
        except InputError as error:
            return (), (f"the object's mesh cannot be used: {error}",)
        kept = hashes[index : index + 1]
        same = [mesh for mesh in (whole, *whole.parts) if not hashes or mesh.sha256 in kept]
        if not same:
            return (), (f"the object's mesh {name} is another one than it was",)
        meshes.append(same[0])
    return tuple(meshes), ()
