"""Scanned objects: meshes as grids of signed distance, for batches that mix them with solids.

A grid covers the mesh's bounding box and a margin. Nodes near the surface hold the exact signed
distance (sign by winding number), the others are interpolated from every fourth node. All grids are
concatenated in one float16 tensor, so that a batch may mix any of them.
"""

import hashlib
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import torch
from jaxtyping import Float, Float16, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import Unit
from geneoh.errors import InputError
from geneoh.files.atomic import make_folder
from geneoh.files.reading import SIZE_LIMIT, open_text
from geneoh.files.tensors import DamagedTensorsError, opened_tensors, write_tensors
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh, size_warning
from geneoh.geometry.mesh_files import MESH_SUFFIXES, load_mesh
from geneoh.geometry.sampling import sample_surface
from geneoh.progress import OnStep, steps

FILE = "scans.safetensors"  # the scanned objects of the shards in the same folder
HELD_OUT_FILE = "held_out.txt"
"""File beside the meshes that lists those for validation, one per line, with or without ending."""
NOTICES = ("ATTRIBUTION*", "LICENSE*", "README*")
"""Files beside the meshes whose text is stored with every copy of the meshes."""
MARGIN = 0.008  # margin of a grid around the bounding box, metres
NODES, FINEST = 250_000, 0.0012  # approximate limit of nodes per grid; smallest spacing, metres
EXACT = 0.006  # nodes nearer to the surface than this plus two coarse cells are exact, metres
SKIP = 4  # every fourth node of a grid along each axis belongs to the coarse grid
POINTS_STORED = 4096  # surface points stored per object
HAND_SPAN = 0.09  # grasps prefer places where the object is thinner than this, metres
WIDE_SHARE = 0.15
"""Probability of a grasp at a wider place relative to a thin one: at an edge, or by a flat hand."""
ARRAYS = ("half", "points", "normals", "grasped", "spacing", "shape", "start", "values")
WORDS = ("names", "held_out", "notice")  # `ARRAYS` are stored as tensors, `WORDS` in the record
TINY = 1e-9  # length in metres below which a vector has no direction
CORNERS = torch.tensor(list(product((0, 1), repeat=3)))  # corners of a cell, last axis fastest


@dataclass(frozen=True, eq=False)
class MeshFolder(Bundle):
    """N meshes in metres, each in a frame with its origin at the centre of the bounding box."""

    names: tuple[str, ...]  # file names of the meshes, which no family of analytic objects can have
    held_out: tuple[str, ...]  # those that are for validation alone
    notice: str  # attribution and licences of the meshes
    meshes: tuple[Mesh, ...]

    @property
    def fingerprint(self) -> str:
        """Hash of the meshes, their names and the held-out list, which identifies the folder."""
        words = [f"{name} {m.sha256}" for name, m in zip(self.names, self.meshes, strict=True)]
        return hashlib.sha256("\n".join([*words, *self.held_out]).encode()).hexdigest()[:16]


@dataclass(frozen=True, eq=False)
class Scans(MeshFolder):
    """Scanned objects with their distance grids and surface points."""

    half: Float[Tensor, "N 3"]  # half sides of the bounding boxes
    points: Float[Tensor, "N M 3"]  # spread evenly over the surfaces; `normals` are outward
    normals: Float[Tensor, "N M 3"]
    grasped: Float[Tensor, "N M"]  # relative probability that a hand grasps at each point
    spacing: Float[Tensor, " N"]  # between nodes, metres; grids are centred at the origin
    shape: Int[Tensor, "N 3"]
    start: Int[Tensor, " N"]  # where each grid begins in `values`
    values: Float16[Tensor, " C"]  # signed distance at the nodes of all grids

    def distance(
        self, which: Int[Tensor, " B"], points: Float[Tensor, "B P 3"]
    ) -> Float[Tensor, "B P"]:
        """Signed distance of points to one object each; differentiable once in the points."""
        distance, normal = self.lookup(which, points.detach())
        return distance + ((points - points.detach()) * normal).sum(-1)

    def lookup(
        self, which: Int[Tensor, " B"], points: Float[Tensor, "B P 3"]
    ) -> tuple[Float[Tensor, "B P"], Float[Tensor, "B P 3"]]:
        """Signed distance and its unit gradient, by trilinear interpolation; outside the grid,
        extrapolated from the nearest point of the grid."""
        spacing, shape = self.spacing[which, None, None], self.shape[which, None]
        low = spacing * (1 - shape) / 2
        last = shape - 1
        cells = (points - low) / spacing
        at = cells.clamp(min=0).minimum(last)
        cell = at.long().minimum(last - 1)
        stride = torch.stack([shape[..., 1] * shape[..., 2], shape[..., 2], shape[..., 2] ** 0], -1)
        first = self.start[which, None] + (cell * stride).sum(-1)
        corners = first[..., None] + (CORNERS * stride[:, :, None]).sum(-1)
        values = self.values[corners].float().unflatten(-1, (2, 2, 2))
        x, y, z = (at - cell).unbind(-1)
        along_z = torch.lerp(values[..., 0], values[..., 1], z[..., None, None])
        along_y = torch.lerp(along_z[..., 0], along_z[..., 1], y[..., None])
        across_y = torch.lerp(values[..., 0, :], values[..., 1, :], y[..., None, None])
        distance = torch.lerp(along_y[..., 0], along_y[..., 1], x)
        rise_z = torch.lerp(across_y[..., 0, :], across_y[..., 1, :], x[..., None])
        rise_y = torch.lerp(along_z[..., 0, :], along_z[..., 1, :], x[..., None])
        rises = [along_y, rise_y, rise_z]
        normal = torch.stack([rise[..., 1] - rise[..., 0] for rise in rises], -1)
        normal = torch.nn.functional.normalize(normal, dim=-1)
        outside = (cells != at).any(-1)
        away = (cells - at) * spacing + distance[..., None] * normal
        length = away.norm(dim=-1).clamp(min=TINY)
        normal = torch.where(outside[..., None], away / length[..., None], normal)
        return torch.where(outside, length, distance), normal

    def draw_points(
        self, which: Int[Tensor, " B"], count: int, *, generator: torch.Generator, to_grasp: bool
    ) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B P 3"]]:
        """Surface points of one object each, spread evenly, with their outward normals.

        With `to_grasp` they are drawn by the weights `grasped`: mostly where the object is thin.
        """
        order = torch.rand(len(which), POINTS_STORED, generator=generator)
        if to_grasp:  # sorted exponential times of these rates sample without replacement
            order = order.log().neg() / self.grasped[which]
        # repeated from the first if more than all are requested
        chosen = order.argsort(1)[:, torch.arange(count) % POINTS_STORED]
        return self.points[which[:, None], chosen], self.normals[which[:, None], chosen]


def read_folder(folder: Path, unit: Unit = "m") -> MeshFolder:
    """The meshes of a folder, in the order of their names.

    Raises:
        InputError: there is no mesh, one is broken or of the wrong size for a hand, or a held-out
            name is not that of a mesh.
    """
    paths = sorted(p for p in folder.glob("*") if p.suffix.lower() in MESH_SUFFIXES)
    if not paths:
        raise InputError(
            f"{folder}: expected mesh files ({', '.join(MESH_SUFFIXES)}), found none; "
            "name the folder that holds them"
        )
    meshes = []
    for path in paths:
        mesh = load_mesh(path, unit)
        if warning := size_warning(mesh):
            raise InputError(f"{path}: {warning}")
        meshes.append(Mesh(mesh.verts - mesh.center(), mesh.faces))
    listed, held_out = folder / HELD_OUT_FILE, list[str]()
    lines = _text_of(listed).splitlines() if listed.exists() else []
    for name in filter(None, map(str.strip, lines)):
        found = [path.name for path in paths if name in (path.name, path.stem)]
        if not found:
            raise InputError(
                f"{listed}: '{name}' is no mesh of this folder; correct the name or remove it"
            )
        held_out += found
    notices = {path for pattern in NOTICES for path in folder.glob(pattern) if path.is_file()}
    return MeshFolder(
        tuple(path.name for path in paths),
        tuple(held_out),
        "\n".join(map(_text_of, sorted(notices))),
        tuple(meshes),
    )


def _text_of(path: Path) -> str:
    """The text of a file; letters that are not UTF-8 are replaced."""
    with open_text(path, SIZE_LIMIT) as file:
        return file.read()


def build_scans(found: MeshFolder, *, on_mesh: OnStep | None = None) -> Scans:
    """Grids, surface points and places to grasp; `InputError` if a mesh encloses nothing."""
    built, values = [], []
    for name, mesh in steps([*zip(found.names, found.meshes, strict=True)], on_mesh):
        try:
            field = SurfaceDistance(mesh)
        except InputError as error:
            raise InputError(f"{name}: {error}") from error
        half = mesh.extent() / 2
        spacing, shape, grid = distance_grid(field, half)
        generator = torch.Generator().manual_seed(0)
        surface = sample_surface(field.solid, POINTS_STORED, generator=generator)
        thickness, _ = field.exits(surface.points - 1e-5 * surface.normals, -surface.normals)
        grasped = torch.where(thickness < HAND_SPAN, 1.0, WIDE_SHARE)
        built.append((half, surface.points, surface.normals, grasped, spacing, shape))
        values.append(grid.flatten().half())
    sizes = torch.tensor([0, *(len(grid) for grid in values[:-1])])
    columns = [torch.stack(column) for column in zip(*built, strict=True)]
    columns += [sizes.cumsum(0), torch.cat(values)]
    return Scans(**vars(found), **dict(zip(ARRAYS, columns, strict=True)))


def distance_grid(
    field: SurfaceDistance, half: Float[Tensor, " 3"]
) -> tuple[Float[Tensor, ""], Int[Tensor, " 3"], Float[Tensor, "X Y Z"]]:
    """Spacing, shape and signed distances of a grid around the origin."""
    sides = 2 * (half + MARGIN)
    spacing = (sides.prod() / NODES).pow(1 / 3).clamp(min=FINEST)
    coarse = (sides / (SKIP * spacing)).ceil().long().clamp(min=1) + 1
    shape = SKIP * (coarse - 1) + 1

    def nodes(counts: Tensor, step: Tensor) -> Float[Tensor, "X Y Z 3"]:
        axes = (step * (torch.arange(int(n)) - (int(n) - 1) / 2) for n in counts)
        return torch.stack(torch.meshgrid(*axes, indexing="ij"), -1)

    rough = field.query(nodes(coarse, SKIP * spacing)).distance
    sizes = tuple(shape.tolist())
    grid = torch.nn.functional.interpolate(
        rough[None, None], sizes, mode="trilinear", align_corners=True
    )[0, 0]
    near = grid.abs() < EXACT + 2 * SKIP * spacing
    grid[near] = field.query(nodes(shape, spacing)[near]).distance
    return spacing, shape, grid


def find_scans(
    data: Path, objects: Path | None, unit: Unit = "m", *, on_mesh: OnStep | None = None
) -> Scans | None:
    """The scanned objects of a folder of meshes, built once and cached in the folder of shards.

    Raises:
        InputError: as `read_folder` and `build_scans`, or the shards were made with other objects.
    """
    if objects is None:
        return None
    found, kept = read_folder(objects, unit), data / FILE
    if kept.exists():
        scans = read_scans(kept)
        if scans.fingerprint != found.fingerprint:
            raise InputError(
                f"{kept}: was made of other objects than {objects} holds; "
                "pass the same objects, or name another folder"
            )
        return scans
    scans = build_scans(found, on_mesh=on_mesh)
    make_folder(data)
    write_scans(kept, scans)
    return scans


def write_scans(path: Path, scans: Scans) -> None:
    """Write scanned objects to a file, with their attribution."""
    tensors = {name: getattr(scans, name) for name in ARRAYS}
    for index, mesh in enumerate(scans.meshes):
        tensors |= {f"verts.{index}": mesh.verts, f"faces.{index}": mesh.faces.int()}
    write_tensors(path, tensors, {name: getattr(scans, name) for name in WORDS})


def read_scans(path: Path) -> Scans:
    """Scanned objects from the file of `write_scans`; `InputError` if it is missing or broken."""
    try:
        with opened_tensors(path) as (kept, record):
            meshes = tuple(
                Mesh(kept.get_tensor(f"verts.{i}"), kept.get_tensor(f"faces.{i}").long())
                for i in range(len(record["names"]))
            )
            arrays = {name: kept.get_tensor(name) for name in ARRAYS}
    except (OSError, DamagedTensorsError) as error:
        raise InputError(
            f"{path}: expected the scanned objects of these shards, got {error}; "
            "delete it and run `geneoh synthesize` again with the same --objects"
        ) from error
    names, held_out = (tuple(record[name]) for name in ("names", "held_out"))
    return Scans(names, held_out, record["notice"], meshes, **arrays)
