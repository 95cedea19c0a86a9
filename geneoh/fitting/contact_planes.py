"""Contact planes: tangent planes that push hand vertices out of the object or the other hand."""

from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import where
from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.terms import HandState, Planes
from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.distance import MovingSurface, SurfaceQuery
from geneoh.hand.model import ShapedHand
from geneoh.hand.skeleton import TIP_PARENTS

LONGEST_EXIT = 0.02
"""Greatest distance along a phalanx direction to the surface, metres; no phalanx is thicker."""


class Nearby:
    """Cached surface queries of a hand that moves little from query to query.

    A vertex that cannot be nearer than `reach` (metres) after its motion since its last query is
    not queried again and keeps its old answer. Distances beyond `reach` need not be exact.
    """

    def __init__(self, surface: MovingSurface, reach: float) -> None:
        """Start with an empty cache."""
        self.surface, self.reach = replace(surface, within=reach), reach
        self._known: tuple[Tensor, SurfaceQuery] | None = None

    def query(self, verts: Float[Tensor, "S T V 3"]) -> SurfaceQuery:
        """Signed distance, closest point and normal of each vertex, cached where out of reach."""
        if self._known is None:
            found = self.surface.query(verts)
        else:
            before, found = self._known
            least = found.distance - (verts - before).norm(dim=-1)
            near = least <= self.reach
            # the surface skips points that are not finite
            new = self.surface.query(verts.masked_fill(~near[..., None], torch.nan))
            found = where(near, new, found)
            verts = torch.where(near[..., None], verts, before)
        self._known = verts, found
        return found


def contact_planes(
    state: HandState,
    shaped: ShapedHand,
    config: FitConfig,
    *,
    near: Nearby,
    evidence: Float[Tensor, " T"] | None = None,
) -> Planes:
    """Planes that push vertices out of the object and attract fingertips that nearly touch it.

    Other vertices near the object have zero weight. `evidence` weights each frame, 0 to 1.
    """
    verts = state.verts(shaped)
    bone = shaped.model.skin_weights.argmax(-1)
    found = way_out(verts, bone, near.surface, near.query(verts))
    distance, index = found.distance.topk(config.surface_verts, dim=-1, largest=False)
    inside = (distance < 0).to(distance) / config.depth_std
    touching = torch.zeros_like(distance)
    for joint in TIP_PARENTS:
        apart = torch.where(bone[index] == joint, distance, torch.inf)
        value, at = apart.min(-1, keepdim=True)
        close = ((value > 0) & (value < config.touch)).to(distance)
        touching.scatter_add_(-1, at, close / config.touch_std)
    planes = _planes(found, index, inside + touching)
    if evidence is None:
        return planes
    return replace(planes, weight=planes.weight * evidence[:, None])


def planes_apart(
    state: HandState, shaped: ShapedHand, config: FitConfig, *, other: ChangingSurface
) -> Planes:
    """Planes that correct half of the penetration with the other hand, which corrects the rest."""
    verts = state.verts(shaped)
    bone = shaped.model.skin_weights.argmax(-1)
    # by closest points alone, hands that mirror each other would both move in the same direction
    found = way_out(verts, bone, other, other.query(verts), agreement=1.0)
    found = replace(found, closest=(found.closest + verts) / 2)
    distance, index = found.distance.topk(config.surface_verts, dim=-1, largest=False)
    return _planes(found, index, (distance < 0).to(distance) / config.apart_std)


def _planes(
    found: SurfaceQuery, index: Int[Tensor, "S T K"], weight: Float[Tensor, "S T K"]
) -> Planes:
    """Planes of the vertices `index`, without those that have zero weight in every frame."""
    weight, order = weight.sort(dim=-1, descending=True, stable=True)
    used = slice(max(1, int((weight > 0).sum(-1).max())))
    index = index.gather(-1, order[..., used])
    points = index[..., None].expand(*index.shape, 3)
    closest, normal = found.closest.gather(-2, points), found.normal.gather(-2, points)
    return Planes(index, closest, normal, weight[..., used])


def way_out(
    verts: Float[Tensor, "S T V 3"],
    bone: Int[Tensor, " V"],
    surface: MovingSurface | ChangingSurface,
    found: SurfaceQuery,
    agreement: float = 0.0,
) -> SurfaceQuery:
    """The query `found`, with closest points of deep vertices replaced where they are implausible.

    On a thin object the closest point of a deep vertex may be on the wrong side. The direction of a
    phalanx points from the mean of its inside vertices to that of its outside vertices. Where the
    cosine between normal and direction is less than `agreement`, the vertex gets the point where
    the ray in this direction leaves the surface, if that is within `LONGEST_EXIT`.
    """
    parts = torch.nn.functional.one_hot(bone).to(verts).T
    counted = torch.cat([verts, torch.ones_like(verts[..., :1])], dim=-1)
    inside = (found.distance < 0).to(verts)
    within = parts @ (inside[..., None] * counted)  # sums over the vertices of each phalanx
    outside = parts @ counted - within
    middles = [sums[..., :3] / sums[..., 3:] for sums in (within, outside)]
    ahead = torch.nn.functional.normalize(middles[1] - middles[0], dim=-1)[..., bone, :]
    # a phalanx wholly inside or outside has a nan direction, which compares as not wrong
    wrong = (inside > 0) & ((found.normal * ahead).sum(-1) < agreement)
    if not wrong.any():
        return found
    sample, frame, vert = torch.nonzero(wrong, as_tuple=True)
    start, ahead = verts[sample, frame, vert], ahead[sample, frame, vert]
    reach, normal = surface.exits(frame, start, ahead)
    ok = reach < LONGEST_EXIT
    at = (sample[ok], frame[ok], vert[ok])
    closest, normals = found.closest.clone(), found.normal.clone()
    closest[at] = start[ok] + reach[ok, None] * ahead[ok]
    normals[at] = normal[ok]
    return SurfaceQuery(found.distance, closest, normals)
