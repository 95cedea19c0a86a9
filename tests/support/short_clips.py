"""The example recording and a short clip of it, which workers can load for themselves."""

from pathlib import Path

import geneoh
from geneoh.sequence.sequence import Sequence

EXAMPLES = Path(__file__).parents[2] / "examples"


def example() -> Sequence:
    """146 frames of a left hand that uses a tool."""
    return geneoh.load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")


def short_clip() -> Sequence:
    """Ten frames in which the tool is held and moved."""
    return example()[60:70]
