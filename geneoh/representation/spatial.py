"""S: hand-object spatial relations around every contact point (paper 3.1 and eq. 8)."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from geneoh.representation.region import ContactRegion


@dataclass(frozen=True)
class SpatialRelations:
    """s_o = ((o - t) R^T, n R^T, {(h - o) R^T}) in the paper's row notation, for K contact
    points."""

    points: Float[Tensor, "*B T K 3"]
    normals: Float[Tensor, "*B T K 3"]
    offsets: Float[Tensor, "*B T K 21 3"]
    """From contact point to keypoint, canonical frame, metres."""


def encode_spatial(
    joints_canon: Float[Tensor, "*B T 21 3"], region: ContactRegion
) -> SpatialRelations:
    """Spatial relations of canonical keypoints."""
    points = region.points_canon
    offsets = joints_canon[..., None, :, :] - points[..., :, None, :]
    return SpatialRelations(points, region.normals_canon, offsets)


def implied_hands(relations: SpatialRelations) -> Float[Tensor, "*B T K 21 3"]:
    """The canonical hand that each contact point alone implies (claim 1 of appendix A.2)."""
    return relations.offsets + relations.points[..., :, None, :]


def decode_spatial(relations: SpatialRelations) -> Float[Tensor, "*B T 21 3"]:
    """Canonical keypoints: the mean of the hands that the contact points imply (eq. 8)."""
    return implied_hands(relations).mean(-3)
