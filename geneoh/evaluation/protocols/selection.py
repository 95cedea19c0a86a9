"""Which clips of a data set are scored: listed by reading as few files as the limit allows."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple, TypeVar

from geneoh.choices import Dataset
from geneoh.evaluation.protocols import arctic, grab, hoi4d, synthetic, taco
from geneoh.evaluation.protocols.clips import Clip
from geneoh.evaluation.protocols.dataset_locations import DATASET_LOCATIONS
from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.readers.base import SourceClip
from geneoh.synthesis.shards import seed_of

Item = TypeVar("Item")


class Protocol(NamedTuple):
    """How the clips of a data set on disk are found."""

    source: str
    """Name of the reader."""
    find: Callable[[Path], list[SourceClip]]
    """The files of a copy that the protocol scores."""
    cut: Callable[[SourceClip, ProtocolOptions], Iterator[Clip]]
    """The clips of one file."""


PROTOCOLS: dict[Dataset, Protocol] = {
    "grab": Protocol("grab", grab.find, grab.cut),
    "grab-beta": Protocol("grab", grab.find, grab.cut),
    "hoi4d": Protocol("hoi4d", hoi4d.find, hoi4d.cut),
    "arctic": Protocol("arctic", arctic.find, arctic.cut),
    "taco": Protocol("taco", taco.find, taco.cut),
}


def data_root(dataset: Dataset, root: Path | None) -> Path | None:
    """The folder of the user's copy that an option or the environment names, if there is any."""
    if dataset not in PROTOCOLS:
        return None
    return DATASET_LOCATIONS[PROTOCOLS[dataset].source].root(root)


def clips_by_file(
    dataset: Dataset, root: Path | None, options: ProtocolOptions
) -> Iterator[list[Clip]]:
    """The clips of each file of a data set, in an order that mixes objects and people.

    The copy is looked for at once; its files are read one by one as they are asked for.

    Args:
        dataset: which data set.
        root: the user's copy; without it the environment names one. `synthetic` and the example of
            `taco` need none.
        options: how the clips are cut.

    Raises:
        MissingAssetError: the data set is not there.
    """
    if dataset == "synthetic":
        return iter([[clip] for clip in synthetic.find(options)])
    protocol = PROTOCOLS[dataset]
    location = DATASET_LOCATIONS[protocol.source]
    if dataset == "taco" and (example := taco.example(location.root(root))):
        return iter([[example]])
    found = protocol.find(location.require(root))
    files = sorted(found, key=lambda file: seed_of("order", file.name))
    return (list(protocol.cut(file, options)) for file in files)


def spread_over_groups(groups: Iterable[Sequence[Item]], limit: int | None) -> list[Item]:
    """At most `limit` items: the first of each group, then the second of each, and so on.

    The items of a smaller limit are among those of a larger one, and no more groups are asked for
    than the limit needs.
    """
    chosen: list[Item] = []
    rest: list[Sequence[Item]] = []
    for group in groups:
        if limit is not None and len(chosen) >= limit:
            return chosen[:limit]
        chosen += group[:1]
        rest.append(group[1:])
    later = [item for layer in zip_longest(*rest) for item in layer if item is not None]
    return [*chosen, *later][:limit]
