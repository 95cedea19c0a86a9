"""Penetration as a volume: the intersection of hand and object per frame.

The object's frame is divided into voxels of a stated size, and a voxel counts when its centre is
inside both. The winding number decides what is inside, so that holes and shells need no repair. The
voxel axes are rotated against the object's axes: boxes and bowls have thin walls along these, and
all voxels of such a wall would be counted or missed together. Most voxels are decided in blocks, by
the distance of a block's centre from both surfaces; the count is the same as voxel by voxel.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Float64, Int
from torch import Tensor

from geneoh.geometry.distance import MovingSurface, SurfaceDistance, pairwise_distances
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.openings import capped, open_edges, rims
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.geometry.solid import Solid

VOXEL = 0.001  # side of a voxel in metres
BLOCKS = (16, 4)  # sides of the blocks in voxels; each divides the previous one
ASKEW = axis_angle_to_matrix(torch.tensor([0.4, 0.9, -0.6], dtype=torch.float64))
"""Axes of the voxels in the part's frame, as columns."""


@dataclass(frozen=True)
class OpenSolid:
    """A solid with the holes of its surface, where its inside may end without a surface."""

    field: SurfaceDistance
    holes: Float64[Tensor, "H 3"]  # centre of a ball around the rim of each hole, metres
    radius: Float64[Tensor, " H"]

    def margin(self, points: Float64[Tensor, "N 3"]) -> Float64[Tensor, " N"]:
        """Lower bound of each point's distance from the border of the inside, negative inside.

        Seen from outside a ball around its rim, a hole covers less than half of the view, so the
        winding number crosses a half on the surface or within such a ball.
        """
        distance = self.field.query(points).distance
        if not len(self.holes):
            return distance
        apart = pairwise_distances(points, self.holes)
        clear = (apart - self.radius).amin(-1).clamp(min=0)
        return distance.sign() * torch.minimum(distance.abs(), clear)


def with_holes(field: SurfaceDistance) -> OpenSolid:
    """The solid of a mesh with the balls around its holes."""
    surface = field.solid.surface
    edges, hole = rims(surface.faces, open_edges(surface.faces))
    verts, centers, radius = surface.verts.double(), [], []
    for index in range(int(hole.max()) + 1 if len(hole) else 0):
        rim = verts[edges[hole == index, 0]]
        centers.append((rim.amax(0) + rim.amin(0)) / 2)
        radius.append((rim - centers[-1]).norm(dim=-1).max())
    if not centers:
        return OpenSolid(field, verts.new_zeros(0, 3), verts.new_zeros(0))
    return OpenSolid(field, torch.stack(centers), torch.stack(radius))


def intersection_volume(
    verts: Float[Tensor, "T V 3"],
    faces: Int[Tensor, "F 3"],
    surface: MovingSurface,
    voxel: float = VOXEL,
) -> Float[Tensor, " T"]:
    """Volume in cubic metres shared by the hand and the object, summed over the object's parts.

    NaN in frames without a hand. Voxels, with a side of `voxel` metres, are fixed in the part's
    frame, so a rigid motion of the scene changes nothing. A hand open at the wrist is closed; an
    open sheet is the wall that `SurfaceDistance` makes of it.

    Source: GeneOH Diffusion, C.2 (solid intersection volume), which states no voxel size.
    """
    frames = torch.nonzero(verts.isfinite().flatten(1).all(-1))[:, 0].tolist()
    closed, closed_faces = capped(verts, faces)
    volume = torch.full_like(verts[:, 0, 0], torch.nan)
    volume[frames] = 0
    for field, pose_world_part in surface.parts:
        body = with_holes(field)
        hands = pose_world_part.inverse().apply(closed)
        for frame in frames:
            low, high = hands[frame].amin(0).cpu(), hands[frame].amax(0).cpu()
            if bool((low < field.solid.high).all() and (high > field.solid.low).all()):
                hand = with_holes(SurfaceDistance(Mesh(hands[frame].cpu(), closed_faces.cpu())))
                volume[frame] += shared_voxels(hand, body, voxel) * voxel**3
    return volume


def shared_voxels(hand: OpenSolid, part: OpenSolid, voxel: float) -> int:
    """Number of voxels whose centre is inside both solids, both in the part's frame."""
    corners = blocks_around(hand.field.solid, part.field.solid, BLOCKS[0], voxel)
    unsure = torch.ones(len(corners), 2, dtype=torch.bool)
    count = 0
    for size, smaller in zip(BLOCKS, (*BLOCKS[1:], 1), strict=True):
        centers = centers_of(corners, size, voxel)
        half = size * voxel * 3**0.5 / 2
        # minus infinity for a solid that holds the whole of a larger block
        margin = centers.new_full((len(corners), 2), -torch.inf)
        for index, body in enumerate((hand, part)):
            tested = unsure[:, index] & (margin <= half).all(-1)
            margin[tested, index] = body.margin(centers[tested])
        deepest = margin.amax(-1)
        count += int((deepest < -half).sum()) * size**3
        undecided = deepest.abs() <= half
        steps = torch.arange(0, size, smaller)
        inner = torch.cartesian_prod(steps, steps, steps)
        corners = (corners[undecided][:, None] + inner).reshape(-1, 3)
        unsure = (margin[undecided] >= -half).repeat_interleave((size // smaller) ** 3, dim=0)
    centers = centers_of(corners, 1, voxel)
    inside = torch.ones(len(centers), dtype=torch.bool)
    for index, body in enumerate((hand, part)):
        tested = inside & unsure[:, index]
        inside[tested] = body.field.solid.contains(centers[tested])
    return count + int(inside.sum())


def centers_of(corners: Int[Tensor, "N 3"], size: int, voxel: float) -> Float64[Tensor, "N 3"]:
    """Centres of blocks with sides of `size` voxels, in the part's frame."""
    return (corners.double() + size / 2) * voxel @ ASKEW.T


def blocks_around(first: Solid, second: Solid, size: int, voxel: float) -> Int[Tensor, "N 3"]:
    """Lower corners, in voxels, of the blocks that cover the overlap of two solids' boxes."""
    along = [solid.surface.verts.double() @ ASKEW for solid in (first, second)]
    low = torch.stack([verts.amin(0) for verts in along]).amax(0) / (size * voxel)
    high = torch.stack([verts.amax(0) for verts in along]).amin(0) / (size * voxel)
    if bool((low > high).any()):
        return torch.zeros(0, 3, dtype=torch.long)
    ends = zip(low.floor().long().tolist(), high.floor().long().tolist(), strict=True)
    return torch.cartesian_prod(*(torch.arange(a, b + 1) for a, b in ends)) * size
