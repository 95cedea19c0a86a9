"""Where hands come from: one function that gives a hand model by side and source."""

from pathlib import Path
from typing import Literal

from typing_extensions import assert_never

from geneoh.errors import MissingAssetError
from geneoh.hand.embedded import embedded_right
from geneoh.hand.model import HandModel, Side

Source = Literal["embedded", "mano"]


def load_hand(
    side: Side, *, source: Source = "embedded", mano_dir: Path | str | None = None
) -> HandModel:
    """The hand of one side.

    Args:
        side: "left" or "right".
        source: "embedded", our own hand, or "mano", from a file the user owns.
        mano_dir: folder with MANO_RIGHT.pkl / MANO_LEFT.pkl; without it the environment variable
            GENEOH_MANO_DIR says where.
    """
    match source:
        case "embedded":
            right = embedded_right()
            return right if side == "right" else right.mirrored()
        case "mano":
            raise MissingAssetError("MANO files cannot be read yet; use source='embedded'")
        case _:
            assert_never(source)
