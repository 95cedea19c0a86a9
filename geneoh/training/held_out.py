"""The validation split of recorded clips: whole objects, or whole people, are held out."""

from collections import Counter
from collections.abc import Sequence

import torch
from jaxtyping import Bool
from torch import Tensor

from geneoh.seeds import seed_of
from geneoh.training.recordings import ClipRecord

HELD_OUT = 0.1  # share of a source's clips that is held out for validation


def held_out(sources: Sequence[Sequence[ClipRecord]]) -> list[tuple[Bool[Tensor, " B"], str]]:
    """A mask of the held-out clips of each source, and a description of the split.

    Whole objects are held out, the same ones in all sources; in a source with a single object,
    whole people; in a source with a single object and person, nothing.
    """
    objects = held_names([[record.object for record in records] for records in sources])
    return [held_clips(records, objects) for records in sources]


def held_clips(records: Sequence[ClipRecord], objects: set[str]) -> tuple[Bool[Tensor, " B"], str]:
    """The mask and description of one source; `objects` are those held out in all sources."""
    people = held_names([[record.person for record in records]])
    for kind, several, chosen in (("object", "objects", objects), ("person", "people", people)):
        names = [getattr(record, kind) for record in records]
        if count := len(chosen & set(names)):
            held = torch.tensor([name in chosen for name in names])
            of = f"one {kind}" if count == 1 else f"{count} {several}"
            return held, f"{int(held.sum())} of {of} held out for validation"
    none = torch.zeros(len(records), dtype=torch.bool)
    return none, "validated on the training data: there is no other object"


def held_names(sources: Sequence[Sequence[str]]) -> set[str]:
    """Random names that cover a share `HELD_OUT` or more of each source's clips, where possible.

    `sources` holds the name (object or person) of each clip. At least one name of each source is
    left for training.
    """
    counts, chosen = [Counter(names) for names in sources], set[str]()
    known = set[str]().union(*counts)
    for name in sorted(known, key=lambda name: seed_of("held out", name)):
        found = [count for count in counts if name in count]
        lacking = any(sum(c[one] for one in chosen) < HELD_OUT * c.total() for c in found)
        if lacking and all(count.keys() - chosen - {name} for count in found):
            chosen.add(name)
    return chosen
