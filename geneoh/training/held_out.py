"""Which clips of recordings are held out for validation: those of whole objects, or of people."""

from collections import Counter
from collections.abc import Sequence

import torch
from jaxtyping import Bool
from torch import Tensor

from geneoh.seeds import seed_of
from geneoh.training.recordings import ClipRecord

HELD_OUT = 0.1  # share of a source's clips that is held out for validation, in whole objects


def held_out(sources: Sequence[Sequence[ClipRecord]]) -> list[tuple[Bool[Tensor, " B"], str]]:
    """Which clips of each source are held out for validation, and by what, in words.

    Whole objects, the same ones of all sources; of one object whole people; of one person with one
    object none.
    """
    objects = held_names([[record.object for record in records] for records in sources])
    return [held_clips(records, objects) for records in sources]


def held_clips(records: Sequence[ClipRecord], objects: set[str]) -> tuple[Bool[Tensor, " B"], str]:
    """Which clips of one source are held out, and by what; all sources hold out `objects`."""
    people = held_names([[record.person for record in records]])
    for kind, several, chosen in (("object", "objects", objects), ("person", "people", people)):
        names = [getattr(record, kind) for record in records]
        if count := len(chosen & set(names)):
            held = torch.tensor([name in chosen for name in names])
            of = f"one {kind}" if count == 1 else f"{count} {several}"
            return held, f"{int(held.sum())} of {of} held out for validation"
    none = torch.zeros(len(records), dtype=torch.bool)
    return none, "validated on what is learned: there is no other object"


def held_names(sources: Sequence[Sequence[str]]) -> set[str]:
    """Random names that are a tenth of the clips of each source, of the names of its clips.

    One name of each source is left to learn from; where there is only one, it is not chosen.
    """
    counts, chosen = [Counter(names) for names in sources], set[str]()
    known = set[str]().union(*counts)
    for name in sorted(known, key=lambda name: seed_of("held out", name)):
        found = [count for count in counts if name in count]
        lacking = any(sum(c[one] for one in chosen) < HELD_OUT * c.total() for c in found)
        if lacking and all(count.keys() - chosen - {name} for count in found):
            chosen.add(name)
    return chosen
