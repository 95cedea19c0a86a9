"""One frame as a picture: opaque hands, and an object that is see-through where it hides them."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import gaussian_filter

from geneoh.choices import Colouring
from geneoh.viz.camera import Camera
from geneoh.viz.look import BACKGROUND
from geneoh.viz.raster import Raster, at_pixels, rasterise
from geneoh.viz.scene import DrawnSurface, Scene, Version
from geneoh.viz.surface import vertex_normals

Picture = UInt8[np.ndarray, "H W 3"]

SUPERSAMPLING = 2  # supersampling: drawn pixels per side of a pixel, against jagged edges
OVERLAY = 0.28  # opacity of the object over a hand behind its surface
OVERLAY_END = 0.12  # position on the ramp from which a hand is drawn without the overlay
LIGHTS = (((-0.45, 0.65, 0.62), 0.62), ((0.75, 0.1, 0.4), 0.22), ((0.1, -0.8, 0.3), 0.10))
"""Direction in the camera's frame and strength of each light."""
AMBIENT = 0.42
SHINE = 0.10
EDGE_SHADING = 0.5  # largest darkening of the far side of a depth edge, 0 to 1
EDGE_WIDTH = 0.014  # standard deviation of the blur of depth, share of the picture's height
EDGE_TRUNCATE = 2.5  # standard deviations at which the kernel of the blur ends
NEAR_RADIUS = 0.13  # camera radius of a picture of one hand, metres
EDGE_DEPTH = 0.02  # difference in depth at which the darkening is largest, metres


@dataclass(frozen=True)
class _Layer:
    """A drawn surface: lit colours and positions on the colour ramp of its N covered pixels."""

    raster: Raster
    colours: Float[np.ndarray, "N 3"]
    position: Float[np.ndarray, " N"]


def draw(
    scene: Scene,
    frame: int,
    camera: Camera,
    side: int,
    colouring: Colouring = "penetration",
    versions: Iterable[Version] | None = None,
) -> list[Picture]:
    """A picture of each version, `side` pixels square; the object is rasterised once for all.

    The versions are by default all of the scene.
    """
    drawn = (side * SUPERSAMPLING, side * SUPERSAMPLING)
    behind = _layers(scene.drawn_object(frame), camera, drawn)
    pictures = []
    for version in scene.versions if versions is None else versions:
        layers = behind + _layers(version.drawn(frame, colouring), camera, drawn)
        pictures.append(_reduced(_shaded(*_stacked(layers, drawn), camera)))
    return pictures


def hands_from_near(
    scene: Scene, version: Version, frame: int, camera: Camera, side: int, colouring: Colouring
) -> Iterator[Picture]:
    """A square picture of each hand that a version has in this frame, seen from the same direction.

    Each is `side` pixels wide; the right hand comes first.
    """
    for hand in sorted(version.hands, key=lambda hand: hand.side, reverse=True):
        if bool(hand.valid[frame]):
            near = Camera(camera.axes, hand.joints[frame].mean(0).numpy(), NEAR_RADIUS)
            yield from draw(scene, frame, near, side, colouring, (version,))


def _layers(surface: DrawnSurface | None, camera: Camera, size: tuple[int, int]) -> list[_Layer]:
    """The rasterised surface with lighting per vertex, in a list; an empty list for None.

    Back faces are lit like front faces.
    """
    if surface is None:
        return []
    screen = camera.project(surface.verts, size)
    raster = rasterise(screen, surface.faces, size)
    normal = vertex_normals(surface.verts, surface.faces) @ camera.axes.T.astype(np.float32)
    normal = np.where(normal[:, 2:] < 0, -normal, normal)
    light = np.full(len(normal), AMBIENT, dtype=np.float32)
    for towards, strength in LIGHTS:
        light += strength * np.clip(normal @ _unit(towards), 0, None)
    half = _unit(_unit(LIGHTS[0][0]) + np.array([0, 0, 1], dtype=np.float32))
    shine = SHINE * np.clip(normal @ half, 0, 1) ** 24
    shown = np.column_stack([surface.colours * light[:, None] + shine[:, None], surface.position])
    values = at_pixels(raster, screen, surface.faces, shown.astype(np.float32))
    return [_Layer(raster, values[:, :3], values[:, 3])]


def _unit(direction: object) -> Float[np.ndarray, " 3"]:
    vector = np.asarray(direction, dtype=np.float32)
    return vector / np.linalg.norm(vector)


def _stacked(
    layers: list[_Layer], size: tuple[int, int]
) -> tuple[Float[np.ndarray, "H W 3"], Float[np.ndarray, "H W"]]:
    """Colours of all layers together, and 1 / depth of the nearest surface in each pixel.

    Where an earlier layer is nearer than a later one, it becomes a transparent overlay on it.
    """
    width, height = size
    picture = np.empty((height * width, 3), dtype=np.float32)
    picture[:] = BACKGROUND
    nearest = np.zeros(height * width, dtype=np.float32)
    for layer in layers:
        at = np.flatnonzero(layer.raster.covered)
        nearness, before = layer.raster.nearness.reshape(-1)[at], nearest[at]
        overlay = OVERLAY * (1 - layer.position / OVERLAY_END).clip(0, 1) * (nearness < before)
        picture[at] += (1 - overlay)[:, None] * (layer.colours - picture[at])
        nearest[at] = np.maximum(nearness, before)
    return picture.reshape(height, width, 3), nearest.reshape(height, width)


def _shaded(
    picture: Float[np.ndarray, "H W 3"], nearness: Float[np.ndarray, "H W"], camera: Camera
) -> Float[np.ndarray, "H W 3"]:
    """The picture, darkened behind nearer edges, so that depth can be read.

    Source: Luft, Colditz and Deussen, Image Enhancement by Unsharp Masking the Depth Buffer, 2006.
    """
    shown = nearness > 0
    distance = float(np.linalg.norm(camera.eye - camera.target))
    # metres from the target towards the eye; the background counts as just behind everything
    towards = np.where(shown, distance - 1 / np.maximum(nearness, 1e-6), -camera.radius)
    towards = towards.astype(np.float32)
    # half the resolution is enough for a blur this wide
    coarse = towards[::2, ::2]
    soft = gaussian_filter(coarse, EDGE_WIDTH * len(picture) / 2, truncate=EDGE_TRUNCATE)
    soft = soft.repeat(2, 0).repeat(2, 1)[: len(picture), : picture.shape[1]]
    dark = EDGE_SHADING * ((soft - towards) / EDGE_DEPTH).clip(0, 1) * shown
    return picture * (1 - dark)[..., None]


def _reduced(picture: Float[np.ndarray, "drawn_H drawn_W 3"]) -> Picture:
    """The mean of each block of `SUPERSAMPLING` by `SUPERSAMPLING` pixels, as bytes."""
    height, width = picture.shape[0] // SUPERSAMPLING, picture.shape[1] // SUPERSAMPLING
    blocks = picture.reshape(height, SUPERSAMPLING, width, SUPERSAMPLING, 3)
    # sums of slices: several times faster than a mean over two axes
    total = np.zeros((height, width, 3), dtype=np.float32)
    for row, column in np.ndindex(SUPERSAMPLING, SUPERSAMPLING):
        total += blocks[:, row, :, column]
    return ((total / SUPERSAMPLING**2).clip(0, 1) * 255 + 0.5).astype(np.uint8)
