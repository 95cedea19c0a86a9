"""A picture that is put together: drawn frames, words and the scale of the colours."""

import io

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from geneoh.choices import Colouring
from geneoh.viz.camera import Camera
from geneoh.viz.colours import BACKGROUND, SCALES
from geneoh.viz.picture import Picture, draw
from geneoh.viz.scene import Scene

RGB = tuple[int, int, int]
INK: RGB = (28, 32, 38)
FAINT: RGB = (110, 116, 124)
TITLE_HEIGHT, CAPTION_HEIGHT, SCALE_HEIGHT = 30, 24, 40
"""Heights of a version's title, of the caption below a picture, of the scale below all, pixels."""
RAMP_SIZE = (120, 12)
"""Width and height of a ramp in pixels."""


class Canvas:
    """A sheet of background colour, drawn on from its left upper corner, in pixels."""

    def __init__(self, width: int, height: int):
        background = tuple(int(255 * channel + 0.5) for channel in BACKGROUND)
        self._image = Image.new("RGB", (width, height), background)
        self._pen = ImageDraw.Draw(self._image)

    def write(self, text: str, left: int, top: int, *, size: int = 13, colour: RGB = INK) -> None:
        """Write one line of text."""
        self._pen.text((left, top), text, colour, _font(size))

    def paste(self, picture: Picture, left: int, top: int) -> None:
        """Put a picture there."""
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
        """One frame of each version at its corner, with the time and the depth below it."""
        pictures = draw(scene, frame, camera, (cell, cell), colouring=colouring)
        for version, picture, (left, top) in zip(scene.versions, pictures, corners, strict=True):
            depth = float(version.measures.depth[frame].nan_to_num())
            words = f"{1000 * depth:.1f} mm deep" if depth > 0 else "not inside"
            words = f"{frame / scene.fps:.1f} s   {words}"
            self.paste(picture, left, top)
            self.write(words, left + 12, top + cell + 2, size=size, colour=FAINT)

    def draw_scale(self, colouring: Colouring, left: int, top: int) -> None:
        """The ramp of a colouring between its title and the labels of its ends."""
        scale, (width, height) = SCALES[colouring], RAMP_SIZE
        words = f"{scale.title}   {scale.labels[0]}"
        self.write(words, left, top)
        start = left + int(self._pen.textlength(words, _font(13))) + 8
        colours = scale.colours(np.linspace(0, 1, width, dtype=np.float32))
        ramp = np.broadcast_to((colours * 255).astype(np.uint8), (height, width, 3))
        self.paste(np.ascontiguousarray(ramp), start, top + 3)
        self.write(scale.labels[1], start + width + 8, top)

    def picture(self) -> Picture:
        """The pixels."""
        return np.asarray(self._image)


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """The font that comes with Pillow: the same pictures everywhere."""
    return ImageFont.load_default(size)


def png_bytes(picture: Picture) -> bytes:
    """The picture as a PNG file."""
    stream = io.BytesIO()
    made_by = PngInfo()
    made_by.add_text("Software", "geneoh")
    Image.fromarray(picture).save(stream, format="PNG", optimize=True, pnginfo=made_by)
    return stream.getvalue()
