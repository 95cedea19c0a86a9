"""Skin that goes through thin walls; penetration depth, at most half a wall, does not show it."""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

NEAR_WALL = 0.005
"""Largest distance in metres from the wall to the ends of an edge that goes through it."""
OPPOSITE_COSINE = -0.5
"""Largest cosine between the outward normals on the two sides of a wall."""
GRAZED_EDGES = 5
"""Edges of a frame that are tolerated: they may pass a rim, a corner or a wire instead."""


def goes_through(
    verts: Float[Tensor, "*B V 3"],
    distance: Float[Tensor, "*B V"],
    normal: Float[Tensor, "*B V 3"],
    edges: Int[Tensor, "E 2"],
) -> Bool[Tensor, "*B"]:
    """Whether the skin of a hand goes in at one side of a wall and out at the opposite side.

    An edge goes through if both ends are outside, but each lies beyond the surface nearest to the
    other end. Walls thicker than an edge is long, mostly 7 mm, are not detected.

    Args:
        verts: vertices of the skin.
        distance: signed distance of each vertex to the object, metres, exact up to `NEAR_WALL`.
        normal: gradient of the distance at each vertex.
        edges: edges of the skin.
    """
    start, end = edges.unbind(-1)
    step = verts[..., end, :] - verts[..., start, :]
    one, other = distance[..., start], distance[..., end]
    ahead, behind = normal[..., start, :], normal[..., end, :]
    outside = (torch.minimum(one, other) > 0) & (torch.maximum(one, other) < NEAR_WALL)
    beyond = ((step * ahead).sum(-1) < -one) & ((step * behind).sum(-1) > other)
    through = outside & beyond & ((ahead * behind).sum(-1) < OPPOSITE_COSINE)
    return through.sum(-1) > GRAZED_EDGES
