"""Surfaces as they are drawn: coarse enough, sharp where edges are sharp, with normals."""

from dataclasses import dataclass

import numpy as np
import torch
import trimesh
from jaxtyping import Float, Int

from geneoh.geometry.mesh import Mesh

CREASE_ANGLE = np.deg2rad(50.0)
"""Faces that meet at more than this are lit apart."""


@dataclass(frozen=True)
class Body:
    """One surface to draw."""

    verts: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    colours: Float[np.ndarray, "V 3"]
    telling: Float[np.ndarray, " V"]
    """Where each vertex stands on the ramp of what is shown, 0 to 1: no veil may hide it."""


def joined(bodies: list[Body]) -> Body | None:
    """One surface of many; None of none."""
    if not bodies:
        return None
    starts = np.cumsum([0] + [len(body.verts) for body in bodies[:-1]])
    return Body(
        np.concatenate([body.verts for body in bodies]),
        np.concatenate([body.faces + start for body, start in zip(bodies, starts, strict=True)]),
        np.concatenate([body.colours for body in bodies]),
        np.concatenate([body.telling for body in bodies]),
    )


def plain_body(
    verts: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    colour: tuple[float, float, float],
) -> Body:
    """A surface of one colour that tells nothing."""
    colours = np.broadcast_to(np.array(colour, dtype=np.float32), verts.shape)
    return Body(verts, faces, colours, np.zeros(len(verts), dtype=np.float32))


def vertex_normals(
    verts: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, "V 3"]:
    """Unit normals averaged over the faces around each vertex by area."""
    a, b, c = (verts[faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    normals = np.stack(
        [
            sum(np.bincount(faces[:, i], across[:, axis], len(verts)) for i in range(3))
            for axis in range(3)
        ],
        -1,
    )
    return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)


def creased(mesh: Mesh) -> Mesh:
    """The same surface with its vertices doubled along sharp edges, so that these look sharp."""
    whole = trimesh.Trimesh(mesh.verts.numpy(), mesh.faces.numpy(), process=False)
    parted = trimesh.graph.smooth_shade(whole, angle=CREASE_ANGLE)
    return Mesh(
        torch.from_numpy(np.asarray(parted.vertices, dtype=np.float32)),
        torch.from_numpy(np.asarray(parted.faces, dtype=np.int64)),
    )


def coarser(mesh: Mesh, most: int) -> Mesh:
    """A mesh of at most so many faces: vertices in one cell of a grid become their mean.

    For looking only. The mesh itself comes back when it has few enough.
    """
    cells = 256.0
    while len(mesh.faces) > most:
        key = (mesh.verts - mesh.verts.amin(0)) / float(mesh.extent().max()) * cells
        _, group = torch.unique(key.long(), dim=0, return_inverse=True)
        count = torch.bincount(group)
        verts = torch.zeros(len(count), 3).index_add_(0, group, mesh.verts) / count[:, None]
        a, b, c = group[mesh.faces].unbind(-1)
        faces = torch.stack([a, b, c], -1)[(a != b) & (b != c) & (c != a)]
        mesh, cells = Mesh(verts, faces), cells * 0.8
    return mesh
