"""Signed distance to a mesh that bends from frame to frame, such as the skin of a hand."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.distance import SearchTree, SurfaceQuery
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mirror import mirror_faces, mirror_points
from geneoh.geometry.solid import winding_inside, winding_of


@dataclass(frozen=True)
class ChangingSurface(Bundle):
    """A deforming mesh over T frames with outward faces; small holes count as closed.

    Nothing is cached between queries: search trees are built only in the frames that need them.
    """

    verts: Float[Tensor, "T V 3"]
    faces: Int[Tensor, "F 3"]

    def mirrored(self) -> "ChangingSurface":
        """The mirror image at x = 0."""
        return ChangingSurface(mirror_points(self.verts), mirror_faces(self.faces))

    def query(self, points: Float[Tensor, "*B T P 3"]) -> SurfaceQuery:
        """Signed distance, closest point and normal of points inside the mesh of their frame.

        A point outside gets distance infinity, itself as closest point, and a zero normal.
        """
        distance = torch.full_like(points[..., 0], torch.inf)
        closest, normal = points.clone(), torch.zeros_like(points)
        low, high = self.verts.amin(1)[:, None], self.verts.amax(1)[:, None]
        boxed = ((points >= low) & (points <= high)).all(-1)
        for frame in torch.nonzero(boxed.movedim(-2, 0).flatten(1).any(1))[:, 0].tolist():
            mesh = Mesh(self.verts[frame], self.faces)
            queries = points[..., frame, :, :].double().cpu().numpy()
            inside = boxed[..., frame, :].cpu().numpy()
            inside[inside] = winding_inside(winding_of(mesh), queries[inside])
            if not inside.any():
                continue
            found = SearchTree(mesh).nearest(queries[inside])[2]
            at, ends = torch.from_numpy(inside).to(points.device), torch.from_numpy(found)
            away = ends.to(points) - points[..., frame, :, :][at]
            distance[..., frame, :][at] = -away.norm(dim=-1)
            closest[..., frame, :, :][at] = ends.to(points)
            normal[..., frame, :, :][at] = torch.nn.functional.normalize(away, dim=-1)
        return SurfaceQuery(distance, closest, normal)

    def exits(
        self,
        frame: Int[Tensor, " N"],
        points: Float[Tensor, "N 3"],
        direction: Float[Tensor, "N 3"],
    ) -> tuple[Float[Tensor, " N"], Float[Tensor, "N 3"]]:
        """As `geneoh.geometry.distance.MovingSurface.exits`."""
        reach, normal = points.new_full((len(points),), torch.inf), direction.clone()
        for each in frame.unique().tolist():
            at = frame == each
            mesh = Mesh(self.verts[each], self.faces)
            reach[at], face = SearchTree(mesh).exits(points[at], direction[at])
            normal[at] = mesh.face_normals().to(points)[face.to(points.device)]
        return reach, normal
