"""Triangle meshes in metres: checks, removal of unused vertices, welding of equal vertices."""

import hashlib
import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int
from torch import Tensor

from geneoh.bundle import Bundle, ByValue, conform
from geneoh.choices import Unit
from geneoh.errors import InputError
from geneoh.geometry.mirror import mirror_faces, mirror_points

WELD_TOLERANCE = 1e-6
"""Side in metres of the grid cells whose vertices are merged. It does not grow with the mesh:
otherwise one far vertex would merge the whole object."""

LARGEST_OBJECT, SMALLEST_OBJECT = 2.2, 0.005
"""Range of the longest side of an object that a hand holds or opens, as a door, metres; beyond it
the unit is probably wrong."""

LARGEST_ROOM = 20.0  # longest side of a scan of surroundings, metres

METRES: dict[Unit, float] = {"mm": 0.001, "cm": 0.01, "m": 1.0}  # length of each unit in metres

INCH = 0.0254  # metres; no option names it

USUAL_OBJECT = 0.1  # typical longest side in metres of a held object, to guess the unit

TINY = 1e-30
"""Length in float64 below which a vector has no direction; torch's 1e-12 is a possible area."""


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(ByValue, Bundle):
    """A triangle mesh in metres; faces are counter-clockwise seen from outside, if they agree."""

    verts: Float[Tensor, "V 3"]
    faces: Int[Tensor, "F 3"]
    source: Path | None = None
    """Absolute path of the file it was read from; None for a mesh that was made or changed."""
    parts: tuple["Mesh", ...] = ()
    """The separate meshes of a file that holds several; `verts` and `faces` join them."""

    def __hash__(self) -> int:
        """A hash of sizes and file, which equal meshes share."""
        return hash((len(self.verts), len(self.faces), self.source))

    def __post_init__(self) -> None:
        """Convert arrays and lists to tensors."""
        conform(self, "the mesh")

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the `tidied` vertices as float32 and faces as int64, which identifies a mesh
        whatever its file is called."""
        kept = tidied(self)
        digest = hashlib.sha256(kept.verts.detach().cpu().numpy().astype("<f4").tobytes())
        digest.update(kept.faces.cpu().numpy().astype("<i8").tobytes())
        return digest.hexdigest()

    def mirrored(self) -> "Mesh":
        """The reflection x -> -x, with the faces reversed so that they still point outward."""
        return Mesh(mirror_points(self.verts), mirror_faces(self.faces))

    def copied(self) -> "Mesh":
        """The mesh in tensors of its own, on the CPU: a caller may change this one in place."""
        return Mesh(self.verts.detach().cpu().clone(), self.faces.cpu().clone(), self.source)

    def extent(self) -> Float[Tensor, " 3"]:
        """Sides of the axis-aligned bounding box."""
        return self.verts.amax(0) - self.verts.amin(0)

    def center(self) -> Float[Tensor, " 3"]:
        """The centre of the axis-aligned bounding box."""
        return (self.verts.amax(0) + self.verts.amin(0)) / 2

    def some_verts(self, count: int) -> Float[Tensor, "N 3"]:
        """Vertices in even steps, `count` or more of them; all of a mesh that has fewer."""
        return self.verts[:: max(1, len(self.verts) // count)]

    def corners(self) -> Float[Tensor, "F 3 3"]:
        """The three corners of each face."""
        return self.verts[self.faces]

    def face_vectors(self) -> Float[Tensor, "F 3"]:
        """Normal of each face, with twice the face's area as length."""
        a, b, c = self.corners().unbind(-2)
        return torch.linalg.cross(b - a, c - a)

    def face_normals(self) -> Float64[Tensor, "F 3"]:
        """Unit normal of each face; zero for a face without area."""
        return torch.nn.functional.normalize(self.face_vectors().double(), dim=-1, eps=TINY)


def scaled(mesh: Mesh, factor: float) -> Mesh:
    """The mesh and its parts with every length times a factor."""
    parts = tuple(scaled(part, factor) for part in mesh.parts)
    return replace(mesh, verts=factor * mesh.verts, parts=parts)


def checked_mesh(mesh: Mesh, source: str) -> Mesh:
    """The same mesh if it has a surface that can be measured, else `InputError` about `source`."""
    verts, faces = mesh.verts, mesh.faces
    if len(faces) == 0:
        raise InputError(
            f"{source}: expected a mesh with triangles, got {len(verts)} vertices and no face; "
            "export it with its faces"
        )
    if int(faces.min()) < 0 or int(faces.max()) >= len(verts):
        raise InputError(
            f"{source}: faces must index the {len(verts)} vertices, got indices from "
            f"{int(faces.min())} to {int(faces.max())}; export the mesh again"
        )
    if not bool(verts.isfinite().all()):
        bad = int((~verts.isfinite()).any(-1).sum())
        raise InputError(
            f"{source}: vertices must be finite numbers, got NaN or infinity in {bad} of "
            f"{len(verts)}; remove them in a mesh editor"
        )
    area = mesh.face_vectors().norm(dim=-1)
    if not bool(area.isfinite().all()):
        raise InputError(
            f"{source}: vertices must be in metres, got {float(verts.abs().max()):.3g}; "
            "scale the mesh or remove the far vertices in a mesh editor"
        )
    if not has_surface(mesh):
        raise InputError(
            f"{source}: expected a surface, got no area in all of its faces, {len(faces)}; "
            "check the mesh and its scale"
        )
    return mesh


def size_warning(mesh: Mesh) -> str | None:
    """A warning for the user when the mesh is far too large or small for a hand, else None."""
    size = float(mesh.extent().max())
    if size > LARGEST_OBJECT:
        units: tuple[Unit, ...] = ("mm", "cm")
        unit = min(units, key=lambda unit: abs(math.log(size * METRES[unit] / USUAL_OBJECT)))
        room = "; if it is a room or a large thing, give the part that hands touch, at most "
        room += f"{LARGEST_OBJECT:g} m long"
        inches = f"; if it is in inches, scale it to metres first, by {INCH:g}"
        return (
            f"the mesh is {size:.3g} m long, too large for a hand: its unit is probably {unit}, "
            f"pass --unit {unit} or scale its vertices by {METRES[unit]:g}"
            + (inches if unit == "cm" else "")
            + (room if size < LARGEST_ROOM else "")
        )
    if size < SMALLEST_OBJECT:
        return (
            f"the mesh is {size:.3g} m long, too small for a hand: it looks scaled twice, "
            "drop --unit where it was passed, or scale its vertices by 1000"
        )
    return None


def welded(mesh: Mesh) -> Mesh:
    """The same surface with coincident vertices merged and collapsed faces removed.

    The vertex array stays as it is; faces index the first of the merged vertices.
    """
    cells = np.rint(mesh.verts.detach().cpu().numpy().astype(np.float64) / WELD_TOLERANCE)
    order = np.lexsort(cells.T)  # stable: within a cell, the first vertex comes first
    starts = np.ones(len(order), dtype=bool)
    starts[1:] = (np.diff(cells[order], axis=0) != 0).any(-1)
    first = np.empty_like(order)
    first[order] = order[starts][np.cumsum(starts) - 1]
    faces = torch.from_numpy(first).to(mesh.faces)[mesh.faces]
    return Mesh(mesh.verts, faces[~repeats_a_vertex(faces)])


def repeats_a_vertex(faces: Int[Tensor, "F 3"]) -> Bool[Tensor, " F"]:
    """Whether a face has the same vertex at two of its corners."""
    return (faces == faces.roll(-1, dims=-1)).any(-1)


def has_surface(mesh: Mesh) -> bool:
    """Whether some face has an area; a face that repeats a vertex has at most a rounding error."""
    return bool(mesh.face_vectors()[~repeats_a_vertex(mesh.faces)].any())


def tidied(mesh: Mesh) -> Mesh:
    """The same mesh in the same order, without unused vertices and faces that repeat a vertex; the
    mesh itself where it has none of these."""
    kept = mesh.faces[~repeats_a_vertex(mesh.faces)]
    used, faces = torch.unique(kept, return_inverse=True)
    parts = tuple(tidied(part) for part in mesh.parts)
    if not parts and len(used) == len(mesh.verts) and len(kept) == len(mesh.faces):
        return mesh
    return replace(mesh, verts=mesh.verts[used], faces=faces, parts=parts)
