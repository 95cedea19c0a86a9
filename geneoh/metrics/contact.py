"""Hand-object interaction metrics: penetration, contact, and motion of hand and object together.

Distances are those of hand vertices to the object (`geometry.distance.MovingSurface`), signed, in
metres, negative inside. Definitions follow GeneOH Diffusion, C.2, where it gives one, but with true
distances to the triangles in place of nearest vertices: do not compare with the paper's numbers.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.distance import MovingSurface, SurfaceQuery, pairwise_distances
from geneoh.geometry.rigid import Rigid

TOUCH = 0.005  # metres within which a hand point touches: skin is soft, and meshes are coarse
CONTACT_MAP = 0.002  # distance threshold of the paper's contact map, metres
FINGERTIP_RADIUS = 0.015  # metres around a tip keypoint in which vertices belong to that fingertip
CONSISTENCY_DECAY = 100.0
"""Decay of a hand point's expected share in the object's motion with distance, 1/m (paper, C.2)."""
MOVING = 0.0003  # metres a frame from which an object counts as moving (the released code's mask)


def penetration_depth(distance: Float[Tensor, "*B T V"]) -> Float[Tensor, "*B T"]:
    """Depth of the deepest hand vertex of each frame in metres, zero when none is inside.

    Source: C.2, per-vertex maximum penetration depth; the paper averages it over frames.
    """
    return (-distance).amax(-1).clamp(min=0)


def depth_between(one: ChangingSurface, other: ChangingSurface) -> Float[Tensor, " T"]:
    """Largest penetration depth of two hands in each other in each frame, metres.

    Zero where their skins only touch or are apart.
    """
    inside = [a.query(b.verts).distance for a, b in ((one, other), (other, one))]
    return penetration_depth(torch.cat(inside, dim=-1))


def in_contact(distance: Float[Tensor, "*B T V"]) -> Bool[Tensor, "*B T"]:
    """Whether any hand vertex of a frame is inside the object or at most 5 mm off it."""
    return distance.amin(-1) <= TOUCH


def tips_in_contact(
    distance: Float[Tensor, "*B T V"],
    verts: Float[Tensor, "*B T V 3"],
    tips: Float[Tensor, "*B T 5 3"],
) -> Bool[Tensor, "*B T 5"]:
    """Whether each fingertip, the vertices within 15 mm of its keypoint, touches the object."""
    of_tip = pairwise_distances(tips, verts) <= FINGERTIP_RADIUS
    return (of_tip & (distance <= TOUCH)[..., None, :]).any(-1)


@dataclass(frozen=True)
class ContactAgreement:
    """Agreement of a contact map with the true one, 0 to 1; NaN where a ratio is undefined."""

    iou: Float[Tensor, "*B"]  # intersection over union
    precision: Float[Tensor, "*B"]  # share of the found contact that is true
    recall: Float[Tensor, "*B"]  # share of the true contact that is found
    f_score: Float[Tensor, "*B"]  # harmonic mean of precision and recall


def contact_agreement(
    contact: Bool[Tensor, "*B T P"], truth: Bool[Tensor, "*#B T P"]
) -> ContactAgreement:
    """Agreement of two contact maps, of any kind of points, over all points and frames together."""
    both = (contact & truth).sum((-2, -1)).double()
    found, true = (each.sum((-2, -1)).double() for each in (contact, truth))
    ratios = both / (found + true - both), both / found, both / true, 2 * both / (found + true)
    return ContactAgreement(*(ratio.float() for ratio in ratios))


def contact_iou(
    distance: Float[Tensor, "*B T V"],
    truth: Float[Tensor, "*#B T V"],
    threshold: float = CONTACT_MAP,
) -> Float[Tensor, "*B"]:
    """Intersection over union of two contact maps over all frames, 0 to 1; NaN without contact.

    A hand vertex is in contact when it is at most 2 mm from the surface, on either side. The
    paper's map is of object points by TOCH's rays, as in `correspondence.object_contact`.
    """
    return contact_agreement(distance.abs() <= threshold, truth.abs() <= threshold).iou


def proximity_error(
    distance: Float[Tensor, "*B T V"], truth: Float[Tensor, "*#B T V"]
) -> Float[Tensor, "*B T"]:
    """Mean difference of the vertices' unsigned distances to the object, metres, per frame.

    Source: C.2, proximity error, with distances to the surface in place of object points.
    """
    return (distance.abs() - truth.abs()).abs().mean(-1)


def motion_consistency(
    verts: Float[Tensor, "T V 3"], query: SurfaceQuery, surface: MovingSurface
) -> Float[Tensor, " T-1"]:
    """Hand-object motion consistency of each frame in square metres; NaN where the object rests.

    ||exp(-100 d) dh - do||^2 for the nearest pair of hand and object point (h, o) at distance d; dh
    and do are their steps to the next frame, where o moves with the object's part that it lies on.
    Zero for a hand that carries what it touches. `query` is `surface.query(verts)`, world frame.

    Source: C.2, hand-object motion consistency.
    """
    gap, nearest = query.distance.abs().min(-1)
    pick = nearest[:, None, None].expand(-1, 1, 3)
    touched = query.closest.gather(1, pick)[:, 0]
    part = surface.part_at(touched[:, None])[:-1, 0]
    frames = torch.arange(len(part), device=verts.device)
    move = _part_motion(surface, frames, part)
    step = move.apply(touched[:-1, None])[:, 0] - touched[:-1]
    hand_step = (verts[1:] - verts[:-1]).gather(1, pick[:-1])[:, 0]
    miss = (torch.exp(-CONSISTENCY_DECAY * gap[:-1, None]) * hand_step - step).square().sum(-1)
    return torch.where(step.norm(dim=-1) > MOVING, miss, torch.nan)


def _part_motion(
    surface: MovingSurface, frame: Int[Tensor, "*#N"], part: Int[Tensor, "*#N"]
) -> Rigid:
    """The rigid motion of object parts from each frame to the next one, world frame."""
    return surface.pose(frame + 1, part).compose(surface.pose(frame, part).inverse())


def fingertip_slip(
    verts: Float[Tensor, "T V 3"],
    query: SurfaceQuery,
    tips: Float[Tensor, "T 5 3"],
    surface: MovingSurface,
    fps: float,
) -> Float[Tensor, " T-1"]:
    """Speed in metres per second at which touching fingertips slide over the object, per frame.

    Each fingertip is represented by its vertex nearest to the object. It counts when that vertex is
    at most 5 mm from the object in this frame and the next; its slip is the vertex's motion along
    the surface in the frame of the touched part. Mean over the fingertips that count, NaN without
    any. The counterpart of foot skate: zero for a finger that lifts off, presses, or holds still.
    `query` is `surface.query(verts)`, world frame; `tips` are the keypoints of the fingertips.
    """
    of_tip = pairwise_distances(tips, verts) <= FINGERTIP_RADIUS
    gap = torch.where(of_tip, query.distance[:, None], torch.inf)
    nearest, pick = gap[:-1].min(-1)
    frame = torch.arange(len(pick), device=verts.device)[:, None]
    stays = (nearest <= TOUCH) & (query.distance[frame + 1, pick] <= TOUCH)
    now, later = verts[frame, pick], verts[frame + 1, pick]
    part = surface.at(slice(-1)).part_at(query.closest[frame, pick])
    move = _part_motion(surface, frame, part)
    # where the vertex would be if it moved with the part; `apply` takes sets of points
    carried = move.apply(now[..., None, :])[..., 0, :]
    turned = (move.rotation @ query.normal[frame, pick][..., None])[..., 0]
    moved = later - carried
    along = moved - (moved * turned).sum(-1, keepdim=True) * turned
    return torch.nanmean(torch.where(stays, along.norm(dim=-1), torch.nan), dim=-1) * fps
