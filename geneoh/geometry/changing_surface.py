"""Signed distance to a mesh that bends from frame to frame, such as the skin of a hand."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int, Int64
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.distance import SurfaceQuery, first_hit, search_tree
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mirror import mirror_faces, mirror_points
from geneoh.geometry.solid import as_arrays, winding_inside, winding_of


@dataclass(frozen=True)
class ChangingSurface(Bundle):
    """A mesh over T frames; its faces look outward, and small holes count as closed.

    Nothing is kept between queries: search trees are made in the frames that need them alone.
    """

    verts: Float[Tensor, "T V 3"]
    faces: Int[Tensor, "F 3"]

    def mirrored(self) -> "ChangingSurface":
        """The mirror image at x = 0."""
        return ChangingSurface(mirror_points(self.verts), mirror_faces(self.faces))

    def query(self, points: Float[Tensor, "*B T P 3"]) -> SurfaceQuery:
        """Distance, closest point and normal for points inside the mesh of their frame.

        A point outside is infinitely far, its own closest point, and has no normal.
        """
        distance = torch.full_like(points[..., 0], torch.inf)
        closest, normal = points.clone(), torch.zeros_like(points)
        low, high = self.verts.amin(1)[:, None], self.verts.amax(1)[:, None]
        boxed = ((points >= low) & (points <= high)).all(-1)
        for frame in torch.nonzero(boxed.movedim(-2, 0).flatten(1).any(1))[:, 0].tolist():
            verts, faces = self._arrays(frame)
            asked = points[..., frame, :, :].double().cpu().numpy()
            inside = boxed[..., frame, :].cpu().numpy()
            inside[inside] = winding_inside(winding_of(verts, faces), asked[inside])
            if not inside.any():
                continue
            found = search_tree(verts, faces).squared_distance(verts, faces, asked[inside])[2]
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
        """As those of `geneoh.geometry.distance.MovingSurface`."""
        reach, normal = points.new_full((len(points),), torch.inf), direction.clone()
        for each in frame.unique().tolist():
            at = frame == each
            verts, faces = self._arrays(each)
            rays = (values[at].double().cpu().numpy() for values in (points, direction))
            length, face = first_hit(search_tree(verts, faces), verts, faces, *rays)
            outward = Mesh(self.verts[each], self.faces).face_normals().to(points)
            reach[at] = torch.from_numpy(length).to(points)
            normal[at] = outward[torch.from_numpy(face).clamp(min=0).to(points.device)]
        return reach, normal

    def _arrays(self, frame: int) -> tuple[Float64[np.ndarray, "V 3"], Int64[np.ndarray, "F 3"]]:
        return as_arrays(Mesh(self.verts[frame], self.faces))
