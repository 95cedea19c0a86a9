"""HOI4D: one clip of the right hand in each sequence of nine categories; real noise, no truth.

Source: GeneOH Diffusion, C.1 and Table 3. The paper counts the sequences but does not name them, so
every sequence of the categories is taken whose object is annotated and whose hand is mostly seen.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from geneoh.evaluation.protocols.clips import Clip, excerpts, first_frame, recordings_of
from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.readers.base import SourceClip, clip_name
from geneoh.readers.sources.hoi4d import CATEGORIES

START_FRAMES = {
    **{"Laptop": 120, "Pliers": 150, "Scissors": 50},
    **dict.fromkeys(("Bottle", "Bowl", "Chair", "Mug", "ToyCar", "Kettle"), 0),
}
"""First frame of the clip by category, at the recordings' 15 frames a second (Table 3)."""


def category_of(file: SourceClip) -> str | None:
    """Category of the sequence's object, by the part C of its name; None for an unknown one."""
    number = file.path.parts[-5].removeprefix("C")
    return CATEGORIES.get(int(number)) if number.isdigit() else None


def find(root: Path) -> list[SourceClip]:
    """The sequences of the protocol's categories."""
    folders = sorted(p.parent for p in root.glob("HOI4D_annotations/*/*/*/*/*/*/*/objpose"))
    found = [SourceClip(clip_name(folder, 7), folder.resolve()) for folder in folders]
    return [file for file in found if category_of(file) in START_FRAMES]


def cut(file: SourceClip, options: ProtocolOptions) -> Iterator[Clip]:
    """The first window at or after the category's first frame in which the object is known."""
    category = category_of(file)
    start = START_FRAMES[category] if category and options.start_frames == "paper" else 0
    one = options if options.windows == "whole" else replace(options, windows="first")
    for recording in recordings_of("hoi4d", file, options.reader_options):
        if "right" not in [hand.side for hand in recording.sequence.hands]:
            continue
        frames = np.arange(recording.sequence.frames) + first_frame(recording, file)
        found = excerpts("hoi4d", file, recording, "right", frames >= start, one)
        if found:
            yield found[0]
            return
