"""S: hand-object spatial relations around every contact point (paper 3.1 and eq. 8).

SpatialDiff adds noise to the offsets, its network maps noisy offsets to clean ones, and
`decode_spatial` averages the hands that they imply.
"""

from dataclasses import dataclass, replace

from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.representation.region import ContactRegion


@dataclass(frozen=True)
class SpatialRelations(Bundle):
    """s_o = ((o - t) R^T, n R^T, {(h - o) R^T}) in the paper's row notation, K contact points.

    The hand h that each point implies is stored (claim 1 of appendix A.2) instead of the offset
    h - o: the two differ only by the point o, so noise on one is noise on the other.
    """

    points: Float[Tensor, "*B T K 3"]
    """Contact points in the canonical frame, metres; `normals` are unit and outward."""
    normals: Float[Tensor, "*B T K 3"]
    hands: Float[Tensor, "*B T K 21 3"]
    """Keypoints that each contact point implies, canonical frame, metres."""

    @property
    def offsets(self) -> Float[Tensor, "*B T K 21 3"]:
        """From contact point to keypoint."""
        return self.hands - self.points[..., None, :]

    def of_hand(self, joints_canon: Float[Tensor, "*B T 21 3"]) -> "SpatialRelations":
        """Relations of one hand to the same contact points."""
        hands = joints_canon[..., None, :, :].expand(*self.points.shape[:-1], 21, 3)
        return replace(self, hands=hands)

    def turned(self, axes: Float[Tensor, "*B 3 3"]) -> "SpatialRelations":
        """The same relations in other axes: the columns of `axes`, in the canonical frame."""
        axes = axes[..., None, :, :]
        hands = self.hands @ axes[..., None, :, :]
        return SpatialRelations(self.points @ axes, self.normals @ axes, hands)


def encode_spatial(
    joints_canon: Float[Tensor, "*B T 21 3"], region: ContactRegion
) -> SpatialRelations:
    """Spatial relations of canonical keypoints."""
    points = region.points_canon
    hands = joints_canon[..., None, :, :].expand(*points.shape[:-1], 21, 3)
    return SpatialRelations(points, region.normals_canon, hands)


def decode_spatial(relations: SpatialRelations) -> Float[Tensor, "*B T 21 3"]:
    """Canonical keypoints: the mean of the hands that the contact points imply (eq. 8)."""
    return relations.hands.mean(-3)
