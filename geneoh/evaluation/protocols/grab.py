"""GRAB and GRAB (Beta): the test objects, either hand where it alone holds the object.

Split and filters are TOCH's, which the paper takes over: 30 frames a second, frames without the
other hand's contact, wrist at most 15 cm from the object, whole runs of at least a window.

Source: GeneOH Diffusion, C.1; Zhou et al., TOCH, 2022.
"""

from collections.abc import Iterator
from pathlib import Path

from geneoh.choices import Side
from geneoh.evaluation.protocols.clips import (
    REACH,
    Excerpt,
    excerpts,
    offset_of,
    recordings_of,
    wrist_to_object,
)
from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.readers.base import SourceClip
from geneoh.readers.sources.grab import touching

TEST_OBJECTS = ("mug", "wineglass", "camera", "binoculars", "fryingpan", "toothpaste")
OTHER: dict[Side, Side] = {"right": "left", "left": "right"}


def find(root: Path) -> list[SourceClip]:
    """The files of the test objects."""
    paths = sorted(root.glob("grab/s*/*.npz"))
    return [
        SourceClip(f"{path.parent.name}/{path.stem}", path)
        for path in paths
        if path.stem.split("_")[0] in TEST_OBJECTS
    ]


def cut(clip: SourceClip, options: ProtocolOptions) -> Iterator[Excerpt]:
    """The clips of one file."""
    contact = touching(clip)
    for recording in recordings_of("grab", clip, options.known):
        first, sequence = offset_of(recording, clip), recording.sequence
        for hand in sequence.hands:
            busy = contact[OTHER[hand.side]][first : first + sequence.frames]
            near = wrist_to_object(hand, sequence.object) <= REACH
            yield from excerpts("grab", clip, recording, hand.side, near & ~busy, options)
