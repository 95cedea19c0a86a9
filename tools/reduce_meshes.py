"""Reduce scanned meshes for `examples/objects`: `python -m tools.reduce_meshes FROM TO`.

Each mesh is decimated to `FACES` triangles by quadric error, where libigl can (it wants surfaces
that are manifold), and written as a binary PLY with short face indices, a third of an OBJ's size.
"""

import sys
from pathlib import Path

import igl
import numpy as np
import torch

from geneoh.geometry.mesh import Mesh, tidied, welded
from geneoh.geometry.mesh_files import load_mesh
from geneoh.geometry.solid import as_arrays

FACES = 1500
"""Most triangles of a mesh that can be decimated."""
HEADER = """ply
format binary_little_endian 1.0
element vertex {verts}
property float x
property float y
property float z
element face {faces}
property list uchar ushort vertex_indices
end_header
"""


def reduced(mesh: Mesh) -> Mesh:
    """The mesh without doubled vertices and with at most `FACES` triangles, if that can be done."""
    whole = tidied(welded(mesh))
    if len(whole.faces) <= FACES:
        return whole
    verts, faces = map(np.asarray, igl.qslim(*as_arrays(whole), FACES)[:2])
    if not len(faces):
        return whole
    return Mesh(torch.from_numpy(verts).float(), torch.from_numpy(faces.astype(np.int64)))


def write_ply(path: Path, mesh: Mesh) -> None:
    """Write a mesh of fewer than 65,536 vertices."""
    faces = np.zeros(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<u2", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces.numpy()
    header = HEADER.format(verts=len(mesh.verts), faces=len(faces)).encode()
    path.write_bytes(header + mesh.verts.numpy().astype("<f4").tobytes() + faces.tobytes())


if __name__ == "__main__":
    source, target = map(Path, sys.argv[1:])
    target.mkdir(parents=True, exist_ok=True)
    for found in sorted(source.glob("*.obj")):
        write_ply(target / f"{found.stem}.ply", reduced(load_mesh(found)))
