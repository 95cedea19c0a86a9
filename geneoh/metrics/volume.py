"""How much of the hand is inside the object: the volume of their intersection, per frame.

The object's space is cut into voxels of a stated size, and a voxel counts when its middle is inside
both. Inside is what the winding number says, so that holes and shells need no repair. The voxels
stand askew to the object's axes: along a wall of a few voxels, which boxes and bowls have along
their axes, all would be counted or missed together. Most are decided in blocks, by how far the
middle of a block is from both surfaces; the count is the same as if each had been asked for.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Float64, Int
from torch import Tensor

from geneoh.geometry.distance import MovingSurface, SurfaceDistance
from geneoh.geometry.mesh import Mesh, capped, rims
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.geometry.solid import Solid

VOXEL = 0.001
"""Side of a voxel in metres."""
BLOCKS = (16, 4)
"""Sides of the blocks in voxels, from coarse to fine; each divides the one before."""
ASKEW = axis_angle_to_matrix(torch.tensor([0.4, 0.9, -0.6], dtype=torch.float64))
"""Axes of the voxels in the part's frame, as columns."""


@dataclass(frozen=True)
class Body:
    """A solid, with the places where its inside may end without a surface."""

    field: SurfaceDistance
    holes: Float64[Tensor, "H 3"]
    """Middle of a ball around the rim of each hole."""
    reach: Float64[Tensor, " H"]
    """Radius of that ball, metres."""

    def margin(self, points: Float64[Tensor, "N 3"]) -> Float64[Tensor, " N"]:
        """How far each point is at least from the border of the inside, metres, negative inside.

        Seen from outside a ball around its rim, a hole takes less than half of the view, so the
        winding number passes a half on the surface or within such a ball.
        """
        distance = self.field.query(points).distance
        if not len(self.holes):
            return distance
        apart = torch.cdist(points, self.holes, compute_mode="donot_use_mm_for_euclid_dist")
        clear = (apart - self.reach).amin(-1).clamp(min=0)
        return distance.sign() * torch.minimum(distance.abs(), clear)


def body_of(field: SurfaceDistance) -> Body:
    """A solid with the balls around its holes."""
    surface = field.solid.surface
    edges, hole = rims(surface.faces)
    verts, middles, reach = surface.verts.double(), [], []
    for index in range(int(hole.max()) + 1 if len(hole) else 0):
        rim = verts[edges[hole == index, 0]]
        middles.append((rim.amax(0) + rim.amin(0)) / 2)
        reach.append((rim - middles[-1]).norm(dim=-1).max())
    if not middles:
        return Body(field, verts.new_zeros(0, 3), verts.new_zeros(0))
    return Body(field, torch.stack(middles), torch.stack(reach))


def intersection_volume(
    verts: Float[Tensor, "T V 3"],
    faces: Int[Tensor, "F 3"],
    surface: MovingSurface,
    voxel: float = VOXEL,
) -> Float[Tensor, " T"]:
    """Volume in cubic metres that the hand shares with the object, summed over the object's parts.

    NaN in frames without a hand. Voxels stand in the part's frame: the answer does not change with
    a rigid motion of the scene. A hand that is open at the wrist is closed there; an open sheet is
    the wall that `SurfaceDistance` makes of it.

    Source: GeneOH Diffusion, C.2 (solid intersection volume), which states no voxel size.

    Args:
        verts: hand, world frame; may be open at the wrist.
        faces: of the hand.
        surface: the object.
        voxel: side in metres.
    """
    frames = torch.nonzero(verts.isfinite().flatten(1).all(-1))[:, 0].tolist()
    closed, closed_faces = capped(verts, faces)
    volume = torch.full_like(verts[:, 0, 0], torch.nan)
    volume[frames] = 0
    for field, pose_world_part in surface.parts:
        body = body_of(field)
        hands = pose_world_part.inverse().apply(closed)
        for frame in frames:
            low, high = hands[frame].amin(0).cpu(), hands[frame].amax(0).cpu()
            if bool((low < field.solid.high).all() and (high > field.solid.low).all()):
                hand = body_of(SurfaceDistance(Mesh(hands[frame].cpu(), closed_faces.cpu())))
                volume[frame] += shared_voxels(hand, body, voxel) * voxel**3
    return volume


def shared_voxels(hand: Body, part: Body, voxel: float) -> int:
    """How many voxels have their middle in both; both in the part's frame."""
    corners = blocks_around(hand.field.solid, part.field.solid, BLOCKS[0], voxel)
    unsure = torch.ones(len(corners), 2, dtype=torch.bool)
    count = 0
    for size, smaller in zip(BLOCKS, (*BLOCKS[1:], 1), strict=True):
        middles = middles_of(corners, size, voxel)
        half = size * voxel * 3**0.5 / 2
        # minus infinity: a body that a larger block was found to be inside of
        margin = middles.new_full((len(corners), 2), -torch.inf)
        for index, body in enumerate((hand, part)):
            asked = unsure[:, index] & (margin <= half).all(-1)
            margin[asked, index] = body.margin(middles[asked])
        deepest = margin.amax(-1)
        count += int((deepest < -half).sum()) * size**3
        undecided = deepest.abs() <= half
        corners = split(corners[undecided], size, smaller)
        unsure = (margin[undecided] >= -half).repeat_interleave((size // smaller) ** 3, dim=0)
    middles = middles_of(corners, 1, voxel)
    inside = torch.ones(len(middles), dtype=torch.bool)
    for index, body in enumerate((hand, part)):
        asked = inside & unsure[:, index]
        inside[asked] = body.field.solid.contains(middles[asked])
    return count + int(inside.sum())


def middles_of(corners: Int[Tensor, "N 3"], size: int, voxel: float) -> Float64[Tensor, "N 3"]:
    """Middles of blocks of some size in voxels, in the part's frame."""
    return (corners.double() + size / 2) * voxel @ ASKEW.T


def blocks_around(first: Solid, second: Solid, size: int, voxel: float) -> Int[Tensor, "N 3"]:
    """Lower corners, in voxels, of the blocks that cover where two solids may meet."""
    along = [solid.surface.verts.double() @ ASKEW for solid in (first, second)]
    low = torch.stack([verts.amin(0) for verts in along]).amax(0) / (size * voxel)
    high = torch.stack([verts.amax(0) for verts in along]).amin(0) / (size * voxel)
    if bool((low > high).any()):
        return torch.zeros(0, 3, dtype=torch.long)
    ends = zip(low.floor().long().tolist(), high.floor().long().tolist(), strict=True)
    return torch.cartesian_prod(*(torch.arange(a, b + 1) for a, b in ends)) * size


def split(corners: Int[Tensor, "N 3"], size: int, smaller: int) -> Int[Tensor, "M 3"]:
    """Lower corners of the smaller blocks that fill some blocks."""
    steps = torch.arange(0, size, smaller)
    return (corners[:, None] + torch.cartesian_prod(steps, steps, steps)).reshape(-1, 3)
