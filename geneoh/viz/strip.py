"""Pictures for paper and screen: a strip of frames, before above after, captions and a scale."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float
from PIL import Image, ImageDraw, ImageFont

from geneoh.choices import Colouring
from geneoh.errors import InputError
from geneoh.files.atomic import write_whole
from geneoh.viz.camera import cameras
from geneoh.viz.colours import SCALES, Scale
from geneoh.viz.picture import Picture, draw
from geneoh.viz.scene import Scene, Take

PAPER = (251, 251, 250)
INK, FAINT = (28, 32, 38), (110, 116, 124)
UP = np.array([0.0, 0.0, 1.0])
"""Up in the picture, where the caller does not say: most recordings have z up."""
STRIP_FRAMES = 5
CELL = 260
"""Side of one picture in a strip, pixels."""
HEAD, NOTE, FOOT = 30, 24, 40
"""Heights of a row's title, of the words below a picture, and of the scale below all, pixels."""
GAP = 10
"""Between two pictures, pixels."""


def filmstrip(
    scene: Scene,
    *,
    frames: list[int] | None = None,
    colouring: Colouring = "penetration",
    cell: int = CELL,
    up: Float[np.ndarray, " 3"] = UP,
    on_picture: Callable[[int, int], None] | None = None,
) -> Picture:
    """A row of frames for each take, seen from one direction, with what was measured below each.

    Args:
        scene: what to show.
        frames: which; evenly spread ones when left out.
        colouring: what the hands' colours tell.
        cell: side of one picture in pixels.
        up: the direction in the world that is up in the pictures.
        on_picture: called with the pictures done and in all.
    """
    chosen = spread_frames(scene, STRIP_FRAMES) if frames is None else frames
    refuse_frames(scene, chosen)
    seen = cameras(scene, up)
    row = HEAD + cell + NOTE
    width = (cell + GAP) * len(chosen) - GAP
    height = row * len(scene.takes) + (FOOT if colouring != "plain" else 0)
    sheet = Image.new("RGB", (width, height), PAPER)
    pen = ImageDraw.Draw(sheet)
    for index, take in enumerate(scene.takes):
        pen.text((12, index * row + 8), take.title, INK, font(16))
    for column, frame in enumerate(chosen):
        pictures = draw(scene, scene.takes, frame, seen[frame], (cell, cell), colouring=colouring)
        for index, (take, picture) in enumerate(zip(scene.takes, pictures, strict=True)):
            corner = (column * (cell + GAP), index * row + HEAD)
            sheet.paste(Image.fromarray(picture), corner)
            words = caption(scene, take, frame)
            pen.text((corner[0] + 12, corner[1] + cell + 2), words, FAINT, font(13))
        if on_picture is not None:
            on_picture(column + 1, len(chosen))
    if colouring != "plain":
        draw_scale(sheet, SCALES[colouring], (12, height - FOOT + 8))
    return np.asarray(sheet)


def spread_frames(scene: Scene, count: int) -> list[int]:
    """Frames spread evenly over the clip, the middles of equal shares."""
    count = min(count, scene.frames)
    return [int((i + 0.5) * scene.frames / count) for i in range(count)]


def refuse_frames(scene: Scene, frames: list[int]) -> None:
    """Refuse frames that the clip does not have."""
    if wrong := [frame for frame in frames if not 0 <= frame < scene.frames]:
        raise InputError(
            f"frames must be from 0 to {scene.frames - 1}, got {', '.join(map(str, wrong))}; "
            "leave them out or name others"
        )


def caption(scene: Scene, take: Take, frame: int) -> str:
    """When it is, and how deep the hands are in the object."""
    depth = max((float(hand.depth[frame]) for hand in take.hands), default=0.0)
    told = f"{1000 * depth:.1f} mm deep" if depth > 0 else "not inside"
    return f"{frame / scene.fps:.1f} s   {told}"


def draw_scale(
    sheet: Image.Image, scale: Scale, corner: tuple[int, int], ink: tuple[int, int, int] = INK
) -> None:
    """A ramp with its name and the values at its ends."""
    pen, (left, top) = ImageDraw.Draw(sheet), corner
    write = font(13)
    pen.text((left, top), f"{scale.title}   {scale.ends[0]}", ink, write)
    start = left + int(pen.textlength(f"{scale.title}   {scale.ends[0]}", write)) + 8
    colours = scale.colours(np.linspace(0, 1, 120, dtype=np.float32))
    bar = np.broadcast_to((colours * 255).astype(np.uint8), (12, 120, 3))
    sheet.paste(Image.fromarray(np.ascontiguousarray(bar)), (start, top + 3))
    pen.text((start + 128, top), scale.ends[1], ink, write)


def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """The font that comes with Pillow: the same pictures everywhere."""
    return ImageFont.load_default(size)


def save_picture(picture: Picture, path: Path) -> None:
    """Write a PNG in one step."""
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, format="PNG", optimize=True)
    write_whole(path, stream.getvalue())
