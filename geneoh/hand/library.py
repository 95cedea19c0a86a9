"""Hand models by side and source, and which of them a track's betas belong to."""

from functools import cache
from pathlib import Path

from typing_extensions import assert_never

from geneoh.choices import HandSource, Side
from geneoh.hand.embedded import embedded_right
from geneoh.hand.mano import AS_SHIPPED, MENDED, load_mano
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


def hand_of_betas(
    side: Side,
    hand_model: str | None,
    *,
    asked: HandSource | None = None,
    mano_dir: Path | str | None = None,
) -> HandModel:
    """The hand model by which a track is to be posed: the one place that decides this.

    Shape coefficients mean something only to the model that they were made for, and there are two
    left hands of MANO by the same coefficients (see `geneoh.hand.mano`).

    Args:
        side: of the track.
        hand_model: the model that the track names for its betas, or None.
        asked: the source that the user wants. "mano" stands for both left hands of MANO: the one
            that the betas belong to is taken, and they are used as they are. Another source than
            the track's is taken as asked, and a shape has to be fitted for it. Without it the
            track's own model is taken, or the embedded hand where the track names none.
        mano_dir: folder of the user's MANO files.

    Raises:
        MissingAssetError: the model is MANO's, and there is no MANO file.
        InputError: the file is not a MANO file.
    """
    if asked == MENDED and hand_model == AS_SHIPPED:
        asked = AS_SHIPPED
    if asked is None:
        asked = hand_model if hand_model in (MENDED, AS_SHIPPED) else "embedded"
    return load_hand(side, source=asked, mano_dir=mano_dir)


@cache
def _embedded_left() -> HandModel:
    """The mirror image of the right hand, made once."""
    return embedded_right().mirrored()
