"""Signed distance to meshes: exact distance to the triangles, sign by the winding number, batched.

libigl searches on the CPU in float64; queries take points of any dtype and device, and return
results of the same. Points on a GPU are searched there in float32, where NVIDIA Warp is installed
(extra `gpu`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int, Int64
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.coarse_distance import CELLS, CoarseDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.solid import as_arrays, build_solid
from geneoh.interrupts import interrupts_wait

with interrupts_wait():
    import igl

ON_SURFACE = 1e-7  # metres below which the direction to the surface is noise: use its normal
NEARLY_ON = 1e-5  # the same in float32
WARP = find_spec("warp") is not None  # whether a GPU can search surfaces


def pairwise_distances(
    points: Float[Tensor, "*#B P D"], others: Float[Tensor, "*#B N D"]
) -> Float[Tensor, "*B P N"]:
    """Distance of every point to each of `others`, accurate also far from the origin.

    The matrix product that `torch.cdist` takes by default is off by a millimetre at two metres.
    """
    return torch.cdist(points, others, compute_mode="donot_use_mm_for_euclid_dist")


@dataclass(frozen=True)
class SurfaceQuery(Bundle):
    """Signed distance, closest surface point and normal of query points, in their frame."""

    distance: Float[Tensor, "*B P"]  # metres, negative inside
    closest: Float[Tensor, "*B P 3"]
    normal: Float[Tensor, "*B P 3"]  # unit gradient of the distance: outward


def _query(points: Tensor, distance: Tensor, closest: Tensor, normal: Tensor) -> SurfaceQuery:
    """Results for N flattened points in the shape, dtype and device of the query points."""
    closest, normal = (value.to(points).reshape(points.shape) for value in (closest, normal))
    return SurfaceQuery(distance.to(points).reshape(points.shape[:-1]), closest, normal)


class SearchTree:
    """A bounding volume hierarchy of a mesh, for closest points and ray intersections."""

    def __init__(self, mesh: Mesh) -> None:
        """Build the hierarchy."""
        self._mesh, self._boxes = as_arrays(mesh), igl.AABB()
        self._boxes.init(*self._mesh)

    def nearest(
        self, points: Float64[np.ndarray, "N 3"]
    ) -> tuple[Float64[np.ndarray, " N"], Int64[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
        """Squared distance of each point to the mesh, the face there, and the closest point."""
        found = self._boxes.squared_distance(*self._mesh, np.ascontiguousarray(points))
        squared, face, closest = map(np.asarray, found)
        return squared, face.astype(np.int64), closest

    def first_hit(
        self, origin: Float64[np.ndarray, "N 3"], direction: Float64[np.ndarray, "N 3"]
    ) -> tuple[Float64[np.ndarray, " N"], Int64[np.ndarray, " N"]]:
        """Distance along each ray of unit direction to the first face that it meets, metres, and
        the index of that face; infinity and -1 where it meets none."""
        face, reach, _ = self._boxes.intersect_ray_first(*self._mesh, origin, direction)
        face = np.asarray(face, dtype=np.int64)
        return np.where(face < 0, np.inf, reach), face

    def exits(
        self, points: Float[Tensor, "N 3"], direction: Float[Tensor, "N 3"]
    ) -> tuple[Float[Tensor, " N"], Int[Tensor, " N"]]:
        """As `first_hit`, for tensors; where a ray meets no face, the index is arbitrary."""
        rays = (values.cpu().double().numpy() for values in (points, direction))
        reach, face = map(torch.from_numpy, self.first_hit(*rays))
        return reach.to(points), face.clamp(min=0)


class SearchedSolid:
    """A mesh as a solid, with all that is made of it to find distances: made once."""

    def __init__(self, mesh: Mesh) -> None:
        """Build the tree; the grid is made when it is first asked for."""
        self.solid = build_solid(mesh)
        self.tree = SearchTree(self.solid.surface)
        self.normals = self.solid.surface.face_normals()
        self._coarse: CoarseDistance | None = None

    def coarse(self) -> CoarseDistance:
        """The grid of coarse distances."""
        if self._coarse is None:
            self._coarse = CoarseDistance.around(self.solid.low, self.solid.high, self.exact)
        return self._coarse

    def exact(
        self, points: Float[Tensor, "N 3"], coarse: CoarseDistance | None = None
    ) -> tuple[Float[Tensor, " N"], Float[Tensor, "N 3"], Float[Tensor, "N 3"]]:
        """Signed distance, closest point and normal; with the grid most signs are found sooner."""
        squared, face, closest = map(torch.from_numpy, self.tree.nearest(points.numpy()))
        distance = squared.sqrt()
        inside = self._contains(points, distance, coarse)
        signed = torch.where(inside, -distance, distance)
        normal = (points - closest) / signed[:, None]
        on_surface = (distance < ON_SURFACE)[:, None]
        normal = torch.where(on_surface, self.normals[face], normal)
        return signed, closest, normal

    def _contains(
        self,
        points: Float[Tensor, "N 3"],
        distance: Float[Tensor, " N"],
        coarse: CoarseDistance | None,
    ) -> Bool[Tensor, " N"]:
        """Whether each point is inside; `distance` is its unsigned distance to the surface."""
        if coarse is None:
            return self.solid.contains(points)
        inside, sure = coarse.is_inside(points, distance)
        unsure = torch.nonzero(~sure)[:, 0]
        inside[unsure] = self.solid.contains(points[unsure])
        return inside


@lru_cache(maxsize=2)
def searched_solid(mesh: Mesh) -> SearchedSolid:
    """What is made of a mesh; cached, because several steps of a cleaning and the next clip use the
    same mesh."""
    return SearchedSolid(mesh)


class SurfaceDistance:
    """Signed distance to one mesh, in the frame of the mesh; the search trees are built once.

    The mesh is taken as a solid (see `solid.py`): holes and several shells are fine. Open sheets
    get a wall of 2 mm, so that the penetration depth in them is at most 1 mm.
    """

    def __init__(self, mesh: Mesh) -> None:
        """Build the trees; seconds for 100,000 triangles and more."""
        self.mesh = mesh
        self._searched = searched_solid(mesh.copied())
        self.solid, self.tree = self._searched.solid, self._searched.tree
        self._on_devices: dict[torch.device, Any] = {}
        self._coarse: CoarseDistance | None = None
        self._queried = 0  # points so far that a grid could have answered

    def query(self, points: Float[Tensor, "*B P 3"], within: float | None = None) -> SurfaceQuery:
        """Signed distance, closest point and normal of each point, without gradients.

        Points that are not finite get a distance that is not finite. With `within`, the distance of
        points farther than that outside the mesh may be a lower bound, itself above `within`, and
        their closest point and normal approximate.
        """
        if points.is_cuda and WARP:
            return self.query_on(points.device, points, within)
        flat = points.detach().reshape(-1, 3).cpu().double()
        closest = flat.clamp(self.solid.low, self.solid.high)
        normal = flat - closest
        distance = normal.norm(dim=-1)
        exact = flat.isfinite().all(-1) if within is None else distance <= within
        chosen = torch.nonzero(exact)[:, 0]
        normal /= distance[:, None]
        if within is not None and (coarse := self._coarse_distance(len(chosen))):
            least, *found = coarse.at_least(flat[chosen])
            far = least > within
            apart = chosen[far]
            distance[apart], chosen = least[far], chosen[~far]
            closest[apart], normal[apart] = (value[far] for value in found)
        if len(chosen):
            found = self._searched.exact(flat[chosen], self._coarse)
            distance[chosen], closest[chosen], normal[chosen] = found
        return _query(points, distance, closest, normal)

    def query_on(
        self, device: torch.device, points: Float[Tensor, "*B P 3"], within: float | None = None
    ) -> SurfaceQuery:
        """As `query`, by NVIDIA Warp on `device` in float32; points may be on another device."""
        from geneoh.geometry.warp_distance import WarpField  # seconds to import

        if device not in self._on_devices:
            self._on_devices[device] = WarpField(self.solid, device)
        flat = points.detach().reshape(-1, 3)
        closest, face, inside = self._on_devices[device].nearest(flat, within)
        apart = flat.to(closest) - closest
        distance = apart.norm(dim=-1)
        signed = torch.where(inside, -distance, distance)
        normals = self._searched.normals.to(closest)[face]
        normal = torch.where((distance < NEARLY_ON)[:, None], normals, apart / signed[:, None])
        return _query(points, signed, closest, normal)

    def exits(
        self, points: Float[Tensor, "N 3"], direction: Float[Tensor, "N 3"]
    ) -> tuple[Float[Tensor, " N"], Float[Tensor, "N 3"]]:
        """Distance along rays of unit direction to the surface, metres, and the outward normal.

        Infinity and a meaningless normal where the ray meets no surface.
        """
        reach, face = self.tree.exits(points, direction)
        return reach, self._searched.normals[face].to(points)

    def _coarse_distance(self, count: int) -> CoarseDistance | None:
        """The grid of coarse distances; None until so many queries were made that it pays off.

        Always None for a mesh with holes, where the sign changes away from the surface.
        """
        self._queried += count
        if self._coarse is None and self._queried > CELLS and self.solid.closed:
            self._coarse = self._searched.coarse()
        return self._coarse


@dataclass(frozen=True)
class MovingSurface:
    """An object of Q moving parts over T frames, queried in the world frame."""

    fields: tuple[SurfaceDistance, ...]  # one per part, in the part's frame
    rotation: Float[Tensor, "T Q 3 3"]
    """Part to world per frame, with `translation` in metres; on the device of the points."""
    translation: Float[Tensor, "T Q 3"]
    within: float | None = None  # broad phase of queries in metres, see `SurfaceDistance.query`

    @property
    def parts(self) -> Iterator[tuple[SurfaceDistance, Rigid]]:
        """Each part with its pose in the world, over the frames."""
        for part, field in enumerate(self.fields):
            yield field, Rigid(self.rotation[:, part], self.translation[:, part])

    def pose(self, frame: Int[Tensor, "*#N"], part: Int[Tensor, "*#N"]) -> Rigid:
        """Pose in the world of each pair of a frame and a part."""
        return Rigid(self.rotation[frame, part], self.translation[frame, part])

    def at(self, frames: Int[Tensor, " N"] | slice) -> "MovingSurface":
        """The object in some of the frames."""
        return replace(self, rotation=self.rotation[frames], translation=self.translation[frames])

    def of_parts(self, parts: list[int]) -> "MovingSurface":
        """Some of the parts alone, in that order."""
        fields = tuple(self.fields[part] for part in parts)
        rotation, translation = self.rotation[:, parts], self.translation[:, parts]
        return replace(self, fields=fields, rotation=rotation, translation=translation)

    def query(self, points: Float[Tensor, "*B T P 3"]) -> SurfaceQuery:
        """Signed distance in each frame to the part with the least one, in the world frame."""
        found = []
        for field, pose_world_part in self.parts:
            local = field.query(pose_world_part.inverse().apply(points), self.within)
            normal = local.normal @ pose_world_part.rotation.transpose(-1, -2)
            closest = pose_world_part.apply(local.closest)
            found.append(SurfaceQuery(local.distance, closest, normal))
        if len(found) == 1:
            return found[0]
        distance, nearest = torch.stack([query.distance for query in found]).min(0)
        index = nearest[None, ..., None].expand(1, *nearest.shape, 3)
        closest = torch.stack([query.closest for query in found]).gather(0, index)[0]
        normal = torch.stack([query.normal for query in found]).gather(0, index)[0]
        return SurfaceQuery(distance, closest, normal)

    def part_at(self, points: Float[Tensor, "T K 3"]) -> Int[Tensor, "T K"]:
        """The part on whose surface each point lies."""
        distances = [
            field.query(pose_world_part.inverse().apply(points)).distance
            for field, pose_world_part in self.parts
        ]
        return torch.stack(distances).abs().argmin(0)

    def exits(
        self,
        frame: Int[Tensor, " N"],
        points: Float[Tensor, "N 3"],
        direction: Float[Tensor, "N 3"],
    ) -> tuple[Float[Tensor, " N"], Float[Tensor, "N 3"]]:
        """Distance from inner points along rays of unit direction to the surface, and the normal.

        Metres and world frame. Infinity, and the direction as normal, where a ray meets no surface.
        """
        reach, normal = points.new_full((len(points),), torch.inf), direction
        for part, field in enumerate(self.fields):
            turn = self.rotation[frame, part]
            local = ((points - self.translation[frame, part])[:, None] @ turn)[:, 0]
            found, outward = field.exits(local, (direction[:, None] @ turn)[:, 0])
            nearer = found < reach
            reach = torch.where(nearer, found, reach)
            turned = (turn @ outward[..., None])[..., 0]
            normal = torch.where(nearer[:, None], turned, normal)
        return reach, normal
