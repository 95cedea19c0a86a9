"""One frame as a picture: solid hands, an object that is looked through where it hides them."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8
from scipy.ndimage import gaussian_filter

from geneoh.geometry.mesh import Mesh
from geneoh.viz.camera import Camera
from geneoh.viz.colours import OBJECT, Colouring, vertex_colours
from geneoh.viz.raster import Raster, at_pixels, rasterise
from geneoh.viz.scene import Scene, Take

Picture = UInt8[np.ndarray, "H W 3"]

PAPER = (0.985, 0.985, 0.98)
VEIL = 0.28
"""How much of the object's colour lies over a hand behind its surface."""
LIGHTS = (((-0.45, 0.65, 0.62), 0.62), ((0.75, 0.1, 0.4), 0.22), ((0.1, -0.8, 0.3), 0.10))
"""Direction in the camera's frame and strength of each light."""
AMBIENT = 0.34
SHINE = 0.10
CREASE = 0.5
"""How dark the far side of a step in depth becomes, at most."""
CREASE_REACH = 0.014
"""How far that darkness reaches, as a share of the picture's height."""
CREASE_DEPTH = 0.02
"""Step in depth, metres, that makes it as dark as it gets."""


@dataclass(frozen=True)
class Body:
    """One surface to draw."""

    verts: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    colours: Float[np.ndarray, "V 3"]


@dataclass(frozen=True)
class _Layer:
    """A drawn surface: lit colours of the covered pixels."""

    raster: Raster
    colours: Float[np.ndarray, "H W 3"]


def draw(
    scene: Scene,
    take: Take,
    frame: int,
    camera: Camera,
    size: tuple[int, int],
    *,
    colouring: Colouring = "penetration",
    smooth: int = 2,
) -> Picture:
    """The picture of one take in one frame.

    Args:
        scene: for the object.
        take: whose hands.
        frame: which.
        camera: from where.
        size: width and height in pixels.
        colouring: what the hands' colours tell.
        smooth: pixels drawn per side of a pixel shown, against jagged edges.
    """
    fine = (size[0] * smooth, size[1] * smooth)
    layers = [
        None if body is None else _lit(body, camera, fine)
        for body in (hands_body(take, frame, colouring), object_body(scene, frame))
    ]
    picture = _shaded(_stacked(layers[0], layers[1], fine), camera)
    blocks = picture.reshape(size[1], smooth, size[0], smooth, 3).mean((1, 3))
    return (blocks.clip(0, 1) * 255 + 0.5).astype(np.uint8)


def hands_body(take: Take, frame: int, colouring: Colouring) -> Body | None:
    """All hands that are there in a frame as one surface."""
    bodies = []
    for hand in take.hands:
        if bool(hand.valid[frame]):
            spread = None if hand.spread is None else hand.spread[frame]
            colours = vertex_colours(colouring, hand.distance[frame], spread)
            bodies.append(Body(hand.verts[frame].numpy(), hand.model.faces.numpy(), colours))
    return joined(bodies)


def object_body(scene: Scene, frame: int) -> Body | None:
    """All parts of the object as one surface."""
    bodies = []
    for part, mesh in enumerate(scene.object.meshes):
        verts = scene.object_verts(part, frame).numpy()
        colours = np.broadcast_to(np.float32(OBJECT), verts.shape)
        bodies.append(Body(verts, mesh.faces.numpy(), colours))
    return joined(bodies)


def hand_body(mesh: Mesh, colour: tuple[float, float, float]) -> Body:
    """A mesh of one colour, for pictures of a hand alone."""
    verts = mesh.verts.numpy()
    return Body(verts, mesh.faces.numpy(), np.broadcast_to(np.float32(colour), verts.shape))


def joined(bodies: list[Body]) -> Body | None:
    """One surface of many; None of none."""
    if not bodies:
        return None
    starts = np.cumsum([0] + [len(body.verts) for body in bodies[:-1]])
    return Body(
        np.concatenate([body.verts for body in bodies]),
        np.concatenate([body.faces + start for body, start in zip(bodies, starts, strict=True)]),
        np.concatenate([body.colours for body in bodies]),
    )


def draw_body(body: Body, camera: Camera, size: tuple[int, int], *, smooth: int = 2) -> Picture:
    """The picture of one surface alone."""
    fine = (size[0] * smooth, size[1] * smooth)
    picture = _shaded(_stacked(_lit(body, camera, fine), None, fine), camera)
    blocks = picture.reshape(size[1], smooth, size[0], smooth, 3).mean((1, 3))
    return (blocks.clip(0, 1) * 255 + 0.5).astype(np.uint8)


def _lit(body: Body, camera: Camera, size: tuple[int, int]) -> _Layer:
    """The surface drawn, lit at its vertices; one that faces away is lit as if turned around."""
    screen = camera.project(body.verts, size)
    raster = rasterise(screen, body.faces, size)
    normal = (vertex_normals(body) @ camera.axes.T).astype(np.float32)
    normal = np.where(normal[:, 2:] < 0, -normal, normal)
    light = np.full(len(normal), AMBIENT, dtype=np.float32)
    for towards, strength in LIGHTS:
        light += strength * np.clip(normal @ _unit(towards), 0, None)
    half = _unit(_unit(LIGHTS[0][0]) + np.float32([0, 0, 1]))
    shine = SHINE * np.clip(normal @ half, 0, 1) ** 24
    shown = body.colours * light[:, None] + shine[:, None]
    colours = np.zeros((*raster.face.shape, 3), dtype=np.float32)
    colours[raster.covered] = at_pixels(raster, screen, body.faces, shown)
    return _Layer(raster, colours)


def _unit(direction: object) -> Float[np.ndarray, " 3"]:
    vector = np.asarray(direction, dtype=np.float32)
    return vector / np.linalg.norm(vector)


def vertex_normals(body: Body) -> Float[np.ndarray, "V 3"]:
    """Unit normals averaged over the faces around each vertex by area."""
    a, b, c = (body.verts[body.faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    normals = np.stack(
        [
            sum(np.bincount(body.faces[:, i], across[:, axis], len(body.verts)) for i in range(3))
            for axis in range(3)
        ],
        -1,
    )
    return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)


def _stacked(
    hands: _Layer | None, thing: _Layer | None, size: tuple[int, int]
) -> tuple[Float[np.ndarray, "H W 3"], Float[np.ndarray, "H W"]]:
    """Colours, and the nearness of what gives the picture its depth."""
    width, height = size
    picture = np.broadcast_to(np.float32(PAPER), (height, width, 3)).copy()
    nearness = np.zeros((height, width), dtype=np.float32)
    if thing is not None:
        shown = thing.raster.covered
        picture[shown], nearness[shown] = thing.colours[shown], thing.raster.nearness[shown]
    if hands is not None:
        over = hands.raster.covered & (hands.raster.nearness >= nearness)
        under = hands.raster.covered & ~over
        picture[over], nearness[over] = hands.colours[over], hands.raster.nearness[over]
        picture[under] = VEIL * picture[under] + (1 - VEIL) * hands.colours[under]
    return picture, nearness


def _shaded(
    stacked: tuple[Float[np.ndarray, "H W 3"], Float[np.ndarray, "H W"]], camera: Camera
) -> Float[np.ndarray, "H W 3"]:
    """The picture with what lies behind a nearer edge made darker, so that depth is read.

    Source: Luft, Colditz and Deussen, Image Enhancement by Unsharp Masking the Depth Buffer, 2006.
    """
    picture, nearness = stacked
    shown = nearness > 0
    distance = float(np.linalg.norm(camera.eye - camera.target))
    # nearness in metres towards the eye, around the target; the paper counts as just behind it all
    towards = np.where(shown, distance - 1 / np.maximum(nearness, 1e-6), -camera.radius)
    towards = towards.astype(np.float32)
    # what is blurred that much needs no more than every second pixel
    coarse = towards[::2, ::2]
    soft = gaussian_filter(coarse, CREASE_REACH * len(coarse), truncate=2.5)
    soft = soft.repeat(2, 0).repeat(2, 1)[: len(picture), : picture.shape[1]]
    dark = CREASE * ((soft - towards) / CREASE_DEPTH).clip(0, 1) * shown
    return picture * (1 - dark)[..., None]
