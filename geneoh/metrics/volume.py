"""How much of the hand is inside the object: the volume of their intersection, per frame."""

from dataclasses import dataclass
from typing import Literal

import manifold3d
import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.solid import Solid, build_solid

VOXEL = 0.002
"""Side of a voxel in metres: 0.3 % off the exact volume on a hand around a torus."""


@dataclass(frozen=True)
class IntersectionVolume:
    """Volume of hand and object together, and how it was found."""

    volume: Float[Tensor, " T"]
    """Cubic metres; NaN in frames without a hand."""
    method: Literal["exact", "voxels"]
    voxel: float | None
    """Side of a voxel in metres; None for the exact method."""


def intersection_volume(
    verts: Float[Tensor, "T V 3"],
    faces: Int[Tensor, "F 3"],
    fields: tuple[SurfaceDistance, ...],
    rotation: Float[Tensor, "T Q 3 3"],
    translation: Float[Tensor, "T Q 3"],
    voxel: float = VOXEL,
) -> IntersectionVolume:
    """Volume that the hand shares with the object, summed over the object's parts.

    Exact, by a boolean of the meshes, when the hand and all parts are manifold without an opening;
    else by filled voxels, a voxel counting when its middle is inside both by winding number, so
    that open hands and meshes with holes work. Voxels stand in the part's frame: the answer does
    not change with a rigid motion of the scene.

    Source: GeneOH Diffusion, C.2 (solid intersection volume), which states no voxel size.

    Args:
        verts: hand, world frame; may be open at the wrist.
        faces: of the hand.
        fields: one per part.
        rotation: part to world.
        translation: part to world, metres.
        voxel: side in metres, for the second way.
    """
    frames = torch.nonzero(verts.isfinite().flatten(1).all(-1))[:, 0].tolist()
    bodies = [manifold_of(field.solid.surface) for field in fields]
    closed = [body for body in bodies if body is not None]
    hand_closed = bool(frames) and manifold_of(Mesh(verts[frames[0]], faces)) is not None
    exact = hand_closed and len(closed) == len(fields)
    volume = torch.full_like(verts[:, 0, 0], torch.nan)
    volume[frames] = 0
    for part, field in enumerate(fields):
        pose_part_world = Rigid(rotation[:, part], translation[:, part]).inverse()
        hands = pose_part_world.apply(verts)
        for frame in frames:
            hand = Mesh(hands[frame], faces)
            volume[frame] += (
                shared(hand, closed[part]) if exact else shared_voxels(hand, field.solid, voxel)
            )
    return IntersectionVolume(volume, "exact" if exact else "voxels", None if exact else voxel)


def manifold_of(mesh: Mesh) -> manifold3d.Manifold | None:
    """The mesh as manifold3d takes it, or None when it is not manifold."""
    body = manifold3d.Manifold(
        manifold3d.Mesh(
            np.ascontiguousarray(mesh.verts.detach().cpu().numpy(), dtype=np.float32),
            np.ascontiguousarray(mesh.faces.cpu().numpy(), dtype=np.uint32),
        )
    )
    return body if body.status() == manifold3d.Error.NoError else None


def shared(hand: Mesh, body: manifold3d.Manifold) -> float:
    """Volume of the boolean intersection; both in one frame."""
    manifold = manifold_of(hand)
    assert manifold is not None, "one topology in all frames, and it was manifold in the first"
    return (manifold ^ body).volume()


def shared_voxels(hand: Mesh, part: Solid, voxel: float) -> float:
    """Volume of the voxels whose middle is in both; both in the part's frame."""
    verts = hand.verts.detach().cpu().double()
    low = torch.maximum(verts.amin(0), part.low)
    high = torch.minimum(verts.amax(0), part.high)
    if bool((low >= high).any()):
        return 0.0
    axes = [
        (torch.arange(int(a // voxel), int(b // voxel) + 1) + 0.5) * voxel
        for a, b in zip(low.tolist(), high.tolist(), strict=True)
    ]
    middles = torch.cartesian_prod(*axes)
    middles = middles[part.contains(middles)]
    return int(build_solid(hand, walls=False).contains(middles).sum()) * voxel**3
