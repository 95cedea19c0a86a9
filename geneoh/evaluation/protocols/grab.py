"""GRAB and GRAB (Beta): the test objects, each hand in the frames in which it alone holds one.

The paper takes split and filters from TOCH: 30 frames a second, frames in which the other hand has
no contact and the wrist is at most 15 cm from the object, in runs of at least one window.

Source: GeneOH Diffusion, C.1; Zhou et al., TOCH, 2022.
"""

from collections.abc import Iterator
from pathlib import Path

from geneoh.choices import Side
from geneoh.evaluation.protocols.clips import (
    REACH,
    Clip,
    excerpts,
    first_frame,
    recordings_of,
    wrist_to_object,
)
from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.readers.base import SourceClip
from geneoh.readers.sources.grab import touching

TEST_OBJECTS = ("mug", "wineglass", "camera", "binoculars", "fryingpan", "toothpaste")
"""Objects that TOCH keeps out of training."""
OTHER: dict[Side, Side] = {"right": "left", "left": "right"}


def find(root: Path) -> list[SourceClip]:
    """The files of the test objects."""
    paths = sorted(root.glob("grab/s*/*.npz"))
    return [
        SourceClip(f"{path.parent.name}/{path.stem}", path)
        for path in paths
        if path.stem.split("_")[0] in TEST_OBJECTS
    ]


def cut(file: SourceClip, options: ProtocolOptions) -> Iterator[Clip]:
    """The clips of one file."""
    contact = touching(file)
    for recording in recordings_of("grab", file, options.reader_options):
        first, sequence = first_frame(recording, file), recording.sequence
        for hand in sequence.hands:
            other_touches = contact[OTHER[hand.side]][first : first + sequence.frames]
            kept = (wrist_to_object(hand, sequence.object) <= REACH) & ~other_touches
            yield from excerpts("grab", file, recording, hand.side, kept, options)
