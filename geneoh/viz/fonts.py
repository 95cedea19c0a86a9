"""The font of a line of words in pictures and films."""

from functools import cache

from PIL import Image, ImageDraw, ImageFont

Font = ImageFont.FreeTypeFont | ImageFont.ImageFont

OF_PILLOW = ""  # in place of a name
OF_SYSTEMS = (
    *("DejaVuSans.ttf", "LiberationSans-Regular.ttf", "Arial.ttf", "segoeui.ttf"),
    *("NotoSansCJK-Regular.ttc", "NotoSansCJKsc-Regular.otf", "wqy-zenhei.ttc", "wqy-microhei.ttc"),
    *("DroidSansFallbackFull.ttf", "DroidSansFallback.ttf", "Arial Unicode.ttf", "PingFang.ttc"),
    *("Hiragino Sans GB.ttc", "AppleSDGothicNeo.ttc", "msyh.ttc", "msgothic.ttc", "malgun.ttf"),
)
"""Files of fonts that are part of many systems: of most alphabets, of Chinese, Japanese, Korean."""
NO_LETTER = "\U0010ffff"  # is drawn as the box of a letter that a font lacks


def font_of(words: str, size: int) -> Font:
    """The font that comes with Pillow, the same everywhere. It has hardly more letters than those
    of English: for others the first font of the machine that has all of the words, if any."""
    names = () if words.isascii() else (OF_PILLOW, *OF_SYSTEMS)
    named = (name for name in names if all(has_letter(name, letter) for letter in set(words)))
    return font_named(next(named, OF_PILLOW), size) or ImageFont.load_default(size)


@cache
def font_named(name: str, size: int) -> Font | None:
    """The font in a file; None where the machine does not have it."""
    try:
        return ImageFont.truetype(name, size) if name else ImageFont.load_default(size)
    except OSError:
        return None


@cache
def has_letter(name: str, letter: str) -> bool:
    """Whether the machine has that font, and it draws the letter as something of its own."""
    font = font_named(name, 13)
    return font is not None and _drawn(font, letter) != _drawn(font, NO_LETTER)


def _drawn(font: Font, letter: str) -> bytes:
    """The pixels of a letter."""
    image = Image.new("L", (40, 40))
    ImageDraw.Draw(image).text((8, 8), letter, 255, font)
    return image.tobytes()
