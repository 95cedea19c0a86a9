"""Triangle meshes in metres: reading, checking, and closing the openings of their surface."""

import hashlib
import io
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from torch import Tensor

from geneoh.bundle import Bundle, conform, equal_values, repr_by_shapes
from geneoh.choices import Unit
from geneoh.config import checked_call
from geneoh.errors import InputError, shortened
from geneoh.files.outputs import is_ours
from geneoh.files.reading import head_of, refuse_stand_in
from geneoh.geometry.mesh_formats import refuse_cut_off, refuse_packed, rewritten
from geneoh.geometry.mirror import mirror_faces, mirror_points
from geneoh.geometry.polygons import cut_within, obj_polygons, ply_polygons
from geneoh.interrupts import interrupts_wait
from geneoh.modes import undisturbed

if TYPE_CHECKING:
    import trimesh

MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb")

WELD_TOLERANCE = 1e-6
"""Side in metres of the cells within which vertices are one point of the surface. It does not grow
with the mesh, because a single far vertex would then merge the whole object."""

SHEET_THICKNESS = 0.002  # metres of a sheet's wall: about the thinnest bowl a hand holds

LARGEST_OBJECT, SMALLEST_OBJECT = 2.0, 0.005
"""Range of the longest side of an object that a hand holds, metres; outside of it the unit is
probably wrong."""

METRES: dict[Unit, float] = {"mm": 0.001, "cm": 0.01, "m": 1.0}  # length of each unit in metres

INCH = 0.0254  # metres; no option names it

USUAL_OBJECT = 0.1  # longest side in metres of most held objects, to tell a likely unit

TINY = 1e-30
"""Length in float64 below which a vector has no direction; torch's own 1e-12 is a possible area."""


@dataclass(frozen=True, eq=False)
class Mesh(Bundle):
    """A triangle mesh in metres; faces are counter-clockwise seen from outside, if they agree."""

    verts: Float[Tensor, "V 3"]
    faces: Int[Tensor, "F 3"]
    source: Path | None = None
    """File that it was read from, absolute; None for a mesh that was made or changed."""
    parts: tuple["Mesh", ...] = ()
    """The separate meshes of a file that holds several, which `verts` and `faces` have joined."""

    __eq__ = equal_values
    __repr__ = repr_by_shapes

    def __hash__(self) -> int:
        """What equal meshes have in common."""
        return hash((len(self.verts), len(self.faces), self.source))

    def __post_init__(self) -> None:
        """Take arrays and lists."""
        conform(self, "the mesh")

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the vertices as float32 and the faces as int64, by which a mesh is known again
        whatever its file is called; of what `tidied` keeps."""
        kept = tidied(self)
        digest = hashlib.sha256(kept.verts.detach().cpu().numpy().astype("<f4").tobytes())
        digest.update(kept.faces.cpu().numpy().astype("<i8").tobytes())
        return digest.hexdigest()

    def mirrored(self) -> "Mesh":
        """The reflection x -> -x, with the faces reversed so that they still point outward."""
        return Mesh(mirror_points(self.verts), mirror_faces(self.faces))

    def extent(self) -> Float[Tensor, " 3"]:
        """Sides of the axis-aligned bounding box."""
        return self.verts.amax(0) - self.verts.amin(0)

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


@checked_call
@undisturbed()
def load_mesh(path: Path | str, unit: Unit = "m", *, tidy: bool = True) -> Mesh:
    """Read a triangle mesh without repair: vertex order, shells and holes are kept.

    The nodes of a scene (GLB) are placed and joined to one mesh; where the scene holds several
    meshes, `parts` has each of them. Textured OBJ files come with doubled vertices along the seams
    of the texture, STL files with three vertices per face.

    Args:
        path: an OBJ, PLY, STL, OFF or GLB file.
        unit: of its vertices; the mesh itself is in metres.
        tidy: leave out vertices without a face, and faces that repeat a vertex; False for data
            sets that refer to vertices by their number.

    Raises:
        InputError: not a readable mesh, or one without a surface.
    """
    path = Path(path)
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise InputError(
            f"{path}: expected a mesh file ({', '.join(MESH_SUFFIXES)}), "
            f"got {path.suffix or 'no ending'!r}; convert it first"
        )
    if not path.is_file():
        raise InputError(f"{path}: no such mesh file; check the path")
    refuse_stand_in(path, head_of(path))
    if is_ours(path):
        raise InputError(
            f"{path}: expected the mesh of an object, got a scene with hands that geneoh wrote; "
            "give the object's own file"
        )
    mesh = plain_obj(path) or by_trimesh(path)
    mesh = checked_mesh(mesh if unit == "m" else scaled(mesh, METRES[unit]), str(path))
    return tidied(mesh) if tidy else mesh


def plain_obj(path: Path) -> Mesh | None:
    """What trimesh makes of an OBJ file of comments, points and triangles; None for other files.

    To import trimesh takes more time than to read the file, which is most often such a one.
    """
    if path.suffix.lower() != ".obj":
        return None
    try:
        lines = path.read_bytes().replace(b"\t", b" ").split(b"\n")
        lines = [line for line in lines if line.strip() and not line.startswith(b"#")]
        points, corners = (
            [ln.split() for ln in lines if ln[:2] == kind] for kind in (b"v ", b"f ")
        )
        if len(points) + len(corners) < len(lines):
            return None
        verts = np.array(points)[:, 1:].astype(np.float64).astype(np.float32)
        faces = np.array(corners)[:, 1:].astype(np.int64) - 1
    except (OSError, ValueError, IndexError, OverflowError):
        return None  # trimesh says what is wrong
    # trimesh leaves out vertices without a face
    every = np.array_equal(np.unique(faces), np.arange(len(verts)))
    if not every or verts.shape[1:] != (3,) or faces.shape[1:] != (3,):
        return None
    return Mesh(torch.from_numpy(verts), torch.from_numpy(faces), source=path.absolute())


def by_trimesh(path: Path) -> Mesh:
    """The mesh of a file of any format; see `load_mesh`."""
    with interrupts_wait():
        import trimesh

    try:
        if path.suffix.lower() == ".glb":
            refuse_packed(path.read_bytes())
        data = rewritten(path)
        given, kind = (path, None) if data is None else (io.BytesIO(data), path.suffix[1:].lower())
        scene = trimesh.load_scene(given, file_type=kind, process=False)
        refuse_cut_off(path, scene)
        mesh = without_lids(path, data, scene) or from_trimesh(scene.to_mesh())
        mesh = replace(mesh, source=path.absolute(), parts=scene_parts(scene, path))
    except InputError:
        raise
    except Exception as error:  # trimesh's readers raise whatever a broken file makes them raise
        reason = shortened(" ".join(str(error).split()), 200)
        raise InputError(
            f"{path}: cannot be read as {path.suffix[1:].upper()} "
            f"({type(error).__name__}: {reason}); open it in a mesh editor and save it again, "
            "with triangles"
        ) from error
    points = sum(len(cloud.vertices) for cloud in scene.geometry.values())
    if points and not len(mesh.faces):
        raise InputError(
            f"{path}: expected a mesh with triangles, got {points} points and no face; "
            "export it with its faces, or make a surface of a point cloud in a mesh editor"
        )
    return mesh


def without_lids(path: Path, data: bytes | None, scene: "trimesh.Scene") -> Mesh | None:
    """The mesh of an OBJ or ASCII PLY file of which trimesh cuts a face outside of its outline.

    None for all other files. `data` is what trimesh read instead of the file.
    """
    is_obj = path.suffix.lower() == ".obj"
    outlines = obj_polygons(data or path.read_bytes()) if is_obj else ply_polygons(scene)
    triangles = None if outlines is None else cut_within(*outlines)
    if outlines is None or triangles is None:
        return None
    return Mesh(torch.from_numpy(outlines[0].astype(np.float32)), torch.from_numpy(triangles))


@runtime_checkable
class ForeignMesh(Protocol):
    """A mesh of another package, such as trimesh.Trimesh, in metres."""

    @property
    def vertices(self) -> Any:
        """(V, 3)"""
        ...

    @property
    def faces(self) -> Any:
        """(F, 3) indices of the corners."""
        ...


OneMesh = Mesh | ForeignMesh | Path | str
MeshInput = OneMesh | Iterable[OneMesh] | None
"""What callers give for an object: a mesh, its file, or one of these for each rigid part."""


def meshes_of(given: MeshInput, unit: Unit = "m") -> tuple[Mesh, ...]:
    """Meshes of a mesh, a file, or a list of both; None is no mesh, `unit` is that of the files."""
    if given is None:
        return ()
    if isinstance(given, Mesh | ForeignMesh | Path | str) or not isinstance(given, Iterable):
        given = [given]
    return tuple(mesh_from(each, unit) for each in given)


def mesh_from(given: Any, unit: Unit) -> Mesh:
    """One mesh, or that of a file; `InputError` for anything else."""
    if isinstance(given, Mesh):
        return given
    if isinstance(given, Path | str):
        return load_mesh(given, unit)
    if isinstance(given, ForeignMesh):
        verts, faces = (torch.as_tensor(np.array(part)) for part in (given.vertices, given.faces))
        return tidied(checked_mesh(Mesh(verts, faces), "the mesh"))
    raise InputError(
        f"a mesh must be a geneoh.Mesh or the path of its file, got {type(given).__name__}; "
        "geneoh.Mesh(vertices, faces) makes one of arrays"
    )


def scaled(mesh: Mesh, factor: float) -> Mesh:
    """The mesh and its parts with every length times a factor."""
    parts = tuple(scaled(part, factor) for part in mesh.parts)
    return replace(mesh, verts=factor * mesh.verts, parts=parts)


def from_trimesh(shape: "trimesh.Trimesh") -> Mesh:
    """Vertices and faces of a mesh of trimesh."""
    verts = torch.from_numpy(np.array(shape.vertices, dtype=np.float32).reshape(-1, 3))
    return Mesh(verts, torch.from_numpy(np.array(shape.faces, dtype=np.int64).reshape(-1, 3)))


def scene_parts(scene: "trimesh.Scene", path: Path) -> tuple[Mesh, ...]:
    """The placed meshes of a GLB file that have a surface, in the file's order; none if it is one.

    A mesh of several materials is one. Meshes that stand in several places count each time.
    """
    import trimesh

    if path.suffix.lower() != ".glb":
        return ()
    order = {name: index for index, name in enumerate(scene.geometry)}
    placed = [shape for shape in scene.dump() if isinstance(shape, trimesh.Trimesh)]
    placed = sorted(reversed(placed), key=lambda shape: order[shape.metadata["name"]])
    nodes: dict[str, list[trimesh.Trimesh]] = {}
    for shape in placed:
        name = shape.metadata["node"]
        above = scene.graph.transforms.parents.get(name)
        # trimesh gives each material of a node a node of its own below it, NODE_ with six letters
        material = above != scene.graph.base_frame and name[:-6] == f"{above}_"
        nodes.setdefault(str(above) if material else name, []).append(shape)
    joined = [from_trimesh(trimesh.Scene(shapes).to_mesh()) for shapes in nodes.values()]
    parts = [replace(part, source=path.absolute()) for part in joined if has_surface(part)]
    return tuple(parts) if len(parts) > 1 else ()


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
        inches = f"; if it is in inches, scale it to metres first, by {INCH:g}"
        return (
            f"the mesh is {size:.3g} m long, too large for a hand: its unit is probably {unit}, "
            f"pass --unit {unit} or scale its vertices by {METRES[unit]:g}"
            + (inches if unit == "cm" else "")
        )
    if size < SMALLEST_OBJECT:
        return (
            f"the mesh is {size:.3g} m long, too small for a hand: it looks scaled twice, "
            "drop --unit where it was passed, or scale its vertices by 1000"
        )
    return None


def welded(mesh: Mesh) -> Mesh:
    """The same surface with coincident vertices merged and the faces that this collapses removed.

    The vertex array stays as it is; faces index the first of the merged vertices.
    """
    cells = np.rint(mesh.verts.detach().cpu().numpy().astype(np.float64) / WELD_TOLERANCE)
    order = np.lexsort(cells.T)  # stable: within a place, the first vertex comes first
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
    """The same surface, in order, without faces that repeat a vertex and vertices of no face."""
    kept = mesh.faces[~repeats_a_vertex(mesh.faces)]
    used, faces = torch.unique(kept, return_inverse=True)
    parts = tuple(tidied(part) for part in mesh.parts)
    return replace(mesh, verts=mesh.verts[used], faces=faces, parts=parts)


def open_edges(faces: Int[Tensor, "F 3"]) -> Bool[Tensor, "F 3"]:
    """Whether edge i of each face, from its corner i to the next, belongs to no other face."""
    _, index, count = torch.unique(edge_keys(faces), return_inverse=True, return_counts=True)
    return count[index] == 1


def edges_of(faces: Int[Tensor, "F 3"]) -> Int[Tensor, "E 2"]:
    """The edges of a mesh, each once, from its lower vertex to its higher one."""
    keys, size = torch.unique(edge_keys(faces)), int(faces.max()) + 1
    return torch.stack([keys // size, keys % size], dim=-1)


def edge_keys(faces: Int[Tensor, "F 3"]) -> Int[Tensor, "F 3"]:
    """A number for the edge from corner i of each face to the next, alike in both directions.

    One integer for each edge: sorting pairs is fifty times slower.
    """
    start, end = faces, faces.roll(-1, dims=-1)
    return torch.minimum(start, end) * (int(faces.max()) + 1) + torch.maximum(start, end)


def rims(faces: Int[Tensor, "F 3"]) -> tuple[Int[Tensor, "E 2"], Int[Tensor, " E"]]:
    """The open edges, each from its start to its end, and the number of the opening each bounds."""
    rim = open_edges(faces)
    edges = torch.stack([faces[rim], faces.roll(-1, dims=-1)[rim]], dim=-1)
    if not len(edges):
        return edges, edges[:, 0]
    piece = connected(edges)[edges[:, 0]]
    return edges, torch.unique(piece, return_inverse=True)[1]


def connected(edges: Int[Tensor, "E 2"]) -> Int[Tensor, " V"]:
    """The number of the connected piece that each vertex belongs to, up to the last in an edge."""
    start, end = edges.cpu().int().numpy().T  # scipy before 1.12 takes 32 bits only
    size = int(edges.max()) + 1
    links = coo_array((np.ones(len(start)), (start, end)), (size, size))
    label = connected_components(links, directed=False)[1]
    return torch.from_numpy(label).to(edges)


def capped(
    verts: Float[Tensor, "*B V 3"], faces: Int[Tensor, "F 3"]
) -> tuple[Float[Tensor, "*B W 3"], Int[Tensor, "G 3"]]:
    """The mesh with each opening closed by a fan around the middle of its rim, an added vertex.

    It closes the wrist of a MANO hand in the same way as TOCH. Every opening is closed, so it suits
    solids with holes, not sheets.
    """
    edges, opening = rims(faces)
    if not len(edges):
        return verts, faces
    middles = [
        verts[..., torch.unique(edges[opening == hole]), :].mean(-2)
        for hole in range(int(opening.max()) + 1)
    ]
    fan = torch.stack([edges[:, 1], edges[:, 0], verts.shape[-2] + opening], dim=-1)
    closed = torch.cat([verts, torch.stack(middles, dim=-2)], dim=-2)
    return closed, torch.cat([faces, fan])


def thickened(mesh: Mesh, thickness: float = SHEET_THICKNESS) -> Mesh:
    """A closed wall around an open sheet: half the thickness to either side, joined at the rims.

    The sheet's faces must share vertices and agree on a side. The wall is centred because the outer
    side is unknown, and so that mirroring changes nothing. Unused vertices are dropped.
    """
    sheet = tidied(mesh)
    faces = sheet.faces
    across = sheet.face_vectors().double()
    normals = torch.zeros_like(sheet.verts, dtype=torch.float64)
    for corner in range(3):
        normals.index_add_(0, faces[:, corner], across)
    shift = torch.nn.functional.normalize(normals, dim=-1, eps=TINY).to(sheet.verts) * thickness / 2
    rim = open_edges(faces)
    start, end, count = faces[rim], faces.roll(-1, dims=-1)[rim], len(sheet.verts)
    corners = (end, start, start + count), (end, start + count, end + count)
    stitches = [torch.stack(each, -1) for each in corners]
    verts = torch.cat([sheet.verts + shift, sheet.verts - shift])
    return Mesh(verts, torch.cat([faces, faces.flip(-1) + count, *stitches]))
