"""Skin that goes through thin walls, which no depth shows: nothing is deeper than half a wall."""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

NEAR = 0.005
"""Distance in metres from the wall within which ends of an edge that goes through it are."""
OPPOSITE = -0.5
"""Cosine between the outward normals on both sides of a wall, at most."""
GRAZED = 5
"""Edges in a frame that may reach over a rim, a corner or a wire without going through a wall."""


def goes_through(
    verts: Float[Tensor, "*B V 3"],
    distance: Float[Tensor, "*B V"],
    normal: Float[Tensor, "*B V 3"],
    edges: Int[Tensor, "E 2"],
) -> Bool[Tensor, "*B"]:
    """Whether the skin of a hand goes in at one side of a wall and out at the opposite one.

    An edge does that whose ends are outside, but each beyond the surface that is nearest to the
    other one. Walls thicker than the edges are long, most of them 7 mm, are not told.

    Args:
        verts: of the skin.
        distance: signed distance of each to the object, metres, exact up to `NEAR`.
        normal: its gradient.
        edges: of the skin.
    """
    start, end = edges.unbind(-1)
    step = verts[..., end, :] - verts[..., start, :]
    one, other = distance[..., start], distance[..., end]
    ahead, behind = normal[..., start, :], normal[..., end, :]
    outside = (torch.minimum(one, other) > 0) & (torch.maximum(one, other) < NEAR)
    beyond = ((step * ahead).sum(-1) < -one) & ((step * behind).sum(-1) > other)
    through = outside & beyond & ((ahead * behind).sum(-1) < OPPOSITE)
    return through.sum(-1) > GRAZED
