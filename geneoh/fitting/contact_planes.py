"""Planes that keep the skin of a hand out of the object where it may touch it."""

from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.terms import HandState, Planes
from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.distance import MovingSurface, SurfaceQuery
from geneoh.hand.model import ShapedHand
from geneoh.hand.skeleton import TIP_PARENTS

LONGEST_EXIT = 0.02
"""Longest way out of the object for a vertex, metres; no phalanx is thicker."""


class Nearby:
    """The surface around a hand that moves little from query to query.

    Vertices that cannot have come nearer than `reach` since they were last asked for, metres, are
    not asked for again: they stay where they were in all that is answered. Nor are those asked for
    exactly that are easily seen to be farther.
    """

    def __init__(self, surface: MovingSurface, reach: float) -> None:
        """No vertex is known yet."""
        self.surface, self.reach = replace(surface, within=reach), reach
        self._known: tuple[Tensor, SurfaceQuery] | None = None

    def query(self, verts: Float[Tensor, "S T V 3"]) -> SurfaceQuery:
        """Distance, closest point and normal of each vertex; those out of reach are older."""
        if self._known is None:
            found = self.surface.query(verts)
        else:
            before, found = self._known
            least = found.distance - (verts - before).norm(dim=-1)
            asked = least <= self.reach
            # a point that is not finite is not looked for
            new = self.surface.query(verts.masked_fill(~asked[..., None], torch.nan))
            found = SurfaceQuery(
                torch.where(asked, new.distance, found.distance),
                torch.where(asked[..., None], new.closest, found.closest),
                torch.where(asked[..., None], new.normal, found.normal),
            )
            verts = torch.where(asked[..., None], verts, before)
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

    Other vertices near the object have no weight. `evidence` is that of `fit_hand`.
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
    """Planes that push vertices half the way out of the other hand, which goes the other half."""
    verts = state.verts(shaped)
    bone = shaped.model.skin_weights.argmax(-1)
    # by the nearest ways hands that mirror each other would go on together
    found = way_out(verts, bone, other, other.query(verts), agreement=1.0)
    found = replace(found, closest=(found.closest + verts) / 2)
    distance, index = found.distance.topk(config.surface_verts, dim=-1, largest=False)
    return _planes(found, index, (distance < 0).to(distance) / config.apart_std)


def _planes(
    found: SurfaceQuery, index: Int[Tensor, "S T K"], weight: Float[Tensor, "S T K"]
) -> Planes:
    """Planes at some vertices; those without a weight are left out, as far as all frames are."""
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
    """Distance to the object, with one direction out of it for each phalanx.

    The nearest side of a thin part may be the wrong one for deep vertices: those get the closest
    point and normal in the direction of their phalanx's outside part instead, where the cosine
    between both ways is less than `agreement`.
    """
    parts = torch.nn.functional.one_hot(bone).to(verts).T
    counted = torch.cat([verts, torch.ones_like(verts[..., :1])], dim=-1)
    inside = (found.distance < 0).to(verts)
    within = parts @ (inside[..., None] * counted)  # sums over the vertices of each phalanx
    outside = parts @ counted - within
    middles = [sums[..., :3] / sums[..., 3:] for sums in (within, outside)]
    ahead = torch.nn.functional.normalize(middles[1] - middles[0], dim=-1)[..., bone, :]
    # the direction of a phalanx that is wholly inside or outside is nan, which is never below 0
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
