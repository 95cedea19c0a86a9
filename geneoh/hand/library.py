"""Hand models by side and source, and the choice of the one that poses a track."""

from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor
from typing_extensions import assert_never

from geneoh.choices import SIDES, HandSource, Side
from geneoh.hand.embedded import embedded_hand
from geneoh.hand.mano import AS_SHIPPED, MANO_NAMES, MENDED, load_mano
from geneoh.hand.model import HandModel, ShapedHand


def load_hand(
    side: Side, *, source: HandSource = "embedded", mano_dir: Path | str | None = None
) -> HandModel:
    """The hand of one side.

    Args:
        side: "left" or "right".
        source: "embedded", our own hand; "mano", from a file the user owns, its left shapes
            mended; "mano-as-shipped", the same with the left shapes of the official file.
        mano_dir: folder with MANO_RIGHT.pkl / MANO_LEFT.pkl; GENEOH_MANO_DIR where it is None.

    Raises:
        MissingAssetError: there is no MANO file; the message says where to get it.
        InputError: the file is not a MANO file.
    """
    match source:
        case "embedded":
            return embedded_hand(side)
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
    """The hand model that poses a track: the one place that decides this.

    It is `asked`, the user's choice, else `hand_model`, which the track names for its betas, else
    the embedded hand. If `asked` is "mano" and the betas belong to "mano-as-shipped" (see
    `geneoh.hand.mano`), it is the latter. Raises as `load_hand`.
    """
    if asked == MENDED and hand_model == AS_SHIPPED:
        asked = AS_SHIPPED
    if asked is None:
        asked = hand_model if hand_model in MANO_NAMES else "embedded"
    return load_hand(side, source=asked, mano_dir=mano_dir)


def mean_hand(side: Side) -> ShapedHand:
    """The embedded hand of one side with the mean shape."""
    return embedded_hand(side).shaped(torch.zeros(10))


def mean_skeletons() -> Float[Tensor, "2 1 20 3"]:
    """Bone offsets of the left and the right hand of the mean shape, the same in all frames."""
    return torch.stack([mean_hand(side).offsets for side in SIDES])[:, None]
