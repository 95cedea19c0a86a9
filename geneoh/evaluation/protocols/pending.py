"""The cases of an evaluation: listed at once, loaded one by one, in any process."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import TypeVar

from typing_extensions import assert_never

from geneoh.choices import CASE_NOISES, DATASETS, CaseNoise, Dataset
from geneoh.errors import ConfigError, InputError
from geneoh.evaluation.cases import Case
from geneoh.evaluation.protocols import arctic, grab, hoi4d, synthetic, taco
from geneoh.evaluation.protocols.clips import ClipSource
from geneoh.evaluation.protocols.dataset_locations import HOMES
from geneoh.evaluation.protocols.noise import check_noise, noisy_twin
from geneoh.evaluation.protocols.options import DEFAULT_NOISES, SEEDS, ProtocolOptions
from geneoh.synthesis.shards import seed_of

T = TypeVar("T")


@dataclass(frozen=True)
class PendingCase:
    """A case that is known by name and not read yet; small, and fit to be sent to a worker."""

    dataset: Dataset
    noise: CaseNoise
    seed: int
    source: ClipSource
    options: ProtocolOptions

    @property
    def clip(self) -> str:
        """Name of the clip, with slashes where the data set has folders."""
        return self.source.name

    def load(self) -> Case:
        """Read the clip and draw its noise; the same at every call and in every process."""
        clean = self.source.read()
        noisy = noisy_twin(clean, self.dataset, self.clip, self.noise, self.seed, self.options)
        truth = None if self.noise == "recorded" else clean
        return Case(self.dataset, self.clip, self.noise, self.seed, truth, noisy)


def find_cases(
    dataset: str,
    root: Path | None = None,
    *,
    noises: Iterable[str] = (),
    seeds: Iterable[int] = SEEDS,
    limit: int | None = None,
    options: ProtocolOptions | None = None,
) -> list[PendingCase]:
    """The cases of a data set's protocol, clip by clip, each under every noise and seed.

    Args:
        dataset: one of `DATASETS`.
        root: the user's copy; without it the environment says where (`HOMES`), and `synthetic` and
            the example of `taco` need none.
        noises: some of `CASE_NOISES`; none: the data set's own, `DEFAULT_NOISES`.
        seeds: of the noise; without noise they still tell runs of a cleaner apart.
        limit: clips at most. They are spread over the recordings, and those of a smaller limit are
            among those of a larger one.
        options: what the protocol leaves open.

    Raises:
        ConfigError: unknown data set or noise.
        MissingAssetError: the data set, or MANO where it is needed, is not there.
        InputError: there is no clip, or a file of the data set is damaged.
    """
    options = options or ProtocolOptions()
    name: Dataset = known(dataset, DATASETS, "data set")
    named: list[CaseNoise] = [known(noise, CASE_NOISES, "noise") for noise in noises]
    chosen = named or DEFAULT_NOISES[name]
    # What is missing on disk is told first: without the data no other choice matters.
    groups = groups_of(name, root, options)
    for noise in chosen:
        check_noise(name, noise, options)
    clips = spread(groups, limit)
    if not clips:
        raise InputError(
            f"{dataset}: expected clips of at least {options.frames} frames that the protocol "
            "keeps, got none; check that the copy is whole, or ask for fewer frames"
        )
    seeds = list(seeds)
    return [
        PendingCase(name, noise, seed, clip, options)
        for clip in sorted(clips, key=lambda clip: clip.name)
        for noise in chosen
        for seed in seeds
    ]


def known(value: str, choices: tuple[T, ...], what: str) -> T:
    """The choice of that name.

    Raises:
        ConfigError: there is none.
    """
    for choice in choices:
        if choice == value:
            return choice
    raise ConfigError(f"{what} {value}: expected one of {', '.join(map(str, choices))}")


def groups_of(
    dataset: Dataset, root: Path | None, options: ProtocolOptions
) -> Iterator[Sequence[ClipSource]]:
    """The clips of each file of a data set, in an order that mixes objects and people.

    That the data is there is checked at once; the files are read one by one as they are asked for.
    """
    if dataset == "synthetic":
        return iter([[clip] for clip in synthetic.find(options)])
    home = HOMES["grab" if dataset == "grab-beta" else dataset]
    if dataset == "taco" and (example := taco.example(home.root(root))):
        return iter([[example]])
    there = home.require(root)
    match dataset:
        case "grab" | "grab-beta":
            protocol = grab
        case "arctic":
            protocol = arctic
        case "hoi4d":
            protocol = hoi4d
        case "taco":
            protocol = taco
        case _:
            assert_never(dataset)
    files = sorted(protocol.find(there), key=lambda clip: seed_of("order", clip.name))
    return (list(protocol.cut(file, options)) for file in files)


def spread(groups: Iterable[Sequence[T]], limit: int | None) -> list[T]:
    """At most `limit` of all, one from each group before a second from any."""
    chosen: list[T] = []
    rest: list[Sequence[T]] = []
    for group in groups:
        if limit is not None and len(chosen) >= limit:
            return chosen[:limit]
        chosen += group[:1]
        rest.append(group[1:])
    later = [clip for layer in zip_longest(*rest) for clip in layer if clip is not None]
    return [*chosen, *later][:limit]
