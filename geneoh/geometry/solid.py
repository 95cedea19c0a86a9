"""The inside of a mesh by generalised winding numbers, for the imperfect meshes that users have.

A point is inside where the winding number exceeds a half in absolute value, so a mesh turned inside
out is the same solid. Holes, several shells and overlapping parts need no repair (Jacobson et al.
2013; fast form: Barill et al. 2018). Three defects are repaired: faces that are duplicated to show
both sides lose the copies, faces and closed shells are oriented consistently, and an open sheet (a
bowl without thickness) gets a wall, as no sign rule can distinguish its cavity from its inside.
Solids are kept on the CPU, where libigl works.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int, Int64
from torch import Tensor

from geneoh.bundle import spread
from geneoh.errors import InputError
from geneoh.geometry.mesh import WELD_TOLERANCE, Mesh, checked_mesh, welded
from geneoh.geometry.openings import connected, edge_keys, open_edges, rims, thickened
from geneoh.interrupts import interrupts_wait

with interrupts_wait():
    import igl

OPENING_SHARE = 0.05
"""Share of its shell's area above which a hole counts as an opening of a sheet.

A bowl has 0.5, a cup 0.15, a glass 0.09; a bottle's neck and a scanner's gaps 0.01 or less, and
those stay holes of a solid. A scan whose base is missing cannot be distinguished from a cup.
"""
PLUGGED_WINDING = 0.25
"""Winding number of the other shells next to an opening's cap above which they close it: it is
about a half behind a lid, one within a solid plug, and zero in free space."""
PLUG_OFFSET = 0.05  # distance of these queries from the cap, per root of the opening's area
SMALLEST_SHEET = 1e-3  # share of the mesh's area below which an open shell needs no wall
TESTED_FACES = 64  # of a shell, where it is tested whether it lies within the others
COARSE = 1.0
"""Accuracy of the first winding number query: three times as fast as libigl's default of 2, with a
result within 0.09 on a recorded hand around a tool."""
UNSURE = 0.25  # points this close to the threshold are queried again at full accuracy
PROBE = 1e-5  # distance in front of a face at which its winding number is queried, metres
PROBES = tuple((a / 9, b / 9, c / 9) for a, b, c in ((3, 3, 3), (7, 1, 1), (1, 7, 1), (1, 1, 7)))
"""Barycentric coordinates of these queries: the centre of the face, then towards each corner."""


@dataclass(frozen=True)
class Solid:
    """A mesh as a body with an inside and an outside, on the CPU."""

    surface: Mesh  # the faces between inside and outside, all pointing outward
    body: Mesh  # the faces whose winding number defines the inside; a shell may point either way
    closed: bool  # whether the body has no open edge: only its surface separates inside and outside
    walled: bool  # whether an open sheet of the mesh got a wall
    low: Float64[Tensor, " 3"]
    high: Float64[Tensor, " 3"]  # with `low`, corners of the surface's bounding box
    winding: igl.FastWindingNumberBVH

    def contains(self, points: Float[Tensor, "*B 3"]) -> Bool[Tensor, "*B"]:
        """Whether each point is inside; never true outside the bounding box."""
        flat = points.detach().reshape(-1, 3).cpu().double()
        inside = ((flat >= self.low) & (flat <= self.high)).all(-1)
        near = torch.nonzero(inside)[:, 0]
        inside[near] = torch.from_numpy(winding_inside(self.winding, flat[near].numpy()))
        return inside.to(points.device).reshape(points.shape[:-1])


def winding_of(mesh: Mesh) -> igl.FastWindingNumberBVH:
    """The winding numbers of a mesh."""
    winding = igl.FastWindingNumberBVH()
    winding.init(*as_arrays(mesh))
    return winding


def winding_inside(
    winding: igl.FastWindingNumberBVH, points: Float64[np.ndarray, "P 3"]
) -> Bool[np.ndarray, " P"]:
    """Whether points are inside by the absolute winding number, whichever way the faces point."""
    if len(points) == 0:
        return np.zeros(0, dtype=bool)
    number = np.abs(winding.winding_number(np.ascontiguousarray(points), COARSE))
    near = np.abs(number - 0.5) < UNSURE
    if near.any():
        number[near] = np.abs(winding.winding_number(np.ascontiguousarray(points[near])))
    return number > 0.5


def build_solid(mesh: Mesh) -> Solid:
    """Make a solid of a mesh: consistent faces, walls for open sheets, no interior faces.

    Raises:
        InputError: the mesh has no surface that can be measured, or none that encloses anything.
    """
    name = str(mesh.source or "the mesh")
    mesh = checked_mesh(Mesh(mesh.verts.detach().cpu(), mesh.faces.cpu()), name)
    whole = welded(mesh)
    if not len(whole.faces):
        raise InputError(
            f"{name}: expected faces larger than {WELD_TOLERANCE:g} m, got none in a mesh that is "
            f"{float(mesh.extent().max()):.3g} m long; scale it to metres"
        )
    sheets, patches = agreeing(without_copies(whole))
    sheets = with_shells_outward(sheets, patches)
    body = with_walls(sheets, patches)
    winding = winding_of(body)
    closed = not bool(open_edges(body.faces).any())
    one_shell = closed and int(patches.max()) == 0
    surface = outward_by_volume(body) if one_shell else outward_by_winding(body, winding)
    surface = Mesh(surface.verts, surface.faces[(surface.face_normals() != 0).any(-1)])
    if not len(surface.faces):
        raise InputError(
            f"{name}: expected a surface between an inside and an outside, got {len(mesh.faces)} "
            "faces that enclose nothing; check the mesh and its scale"
        )
    corners = surface.corners().reshape(-1, 3).double()
    walled = len(body.verts) > len(sheets.verts)
    return Solid(surface, body, closed, walled, corners.amin(0), corners.amax(0), winding)


def without_copies(mesh: Mesh) -> Mesh:
    """The mesh without copies of faces, where all faces of a shell or some regions have one.

    Files for rendering duplicate faces to show both sides; the winding numbers of opposite faces
    cancel, so nothing would be inside. Three faces meet at the border of a region with copies, and
    two without. A face that two bodies share stays twice: four meet at its edges, three without.
    """
    faces, same = mesh.faces, numbered_places(mesh.faces)
    repeated = torch.bincount(same)[same] > 1
    if not bool(repeated.any()):
        return mesh
    order = torch.arange(len(same))
    first = torch.full_like(order, len(order)).scatter_reduce(0, same, order, "amin")
    copy = first[same] != order
    edge = torch.unique(edge_keys(faces), return_inverse=True)[1]
    before, after = (
        torch.bincount(edge[f].flatten(), minlength=len(edge) * 3) for f in (order, ~copy)
    )
    opened = (after % 2 - before % 2)[edge].sum(-1).masked_fill(copy, 0)  # edges of each face
    patch, shell = bodies(faces[repeated]), bodies(faces)
    opened_by = torch.zeros_like(order).index_add_(0, patch, opened[repeated])
    mixed = torch.zeros_like(copy).index_fill_(0, shell[~repeated], True)
    copy[repeated] &= (opened_by[patch] < 0) | ~mixed[shell[repeated]]
    return Mesh(mesh.verts, faces[~copy])


def bodies(faces: Int[Tensor, "F 3"]) -> Int[Tensor, " F"]:
    """An index for each face, equal for faces that are connected by common vertices."""
    body = connected(faces[:, [0, 1, 0, 2]].reshape(-1, 2))[faces[:, 0]]
    return torch.unique(body, return_inverse=True)[1]  # vertices without a face are no bodies


def numbered_places(faces: Int[Tensor, "F 3"]) -> Int[Tensor, " F"]:
    """An index for the three corners of each face, equal for faces with the same corners."""
    corners, size = faces.sort(-1).values, int(faces.max()) + 1
    edge = torch.unique(corners[:, 0] * size + corners[:, 1], return_inverse=True)[1]
    return torch.unique(edge * size + corners[:, 2], return_inverse=True)[1]


def as_arrays(mesh: Mesh) -> tuple[Float64[np.ndarray, "V 3"], Int64[np.ndarray, "F 3"]]:
    """Vertices and faces in the types that libigl takes."""
    verts = mesh.verts.detach().cpu().double().numpy()
    return verts, np.ascontiguousarray(mesh.faces.cpu().numpy())


def agreeing(mesh: Mesh) -> tuple[Mesh, Int[Tensor, " F"]]:
    """The mesh with faces oriented consistently within each patch, and the patch of each face.

    A patch takes the orientation of most of its area; patches end where three or more faces meet.
    """
    turned, patch = (torch.from_numpy(found).long() for found in igl.bfs_orient(mesh.faces.numpy()))
    area = mesh.face_vectors().norm(dim=-1)
    vote = torch.where((turned != mesh.faces).any(-1), -area, area)
    balance = area.new_zeros(int(patch.max()) + 1).index_add_(0, patch, vote)
    back = (balance < 0)[patch]
    return Mesh(mesh.verts, torch.where(back[:, None], turned.flip(-1), turned)), patch


def with_shells_outward(mesh: Mesh, patches: Int[Tensor, " F"]) -> Mesh:
    """The mesh with all closed shells pointing outward, except those within others, which bound
    cavities: the winding numbers of shells that point opposite ways cancel where they overlap."""
    corners = mesh.corners().double()
    zeros = corners.new_zeros(int(patches.max()) + 1)
    if len(zeros) == 1:
        return mesh
    a, b, c = (corners - corners.mean((0, 1))).unbind(-2)
    volume = zeros.index_add(0, patches, (a * torch.linalg.cross(b, c)).sum(-1))
    if float(volume.sum()) < 0:
        mesh, volume = Mesh(mesh.verts, mesh.faces.flip(-1)), -volume
        corners = corners.flip(-2)
    _, edge, count = torch.unique(edge_keys(mesh.faces), return_inverse=True, return_counts=True)
    closed = torch.ones_like(zeros, dtype=torch.bool)
    closed[patches[(count[edge] != 2).any(-1)]] = False
    inward = torch.nonzero(closed & (volume < 0))[:, 0].tolist()
    if not inward:
        return mesh
    winding, probes = winding_of(mesh), torch.tensor(PROBES, dtype=torch.float64)
    normals, turned = mesh.face_normals(), torch.zeros_like(patches, dtype=torch.bool)
    for patch in inward:
        own = torch.nonzero(patches == patch)[:, 0]
        some = own[spread(len(own), min(len(own), TESTED_FACES))]
        points = probes @ corners[some] - PROBE * normals[some, None]
        points, shell = (places.flatten(0, 1).numpy() for places in (points, corners[own]))
        alone = igl.winding_number(shell, np.arange(len(shell)).reshape(-1, 3), points)
        within = np.abs(np.asarray(winding.winding_number(points, COARSE)) - alone) > 0.5
        turned[own] = bool(within.mean() < 0.5)
    return Mesh(mesh.verts, torch.where(turned[:, None], mesh.faces.flip(-1), mesh.faces))


def with_walls(mesh: Mesh, patches: Int[Tensor, " F"]) -> Mesh:
    """The mesh with walls in place of the open sheets among the patches."""
    area = mesh.face_vectors().norm(dim=-1) / 2
    patch_area = area.new_zeros(int(patches.max()) + 1).index_add_(0, patches, area)
    candidates = [
        (int(patch), caps)
        for patch, caps in opening_caps(mesh, patches, patch_area).items()
        if patch_area[patch] > SMALLEST_SHEET * patch_area.sum()
    ]
    if not candidates:
        return mesh
    winding = winding_of(mesh)
    verts, kept = [mesh.verts], torch.ones(len(mesh.faces), dtype=torch.bool)
    walls, count = [], len(mesh.verts)
    for patch, caps in candidates:
        own = patches == patch
        if is_plugged(mesh, own, caps, winding):
            continue
        wall = thickened(Mesh(mesh.verts, mesh.faces[own]))
        verts.append(wall.verts)
        walls.append(wall.faces + count)
        kept, count = kept & ~own, count + len(wall.verts)
    return Mesh(torch.cat(verts), torch.cat([mesh.faces[kept], *walls]))


def opening_caps(
    mesh: Mesh, patches: Int[Tensor, " F"], patch_area: Float[Tensor, " N"]
) -> dict[int, list[Float[Tensor, "C 3"]]]:
    """For each patch with large openings: points on both sides of each opening's cap."""
    rim = open_edges(mesh.faces)
    edges, chain = rims(mesh.faces, rim)
    owners = patches[:, None].expand(-1, 3)[rim]
    # Two patches may touch in a vertex, so a loop is identified by its patch as well.
    names, loops = torch.unique(chain * len(patch_area) + owners, return_inverse=True)
    start, end = mesh.verts.double()[edges].unbind(1)
    owner = names % len(patch_area)
    caps: dict[int, list[Tensor]] = {}
    if len(owner) == 0:
        return caps
    zeros = start.new_zeros(len(owner), 3)
    count = torch.bincount(loops)
    centre = zeros.index_add(0, loops, start) / count[:, None]
    spokes, turn = start - centre[loops], torch.linalg.cross(start - centre[loops], end - start)
    # Half the sum of cross products is the vector area of any surface that the loop bounds.
    across = zeros.index_add(0, loops, turn) / 2
    opening = across.norm(dim=-1)
    for loop in torch.nonzero(opening > OPENING_SHARE * patch_area[owner])[:, 0].tolist():
        spread = torch.cat([spokes[loops == loop] * share for share in (0.0, 0.35, 0.7)])
        aside = PLUG_OFFSET * across[loop] / opening[loop].sqrt()
        sides = torch.cat([centre[loop] + spread + aside, centre[loop] + spread - aside])
        caps.setdefault(int(owner[loop]), []).append(sides)
    return caps


def is_plugged(
    mesh: Mesh,
    own: Bool[Tensor, " F"],
    caps: list[Float[Tensor, "C 3"]],
    winding: igl.FastWindingNumberBVH,
) -> bool:
    """Whether the other shells close every opening of a sheet, on either side of its cap."""
    verts, faces = as_arrays(Mesh(mesh.verts, mesh.faces[own]))
    for cap in caps:
        points = cap.numpy()
        alone = np.asarray(igl.winding_number(verts, faces, points))
        others = np.asarray(winding.winding_number(points)) - alone
        if np.median(np.abs(others).reshape(2, -1), axis=-1).max() < PLUGGED_WINDING:
            return False
    return True


def outward_by_volume(mesh: Mesh) -> Mesh:
    """A closed shell, with its faces reversed where its signed volume is negative."""
    a, b, c = mesh.corners().double().unbind(-2)
    volume = (a * torch.linalg.cross(b, c)).sum()
    return mesh if float(volume) > 0 else Mesh(mesh.verts, mesh.faces.flip(-1))


def outward_by_winding(mesh: Mesh, winding: igl.FastWindingNumberBVH) -> Mesh:
    """The faces oriented outward, without those that have the inside on both sides.

    Such faces lie where shells overlap and are no part of the surface. A face is left out only if
    all of its probes are inside, because other faces may pierce the centre of a large face.
    """
    ahead = torch.ones(len(mesh.faces), dtype=torch.bool)
    buried, behind = ahead.clone(), ahead.clone()
    for probe in PROBES:
        ahead[buried], behind[buried] = sides(Mesh(mesh.verts, mesh.faces[buried]), winding, probe)
        buried = ahead & behind
    faces = torch.where((ahead & ~behind)[:, None], mesh.faces.flip(-1), mesh.faces)
    return Mesh(mesh.verts, faces[~buried])


def sides(
    mesh: Mesh, winding: igl.FastWindingNumberBVH, probe: tuple[float, float, float]
) -> tuple[Bool[Tensor, " F"], Bool[Tensor, " F"]]:
    """Whether the inside lies in front of and behind each face, at one barycentric position."""
    weights = torch.tensor(probe, dtype=torch.float64)
    places = (mesh.corners().double() * weights[:, None]).sum(-2)
    normals = PROBE * mesh.face_normals()
    # Where faces coincide, the winding number grows through them by more or less than one.
    ahead, behind = (
        winding_inside(winding, p.numpy()) for p in (places + normals, places - normals)
    )
    return torch.from_numpy(ahead), torch.from_numpy(behind)
