"""HOI4D: one clip of the right hand in each sequence of nine categories; real noise, no truth.

Source: GeneOH Diffusion, C.1 and Table 3, which counts the sequences but does not name them; here
all sequences of the categories count in which the object is annotated and the hand mostly seen.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from geneoh.evaluation.protocols.clips import Excerpt, excerpts, offset_of, recordings_of
from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.readers.base import SourceClip, clip_name
from geneoh.readers.sources.hoi4d import CATEGORIES

START_FRAMES = {
    **{"Laptop": 120, "Pliers": 150, "Scissors": 50},
    **dict.fromkeys(("Bottle", "Bowl", "Chair", "Mug", "ToyCar", "Kettle"), 0),
}
"""First frame of the clip by category (Table 3), at the recordings' 15 frames a second."""


def category_of(clip: SourceClip) -> str | None:
    """What the sequence's object is, by the C part of its name."""
    number = clip.path.parts[-5].removeprefix("C")
    return CATEGORIES.get(int(number)) if number.isdigit() else None


def find(root: Path) -> list[SourceClip]:
    """The sequences of the protocol's categories."""
    folders = sorted(p.parent for p in root.glob("HOI4D_annotations/*/*/*/*/*/*/*/objpose"))
    found = [SourceClip(clip_name(folder, 7), folder.resolve()) for folder in folders]
    return [clip for clip in found if category_of(clip) in START_FRAMES]


def cut(clip: SourceClip, options: ProtocolOptions) -> Iterator[Excerpt]:
    """The first window at or after the category's first frame in which the object is known."""
    category = category_of(clip)
    start = START_FRAMES[category] if category and options.start_frames == "paper" else 0
    one = options if options.windows == "whole" else replace(options, windows="first")
    for recording in recordings_of("hoi4d", clip, options.known):
        if "right" not in [hand.side for hand in recording.sequence.hands]:
            continue
        frames = np.arange(recording.sequence.frames) + offset_of(recording, clip)
        found = excerpts("hoi4d", clip, recording, "right", frames >= start, one)
        if found:
            yield found[0]
            return
