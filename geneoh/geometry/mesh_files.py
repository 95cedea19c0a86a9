"""Read meshes from files of all supported formats, and from the arguments that callers pass."""

import io
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
import torch

from geneoh.arguments import checked_call
from geneoh.choices import Unit
from geneoh.errors import InputError, shortened
from geneoh.files.outputs import is_ours
from geneoh.files.reading import head_of, refuse_stand_in
from geneoh.geometry.mesh_formats import (
    binary_ply_as_text,
    refuse_cut_off,
    refuse_packed,
    rewritten,
)
from geneoh.geometry.polygons import cut_within, obj_polygons, ply_polygons
from geneoh.interrupts import interrupts_wait

if TYPE_CHECKING:
    import trimesh
from geneoh.geometry.mesh import METRES, Mesh, checked_mesh, has_surface, scaled, tidied

MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb")


@checked_call
def load_mesh(path: Path | str, unit: Unit = "m", *, tidy: bool = True) -> Mesh:
    """Read a triangle mesh without repair: vertex order, shells and holes are kept.

    The nodes of a scene (GLB) are transformed and joined to one mesh; where the scene holds several
    meshes, `parts` has each of them. Textured OBJ files have duplicated vertices along the seams of
    the texture, STL files three vertices per face.

    Args:
        path: an OBJ, PLY, STL, OFF or GLB file.
        unit: unit of the file; the mesh itself is in metres.
        tidy: leave out vertices without a face, and faces that repeat a vertex; pass False for
            data sets that refer to vertices by index.

    Raises:
        InputError: not a readable mesh, or one without a surface.
    """
    path = Path(path)
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise InputError(
            f"{path}: expected a mesh file ({', '.join(MESH_SUFFIXES)}), "
            f"got {path.suffix or 'no ending'!r}; convert it first"
        )
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
    """The mesh of an OBJ file with only comments, vertices and triangles, else None.

    Most files are of this kind, and importing trimesh takes longer than reading one of them. The
    mesh equals that of trimesh.
    """
    if path.suffix.lower() != ".obj":
        return None
    try:
        lines = path.read_bytes().replace(b"\t", b" ").split(b"\n")
        points, corners = (
            b"\n".join(ln[2:] for ln in lines if ln[:2] == kind) for kind in (b"v ", b"f ")
        )
        others = (line for line in lines if line[:2] not in (b"v ", b"f ") and line[:1] != b"#")
        not_whole = corners.translate(None, b"0123456789 \r\n")
        if not points or not corners or not_whole or any(map(bytes.strip, others)):
            return None
        # one stream, because numpy decodes the lines of a list one by one, which is slow
        verts = np.loadtxt(io.BytesIO(points), np.float64, None, ndmin=2).astype(np.float32)
        faces = np.loadtxt(io.BytesIO(corners), np.int64, None, ndmin=2) - 1
    except (OSError, ValueError, OverflowError):
        return None  # trimesh reports what is wrong
    # trimesh leaves out vertices without a face
    every = np.array_equal(np.unique(faces), np.arange(len(verts)))
    if not every or verts.shape[1:] != (3,) or faces.shape[1:] != (3,):
        return None
    return Mesh(torch.from_numpy(verts), torch.from_numpy(faces), source=path.absolute())


def by_trimesh(path: Path) -> Mesh:
    """The mesh of a file of any format; see `load_mesh`."""
    try:
        if path.suffix.lower() == ".glb":
            refuse_packed(path.read_bytes())
        data = rewritten(path)
        scene = loaded_scene(path, data)
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


def loaded_scene(path: Path, data: bytes | None) -> "trimesh.Scene":
    """The trimesh scene of a file, or of the bytes `data` that replace its content."""
    with interrupts_wait():
        import trimesh

    given, kind = (path, None) if data is None else (io.BytesIO(data), path.suffix[1:].lower())
    try:
        return trimesh.load_scene(given, file_type=kind, process=False)
    except ValueError:
        text = binary_ply_as_text(path.read_bytes()) if kind is None else None
        if text is None:
            raise
        return trimesh.load_scene(io.BytesIO(text), file_type="ply", process=False)


def without_lids(path: Path, data: bytes | None, scene: "trimesh.Scene") -> Mesh | None:
    """The mesh of an OBJ or ASCII PLY file with a concave face that trimesh would cut wrongly.

    None for all other files. `data` are the bytes that trimesh read instead of the file, if any.
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
"""The meshes of an object as an argument: a mesh, its file, or one of these per rigid part."""


def meshes_of(given: MeshInput, unit: Unit = "m") -> tuple[Mesh, ...]:
    """The meshes of an argument; none for None. `unit` is the unit of files."""
    if given is None:
        return ()
    if isinstance(given, Mesh | ForeignMesh | Path | str) or not isinstance(given, Iterable):
        given = [given]
    return tuple(mesh_from(each, unit) for each in given)


def mesh_from(given: Any, unit: Unit) -> Mesh:
    """A mesh, checked, or read from a file; `InputError` for anything else."""
    if isinstance(given, Mesh):
        return checked_mesh(given, str(given.source or "the mesh"))
    if isinstance(given, Path | str):
        return load_mesh(given, unit)
    if isinstance(given, ForeignMesh):
        return tidied(checked_mesh(Mesh(given.vertices, given.faces), "the mesh"))
    raise InputError(
        f"a mesh must be a geneoh.Mesh or the path of its file, got {type(given).__name__}; "
        "geneoh.Mesh(vertices, faces) makes one of arrays"
    )


def from_trimesh(shape: "trimesh.Trimesh") -> Mesh:
    """Vertices and faces of a mesh of trimesh."""
    verts = torch.from_numpy(np.array(shape.vertices, dtype=np.float32).reshape(-1, 3))
    return Mesh(verts, torch.from_numpy(np.array(shape.faces, dtype=np.int64).reshape(-1, 3)))


def scene_parts(scene: "trimesh.Scene", path: Path) -> tuple[Mesh, ...]:
    """The transformed meshes of a GLB file with several, in the file's order; else none.

    Meshes without a surface are left out. The materials of one mesh are joined. A mesh that
    several nodes use counts once for each node.
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
        # trimesh makes a child node for each material of a node, called NODE_ and six letters
        material = above != scene.graph.base_frame and name[:-6] == f"{above}_"
        nodes.setdefault(str(above) if material else name, []).append(shape)
    joined = [from_trimesh(trimesh.Scene(shapes).to_mesh()) for shapes in nodes.values()]
    parts = [replace(part, source=path.absolute()) for part in joined if has_surface(part)]
    return tuple(parts) if len(parts) > 1 else ()
