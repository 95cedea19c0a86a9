"""The surfaces of one frame as they are drawn: with the colours of what they show."""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Float, Int

from geneoh.choices import Colouring
from geneoh.viz.colours import OBJECT_COLOUR, ramp_colours, ramp_position
from geneoh.viz.scene import Scene, Version


@dataclass(frozen=True)
class DrawnSurface:
    """One surface to draw."""

    verts: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    colours: Float[np.ndarray, "V 3"]
    position: Float[np.ndarray, " V"]
    """Of each vertex on the colour ramp, 0 to 1; the object is never drawn over high positions."""


def hands_surface(version: Version, frame: int, colouring: Colouring) -> DrawnSurface | None:
    """All hands of a frame as one surface; None when there are none."""
    surfaces = []
    for hand in version.hands:
        if bool(hand.valid[frame]):
            spread = None if hand.spread is None else hand.spread[frame]
            position = ramp_position(colouring, hand.distance[frame], spread).numpy()
            colours = ramp_colours(colouring, position)
            verts, faces = hand.verts[frame].numpy(), hand.model.faces.numpy()
            surfaces.append(DrawnSurface(verts, faces, colours, position))
    return joined(surfaces) if surfaces else None


def object_surface(scene: Scene, frame: int) -> DrawnSurface:
    """All parts of the object as one surface of one colour."""
    surfaces = []
    for part, mesh in enumerate(scene.sharp_parts):
        verts = scene.part_pose(part, frame).apply(mesh.verts).numpy()
        colours = np.broadcast_to(np.array(OBJECT_COLOUR, dtype=np.float32), verts.shape)
        position = np.zeros(len(verts), dtype=np.float32)
        surfaces.append(DrawnSurface(verts, mesh.faces.numpy(), colours, position))
    return joined(surfaces)


def joined(surfaces: list[DrawnSurface]) -> DrawnSurface:
    """Several surfaces as one."""
    starts = np.cumsum([0] + [len(surface.verts) for surface in surfaces[:-1]])
    shifted = [
        replace(surface, faces=surface.faces + start)
        for surface, start in zip(surfaces, starts, strict=True)
    ]
    names = [field.name for field in fields(DrawnSurface)]
    return DrawnSurface(*(np.concatenate([getattr(s, name) for s in shifted]) for name in names))
