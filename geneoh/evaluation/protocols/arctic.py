"""ARCTIC: the right hand of subject s01, windows in which its wrist stays near the object.

Source: GeneOH Diffusion, C.1.
"""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from geneoh.evaluation.protocols.clips import (
    REACH,
    Clip,
    excerpt,
    frame_windows,
    recordings_of,
    wrist_to_object,
)
from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.readers.base import SourceClip


def find(root: Path) -> list[SourceClip]:
    """The sequences of the test subject."""
    paths = sorted(root.glob("raw_seqs/s01/*.mano.npy"))
    return [SourceClip(f"s01/{path.name.removesuffix('.mano.npy')}", path) for path in paths]


def cut(file: SourceClip, options: ProtocolOptions) -> Iterator[Clip]:
    """Windows of one sequence; a window with a single frame out of reach is left out."""
    reach = REACH if options.reach == "paper" else math.sqrt(REACH)
    for recording in recordings_of("arctic", file, options.reader_options):
        if "right" not in [hand.side for hand in recording.sequence.hands]:
            continue
        gap = wrist_to_object(recording.sequence.hand("right"), recording.sequence.object)
        every = np.ones(len(gap), dtype=bool)
        for span in frame_windows("arctic", recording, "right", every, options):
            if options.windows == "whole" or np.nanmax(gap[span.start : span.stop]) <= reach:
                yield excerpt("arctic", file, recording.name, "right", span, options)
