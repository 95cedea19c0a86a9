"""One frame as a picture: solid hands, an object that is looked through where it hides them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import gaussian_filter

from geneoh.choices import Colouring
from geneoh.viz.camera import Camera
from geneoh.viz.colours import OBJECT, on_ramp, ramp_colours
from geneoh.viz.raster import Raster, at_pixels, rasterise
from geneoh.viz.scene import Scene, Take
from geneoh.viz.surface import Body, joined, plain_body, vertex_normals

Picture = UInt8[np.ndarray, "H W 3"]

PAPER = (0.985, 0.985, 0.98)
VEIL = 0.28
"""How much of the object's colour lies over a hand behind its surface."""
TOLD = 0.12
"""Place on the ramp from which no veil lies over what is shown."""
LIGHTS = (((-0.45, 0.65, 0.62), 0.62), ((0.75, 0.1, 0.4), 0.22), ((0.1, -0.8, 0.3), 0.10))
"""Direction in the camera's frame and strength of each light."""
AMBIENT = 0.42
SHINE = 0.10
CREASE = 0.5
"""How dark the far side of a step in depth becomes, at most."""
CREASE_REACH = 0.014
"""How far that darkness reaches, as a share of the picture's height."""
CREASE_WIDTHS = 2.5
"""Standard deviations of that reach that are looked at."""
CREASE_DEPTH = 0.02
"""Step in depth, metres, that makes it as dark as it gets."""


@dataclass(frozen=True)
class _Window:
    """The part of a picture that holds all that is drawn, in pixels as they are drawn."""

    whole: tuple[int, int]
    """Width and height of the picture."""
    corner: tuple[int, int]
    """Left and top."""
    size: tuple[int, int]

    def project(self, points: Float[np.ndarray, "V 3"], camera: Camera) -> Float[np.ndarray, "V 3"]:
        """Points as `Camera.project` gives them, counted from the corner."""
        return camera.project(points, self.whole) - (*self.corner, 0)


@dataclass(frozen=True)
class _Layer:
    """A drawn surface: what its N covered pixels show."""

    raster: Raster
    colours: Float[np.ndarray, "N 3"]
    """Red, green and blue, lit."""
    telling: Float[np.ndarray, " N"]
    """Where on the ramp of what is told, 0 to 1."""


def draw(
    scene: Scene,
    takes: Sequence[Take],
    frame: int,
    camera: Camera,
    size: tuple[int, int],
    *,
    colouring: Colouring = "penetration",
    smooth: int = 2,
) -> list[Picture]:
    """A picture of each take in one frame; the object is the same in all and drawn once.

    Args:
        scene: for the object.
        takes: whose hands.
        frame: which.
        camera: from where.
        size: width and height in pixels.
        colouring: what the hands' colours tell.
        smooth: pixels drawn per side of a pixel shown, against jagged edges.
    """
    thing = object_body(scene, frame)
    hands = [hands_body(take, frame, colouring) for take in takes]
    window = _window([thing, *hands], camera, size, smooth)
    drawn = None if thing is None else _lit(thing, camera, window)
    pictures = []
    for hand in hands:
        layers = [drawn, None if hand is None else _lit(hand, camera, window)]
        inner = _finished([layer for layer in layers if layer is not None], camera, window, smooth)
        picture = np.empty((size[1], size[0], 3), dtype=np.uint8)
        picture[:] = np.multiply(PAPER, 255) + 0.5
        left, top = (edge // smooth for edge in window.corner)
        picture[top : top + len(inner), left : left + inner.shape[1]] = inner
        pictures.append(picture)
    return pictures


def _window(
    bodies: list[Body | None], camera: Camera, size: tuple[int, int], smooth: int
) -> _Window:
    """Around everything, with the room that shading looks at; at least one pixel."""
    whole = (size[0] * smooth, size[1] * smooth)
    screen = np.concatenate([camera.project(body.verts, whole) for body in bodies if body])
    seen = screen[screen[:, 2] > 0, :2]
    room, step = CREASE_WIDTHS * CREASE_REACH * whole[1], 2 * smooth
    edges = []
    for axis in (0, 1):
        low = float(seen[:, axis].min(initial=whole[axis])) - room
        high = float(seen[:, axis].max(initial=0.0)) + room
        first = min(max(0, int(low // step) * step), whole[axis] - smooth)
        edges.append((first, max(first + smooth, min(whole[axis], -int(-high // step) * step))))
    (left, right), (top, bottom) = edges
    return _Window(whole, (left, top), (right - left, bottom - top))


def hands_body(take: Take, frame: int, colouring: Colouring) -> Body | None:
    """All hands that are there in a frame as one surface."""
    bodies = []
    for hand in take.hands:
        if bool(hand.valid[frame]):
            spread = None if hand.spread is None else hand.spread[frame]
            told = on_ramp(colouring, hand.distance[frame], spread).numpy()
            faces = hand.model.faces.numpy()
            bodies.append(
                Body(hand.verts[frame].numpy(), faces, ramp_colours(colouring, told), told)
            )
    return joined(bodies)


def object_body(scene: Scene, frame: int) -> Body | None:
    """All parts of the object as one surface."""
    return joined(
        [
            plain_body(
                scene.part_pose(part, frame).apply(mesh.verts).numpy(), mesh.faces.numpy(), OBJECT
            )
            for part, mesh in enumerate(scene.creased_parts)
        ]
    )


def _lit(body: Body, camera: Camera, window: _Window) -> _Layer:
    """The surface drawn, lit at its vertices; one that faces away is lit as if turned around."""
    screen = window.project(body.verts, camera)
    raster = rasterise(screen, body.faces, window.size)
    normal = (vertex_normals(body.verts, body.faces) @ camera.axes.T).astype(np.float32)
    normal = np.where(normal[:, 2:] < 0, -normal, normal)
    light = np.full(len(normal), AMBIENT, dtype=np.float32)
    for towards, strength in LIGHTS:
        light += strength * np.clip(normal @ _unit(towards), 0, None)
    half = _unit(_unit(LIGHTS[0][0]) + np.array([0, 0, 1], dtype=np.float32))
    shine = SHINE * np.clip(normal @ half, 0, 1) ** 24
    shown = np.column_stack([body.colours * light[:, None] + shine[:, None], body.telling])
    values = at_pixels(raster, screen, body.faces, shown.astype(np.float32))
    return _Layer(raster, values[:, :3], values[:, 3])


def _unit(direction: object) -> Float[np.ndarray, " 3"]:
    vector = np.asarray(direction, dtype=np.float32)
    return vector / np.linalg.norm(vector)


def _finished(layers: list[_Layer], camera: Camera, window: _Window, smooth: int) -> Picture:
    """Layers laid over each other, shaded, and as large as they are shown."""
    picture = _shaded(_stacked(layers, window), camera, window)
    height, width = picture.shape[0] // smooth, picture.shape[1] // smooth
    blocks = picture.reshape(height, smooth, width, smooth, 3)
    # sums of slices: several times faster than a mean over two axes
    total = np.zeros((height, width, 3), dtype=np.float32)
    for row, column in np.ndindex(smooth, smooth):
        total += blocks[:, row, :, column]
    return ((total / smooth**2).clip(0, 1) * 255 + 0.5).astype(np.uint8)


def _stacked(
    layers: list[_Layer], window: _Window
) -> tuple[Float[np.ndarray, "H W 3"], Float[np.ndarray, "H W"]]:
    """Colours, and the nearness of what gives the picture its depth.

    Each layer is seen through those before it, which lie over it as a veil where they are nearer.
    """
    width, height = window.size
    picture = np.empty((height * width, 3), dtype=np.float32)
    picture[:] = PAPER
    nearest = np.zeros(height * width, dtype=np.float32)
    for layer in layers:
        at = np.flatnonzero(layer.raster.covered)
        nearness, before = layer.raster.nearness.reshape(-1)[at], nearest[at]
        veil = VEIL * (1 - layer.telling / TOLD).clip(0, 1) * (nearness < before)
        picture[at] += (1 - veil)[:, None] * (layer.colours - picture[at])
        nearest[at] = np.maximum(nearness, before)
    return picture.reshape(height, width, 3), nearest.reshape(height, width)


def _shaded(
    stacked: tuple[Float[np.ndarray, "H W 3"], Float[np.ndarray, "H W"]],
    camera: Camera,
    window: _Window,
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
    soft = gaussian_filter(coarse, CREASE_REACH * window.whole[1] / 2, truncate=CREASE_WIDTHS)
    soft = soft.repeat(2, 0).repeat(2, 1)[: len(picture), : picture.shape[1]]
    dark = CREASE * ((soft - towards) / CREASE_DEPTH).clip(0, 1) * shown
    return picture * (1 - dark)[..., None]
