"""Where hands come from: one function that gives a hand model by side and source."""

from functools import cache
from pathlib import Path

from typing_extensions import assert_never

from geneoh.choices import HandSource, Side
from geneoh.hand.embedded import embedded_right
from geneoh.hand.mano import load_mano
from geneoh.hand.model import HandModel


def load_hand(
    side: Side, *, source: HandSource = "embedded", mano_dir: Path | str | None = None
) -> HandModel:
    """The hand of one side.

    Args:
        side: "left" or "right".
        source: "embedded", our own hand; "mano", from a file the user owns, its left shapes
            mended; "mano-as-shipped", the same with the left shapes of the official file.
        mano_dir: folder with MANO_RIGHT.pkl / MANO_LEFT.pkl; without it the environment variable
            GENEOH_MANO_DIR says where.

    Raises:
        MissingAssetError: there is no MANO file; the message says where to get it.
        InputError: the file is not a MANO file.
    """
    match source:
        case "embedded":
            return embedded_right() if side == "right" else _embedded_left()
        case "mano" | "mano-as-shipped":
            return load_mano(side, mano_dir, name=source)
        case _:
            assert_never(source)


@cache
def _embedded_left() -> HandModel:
    """The mirror image, made once."""
    return embedded_right().mirrored()
