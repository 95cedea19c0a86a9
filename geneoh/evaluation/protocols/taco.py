"""TACO: the example recording that comes with geneoh, or every hand of the user's own copy.

The paper shows TACO in pictures only and gives no protocol. The example is one clip, taken whole; a
copy of the data set is cut into windows in which the wrist is at most 15 cm from its object.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import geneoh
from geneoh.errors import MissingAssetError
from geneoh.evaluation.protocols.clips import (
    REACH,
    Excerpt,
    excerpts,
    recordings_of,
    wrist_to_object,
)
from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.readers.base import SourceClip
from geneoh.readers.npz_files import load
from geneoh.readers.recordings import source_named
from geneoh.sequence.sequence import Sequence

TRACK, MESH = "taco_clean.npz", "taco_object.obj"


@dataclass(frozen=True)
class Example:
    """The recording 20231104_017, CC BY 4.0."""

    folder: Path

    @property
    def name(self) -> str:
        """The sequence's name in the data set."""
        return "20231104_017"

    def read(self) -> Sequence:
        """The whole recording: 146 frames of a left hand that uses a tool."""
        return load(self.folder / TRACK, obj=self.folder / MESH)


def example(root: Path | None) -> Example | None:
    """The example in a folder, or the one that was installed; None where another root is given."""
    package = Path(geneoh.__file__).parent
    # Installed it lies in the package; in a working copy beside it.
    places = (package / "examples", package.parent / "examples") if root is None else (root,)
    for folder in places:
        if (folder / TRACK).is_file() and (folder / MESH).is_file():
            return Example(folder)
    if root is None:
        raise MissingAssetError(
            f"taco: expected the example {TRACK} with {MESH} in {places[0]}, got neither; install "
            "geneoh again, or name a copy of TACO with --root"
        )
    return None


def find(root: Path) -> list[SourceClip]:
    """Every sequence of the user's copy."""
    return source_named("taco").reader().find(root / "Hand_Poses")


def cut(clip: SourceClip, options: ProtocolOptions) -> Iterator[Excerpt]:
    """Windows of both hands, each with the object it holds."""
    for recording in recordings_of("taco", clip, options.known):
        (hand,) = recording.sequence.hands
        near = wrist_to_object(hand, recording.sequence.object) <= REACH
        yield from excerpts("taco", clip, recording, hand.side, near, options)
