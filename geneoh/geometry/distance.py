"""Signed distance to meshes: exact on the triangles, signed by the winding number, in batches.

Search trees and their answers are libigl's, on the CPU in float64; queries take points of any
device and answer in their type and on their device. Points on a GPU are searched there, in float32,
where NVIDIA Warp is installed (extra `gpu`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

import igl
import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int, Int64
from torch import Tensor

from geneoh.geometry.coarse_distance import CELLS, CoarseDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.solid import Solid, as_arrays, build_solid

ON_SURFACE = 1e-7  # metres below which the direction to the surface is noise: its normal is used
NEARLY_ON = 1e-5  # the same in float32
WARP = find_spec("warp") is not None  # whether a GPU can search surfaces


def pairwise_distances(
    points: Float[Tensor, "*#B P D"], others: Float[Tensor, "*#B N D"]
) -> Float[Tensor, "*B P N"]:
    """Distance of every point to every other one, exact far from the origin too.

    The matrix product that `torch.cdist` takes by default is off by a millimetre at two metres.
    """
    return torch.cdist(points, others, compute_mode="donot_use_mm_for_euclid_dist")


@dataclass(frozen=True)
class SurfaceQuery:
    """Distance, closest surface point and normal for each of some points, in their frame."""

    distance: Float[Tensor, "*B P"]  # metres, negative inside
    closest: Float[Tensor, "*B P 3"]
    normal: Float[Tensor, "*B P 3"]  # unit gradient of the distance: outward


def _query(points: Tensor, distance: Tensor, closest: Tensor, normal: Tensor) -> SurfaceQuery:
    """Answers for N points in a row, as those of the points that were asked for."""
    closest, normal = (value.to(points).reshape(points.shape) for value in (closest, normal))
    return SurfaceQuery(distance.to(points).reshape(points.shape[:-1]), closest, normal)


class SearchTree:
    """The boxes around the faces of a mesh, in which the nearest and those on rays are found."""

    def __init__(self, mesh: Mesh) -> None:
        """Build them."""
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
        """Metres along each ray of unit direction to the first face it meets, and its index; else
        infinite and -1."""
        face, reach, _ = self._boxes.intersect_ray_first(*self._mesh, origin, direction)
        face = np.asarray(face, dtype=np.int64)
        return np.where(face < 0, np.inf, reach), face

    def exits(
        self, points: Float[Tensor, "N 3"], direction: Float[Tensor, "N 3"]
    ) -> tuple[Float[Tensor, " N"], Int[Tensor, " N"]]:
        """As `first_hit`, of tensors; where a ray meets no face, any one is named."""
        rays = (values.cpu().double().numpy() for values in (points, direction))
        reach, face = map(torch.from_numpy, self.first_hit(*rays))
        return reach.to(points), face.clamp(min=0)


@lru_cache(maxsize=2)
def solid_with_tree(mesh: Mesh) -> tuple[Solid, SearchTree]:
    """A mesh as a solid with the tree of its surface, kept because the smoothing of an
    object's track, the hand, the page of the result and the next clip ask for the same again."""
    solid = build_solid(mesh)
    return solid, SearchTree(solid.surface)


class SurfaceDistance:
    """Signed distance to one mesh, in its own frame; the search trees are built once and kept.

    The mesh is taken as a solid (see `solid.py`): holes and several shells are fine, open sheets
    get a wall of 2 mm, so that nothing is deeper than 1 mm in one of those.
    """

    def __init__(self, mesh: Mesh) -> None:
        """Build the trees; seconds for 100,000 triangles and more."""
        self.mesh = mesh
        # of a copy, because a caller may change the numbers of a mesh in place
        kept = Mesh(mesh.verts.detach().cpu().clone(), mesh.faces.cpu().clone(), mesh.source)
        self.solid, self.tree = solid_with_tree(kept)
        self._normals = self.solid.surface.face_normals()
        self._on_devices: dict[torch.device, Any] = {}
        self._coarse: CoarseDistance | None = None
        self._asked = 0  # points so far for which a grid would have been of use

    def query(self, points: Float[Tensor, "*B P 3"], within: float | None = None) -> SurfaceQuery:
        """Signed distance, closest point and normal of each point, without gradients.

        Points that are not finite get a distance that is not finite. Points that are easily seen to
        be farther than `within` metres outside of the mesh get a distance above `within` that is
        never above the true one, and a closest point and a normal that are roughly right.
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
            distance[chosen], closest[chosen], normal[chosen] = self._exact(flat[chosen])
        return _query(points, distance, closest, normal)

    def query_on(
        self, device: torch.device, points: Float[Tensor, "*B P 3"], within: float | None = None
    ) -> SurfaceQuery:
        """As `query`, searched on a device by NVIDIA Warp, in float32, wherever points are."""
        from geneoh.geometry.warp_distance import WarpField  # seconds to import

        if device not in self._on_devices:
            self._on_devices[device] = WarpField(self.solid, device)
        flat = points.detach().reshape(-1, 3)
        closest, face, inside = self._on_devices[device].nearest(flat, within)
        apart = flat.to(closest) - closest
        distance = apart.norm(dim=-1)
        signed = torch.where(inside, -distance, distance)
        normals = self._normals.to(closest)[face]
        normal = torch.where((distance < NEARLY_ON)[:, None], normals, apart / signed[:, None])
        return _query(points, signed, closest, normal)

    def exits(
        self, points: Float[Tensor, "N 3"], direction: Float[Tensor, "N 3"]
    ) -> tuple[Float[Tensor, " N"], Float[Tensor, "N 3"]]:
        """Metres from points along unit directions to the surface, and its outward normal there.

        The distance is infinite and the normal meaningless where the ray meets no surface.
        """
        reach, face = self.tree.exits(points, direction)
        return reach, self._normals[face].to(points)

    def _coarse_distance(self, asked: int) -> CoarseDistance | None:
        """The grid of coarse distances, which is made when it will be worth its time.

        None for a mesh with holes, in which the sign changes away from the surface.
        """
        self._asked += asked
        if self._coarse is None and self._asked > CELLS and self.solid.closed:
            self._coarse = CoarseDistance.around(self.solid.low, self.solid.high, self._exact)
        return self._coarse

    def _exact(
        self, points: Float[Tensor, "N 3"]
    ) -> tuple[Float[Tensor, " N"], Float[Tensor, "N 3"], Float[Tensor, "N 3"]]:
        squared, face, closest = map(torch.from_numpy, self.tree.nearest(points.numpy()))
        distance = squared.sqrt()
        signed = torch.where(self._contains(points, distance), -distance, distance)
        normal = (points - closest) / signed[:, None]
        on_surface = (distance < ON_SURFACE)[:, None]
        normal = torch.where(on_surface, self._normals[face], normal)
        return signed, closest, normal

    def _contains(
        self, points: Float[Tensor, "N 3"], distance: Float[Tensor, " N"]
    ) -> Bool[Tensor, " N"]:
        """Whether points at some distances from the surface are inside."""
        if self._coarse is None:
            return self.solid.contains(points)
        inside, sure = self._coarse.is_inside(points, distance)
        unsure = torch.nonzero(~sure)[:, 0]
        inside[unsure] = self.solid.contains(points[unsure])
        return inside


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
        """Pose in the world of the given part in the given frame, for each pair of them."""
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
        """Distance in each frame to the part with the least signed distance."""
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
        """Metres from points inside, along unit directions, to the surface, and its normal there.

        Infinite, with the direction for a normal, where the ray meets no surface.
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
