"""Pictures that are put together of drawn frames, words and a scale of colours: filmstrips."""

import io

import numpy as np
from PIL import Image, ImageDraw
from PIL.PngImagePlugin import PngInfo

from geneoh.choices import Colouring
from geneoh.errors import InputError
from geneoh.progress import OnStep, steps
from geneoh.sequence.windows import spread_frames
from geneoh.viz.camera import Camera, cameras
from geneoh.viz.fonts import font_of
from geneoh.viz.look import BACKGROUND, SCALES, Look
from geneoh.viz.picture import Picture, draw, hands_from_near
from geneoh.viz.scene import Scene, Version

RGB = tuple[int, int, int]
INK: RGB = (28, 32, 38)
FAINT: RGB = (110, 116, 124)
TITLE_HEIGHT, CAPTION_HEIGHT, SCALE_HEIGHT = 30, 24, 40
"""Heights of a version's title, of the caption below a picture, of the scale below all, pixels."""
RAMP_SIZE = (120, 12)  # width and height of a ramp in pixels
SCALE_LEFT = 12  # pixels from the left edge to the title of a ramp
STRIP_FRAMES = 5
STRIP_GAP = 10  # between two pictures of a filmstrip, pixels
LEAST_COLUMN, MAX_TITLE = 170, 800
"""Pixels: width that the caption of a small picture needs, and largest width of a title."""


class Canvas:
    """A picture to draw on; places are pixels from the upper left corner."""

    def __init__(self, width: int, height: int):
        background = tuple(int(255 * channel + 0.5) for channel in BACKGROUND)
        self._image = Image.new("RGB", (width, height), background)
        self._pen = ImageDraw.Draw(self._image)

    def write(self, text: str, left: int, top: int, *, size: int = 13, colour: RGB = INK) -> None:
        """Write one line of text."""
        self._pen.text((left, top), text, colour, font_of(text, size))

    def paste(self, picture: Picture, left: int, top: int) -> None:
        """Paste a picture with its left upper corner at a place."""
        self._image.paste(Image.fromarray(picture), (left, top))

    def paste_versions(
        self,
        scene: Scene,
        frame: int,
        camera: Camera,
        corners: list[tuple[int, int]],
        colouring: Colouring,
        cell: int,
        size: int = 13,
    ) -> None:
        """One frame of each version at its corner, with the time and the depth below it.

        The hands of a body, which are small, are shown from near between both.
        """
        pictures = draw(scene, frame, camera, cell, colouring)
        near = near_height(scene, cell)
        for version, picture, (left, top) in zip(scene.versions, pictures, corners, strict=True):
            words = f"{frame / scene.fps:.2f} s   {depth_words(scene, version, frame)}"
            self.paste(picture, left, top)
            self.write(words, left + 12, top + cell + near + 2, size=size, colour=FAINT)
            if near:
                hands = hands_from_near(scene, version, frame, camera, near, colouring)
                for place, hand in enumerate(hands):
                    self.paste(hand, left + place * near, top + cell)

    def draw_scale(self, colouring: Colouring, top: int) -> None:
        """The ramp of a colouring between its title and the labels of its ends."""
        scale, (width, height) = SCALES[colouring], RAMP_SIZE
        words = f"{scale.title}   {scale.labels[0]}"
        self.write(words, SCALE_LEFT, top)
        start = SCALE_LEFT + width_of(words) + 8
        colours = scale.colours(np.linspace(0, 1, width, dtype=np.float32))
        ramp = np.broadcast_to((colours * 255).astype(np.uint8), (height, width, 3))
        self.paste(np.ascontiguousarray(ramp), start, top + 3)
        self.write(scale.labels[1], start + width + 8, top)

    def picture(self) -> Picture:
        """The pixels."""
        return np.asarray(self._image)


def near_height(scene: Scene, cell: int) -> int:
    """Side of the pictures of a body's hands from near, an even number of pixels; 0 without one."""
    return cell // 4 * 2 if scene.body is not None else 0


def depth_words(scene: Scene, version: Version, frame: int) -> str:
    """How deep the hands of a version are in the object, or that the frame has no hand; nothing
    without an object, or with one that was never seen."""
    if not bool(version.measures.valid[frame]):
        return "no hand"
    depth = 1000 * float(version.measures.depth[frame])
    if not scene.has_object or depth != depth:
        return ""
    return f"{depth:.1f} mm deep" if depth > 0 else "not inside"


def end_of(words: str, width: int, size: int) -> str:
    """The end of a line of text, with dots before it, where the whole is wider than `width`.

    Names of clips often differ only in their end.
    """
    shown = words
    while words and width_of(shown, size) > width:
        words = words[1:]
        shown = f"...{words}"
    return shown


def width_of(words: str, size: int = 13) -> int:
    """Width of a line of text, in pixels."""
    return int(font_of(words, size).getlength(words)) + 1


def scale_width(colouring: Colouring) -> int:
    """Width of what `Canvas.draw_scale` draws, from the left edge on, in pixels."""
    scale = SCALES[colouring]
    words = f"{scale.title}   {scale.labels[0]}{scale.labels[1]}"
    return 2 * SCALE_LEFT + width_of(words) + RAMP_SIZE[0] + 16


def png_bytes(picture: Picture) -> bytes:
    """The picture as a PNG file."""
    stream, made_by = io.BytesIO(), PngInfo()
    made_by.add_text("Software", "geneoh")
    Image.fromarray(picture).save(stream, format="PNG", optimize=True, pnginfo=made_by)
    return stream.getvalue()


def filmstrip(scene: Scene, look: Look, on_step: OnStep | None = None) -> Picture:
    """A row of frames for each version, all seen from one direction, with measures below each."""
    refuse_frames(scene, look.frames)
    frames = look.frames or spread_frames(scene.frames, STRIP_FRAMES)
    seen, cell = cameras(scene, look.upward), look.cell
    row = TITLE_HEIGHT + cell + near_height(scene, cell) + CAPTION_HEIGHT
    column = max(cell, LEAST_COLUMN if scene.has_object else 0) + STRIP_GAP
    height = row * len(scene.versions)
    scaled = scene.shows(look.colouring)
    widths = [column * len(frames) - STRIP_GAP, scale_width(look.colouring) if scaled else 0]
    widths += [min(24 + width_of(version.title, 16), MAX_TITLE) for version in scene.versions]
    canvas = Canvas(max(widths), height + SCALE_HEIGHT * scaled)
    for index, version in enumerate(scene.versions):
        title = end_of(version.title, max(widths) - 24, 16)
        canvas.write(title, 12, index * row + 8, size=16)
    for index, frame in enumerate(steps(frames, on_step)):
        corners = [(index * column, i * row + TITLE_HEIGHT) for i in range(len(scene.versions))]
        canvas.paste_versions(scene, frame, seen[frame], corners, look.colouring, cell)
    if scaled:
        canvas.draw_scale(look.colouring, height + 8)
    return canvas.picture()


def refuse_frames(scene: Scene, frames: tuple[int, ...]) -> None:
    """`InputError` for frames of a filmstrip that a scene does not have."""
    if wrong := [frame for frame in frames if not 0 <= frame < scene.frames]:
        raise InputError(
            f"frames must be from 0 to {scene.frames - 1}, got {', '.join(map(str, wrong))}; "
            "leave them out or name others"
        )
