"""TACO: the example recording that comes with geneoh, or every hand of the user's own copy.

The paper gives no protocol for TACO. The example is one clip, the whole recording; a copy of the
data set is cut into windows in which the wrist is at most 15 cm from the object.
"""

from collections.abc import Iterator
from functools import partial
from importlib.resources import files
from pathlib import Path

from geneoh.errors import MissingAssetError
from geneoh.evaluation.protocols.clips import (
    REACH,
    Clip,
    excerpts,
    recordings_of,
    wrist_to_object,
)
from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.readers.base import SourceClip
from geneoh.readers.npz_files import load
from geneoh.readers.recordings import source_named

EXAMPLE = "20231104_017"
"""Name of the example recording in the data set."""
TRACK, MESH = "taco_clean.npz", "taco_object.obj"


def example(root: Path | None) -> Clip | None:
    """The example recording: 146 frames of a left hand with its object (CC BY 4.0).

    Without `root` it is the installed one; None when `root` holds no example.

    Raises:
        MissingAssetError: the installed example is gone.
    """
    package = Path(str(files("geneoh")))
    # Installed it lies in the package; in a working copy beside it.
    places = (package / "examples", package.parent / "examples") if root is None else (root,)
    for folder in places:
        if (folder / TRACK).is_file() and (folder / MESH).is_file():
            return Clip(EXAMPLE, partial(load, folder / TRACK, obj=folder / MESH))
    if root is None:
        raise MissingAssetError(
            f"taco: expected the example {TRACK} with {MESH} in {places[0]}, got neither; install "
            "geneoh again, or name a copy of TACO with --root"
        )
    return None


def find(root: Path) -> list[SourceClip]:
    """Every sequence of the user's copy."""
    return source_named("taco").reader().find(root / "Hand_Poses")


def cut(file: SourceClip, options: ProtocolOptions) -> Iterator[Clip]:
    """Windows of both hands, each with the object it holds."""
    for recording in recordings_of("taco", file, options.reader_options):
        (hand,) = recording.sequence.hands
        near = wrist_to_object(hand, recording.sequence.object) <= REACH
        yield from excerpts("taco", file, recording, hand.side, near, options)
