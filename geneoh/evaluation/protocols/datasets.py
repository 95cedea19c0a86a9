"""The evaluation protocol of each data set: its location, test split, and how clips are cut.

Source: GeneOH Diffusion, C.1 and Table 3, and for GRAB Zhou et al., TOCH, 2022.
"""

import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.resources import files
from itertools import zip_longest
from pathlib import Path
from typing import TypeVar

import numpy as np

from geneoh.choices import OTHER_SIDE, Dataset
from geneoh.errors import ConfigError, InputError, MissingAssetError
from geneoh.evaluation.options import ProtocolOptions
from geneoh.evaluation.protocols import clips, synthetic
from geneoh.readers.base import SourceClip
from geneoh.readers.npz.files import load
from geneoh.readers.registry import SOURCES
from geneoh.readers.sources.grab import frames_of_touch
from geneoh.readers.sources.hoi4d import CATEGORIES
from geneoh.seeds import seed_of

Item = TypeVar("Item")

WITHIN_REACH = 0.15  # largest distance from the wrist to the object of a hand within reach, metres
TEST_OBJECTS = ("mug", "wineglass", "camera", "binoculars", "fryingpan", "toothpaste")
"""GRAB: objects of TOCH's test split."""
START_FRAMES = {
    **{"Laptop": 120, "Pliers": 150, "Scissors": 50},
    **dict.fromkeys(("Bottle", "Bowl", "Chair", "Mug", "ToyCar", "Kettle"), 0),
}
"""HOI4D: first frame of the clip by category, at the recordings' 15 frames a second (Table 3)."""
EXAMPLE, TRACK, MESH = "20231104_017", "taco_clean.npz", "taco_object.obj"
"""TACO: name of the example recording in the data set, and its files."""


@dataclass(frozen=True)
class Protocol:
    """How the clips of a data set on disk are found."""

    source: str  # name of the reader
    layout: str  # where the files are below the root, in words, for errors
    folder: str  # folder of the files below the root
    cut: Callable[[SourceClip, ProtocolOptions], Iterator[clips.Clip]]  # cuts a file into clips
    scores: Callable[[SourceClip], bool] = lambda file: True  # whether a file is in the test split

    @property
    def variable(self) -> str:
        """Environment variable that holds the root folder of the user's copy."""
        return f"GENEOH_DATA_{self.source.upper()}"

    def root(self, chosen: Path | None) -> Path | None:
        """The root folder from the option or else from the environment."""
        named = os.environ.get(self.variable)
        return chosen or (Path(named) if named else None)

    def files(self, chosen: Path | None) -> list[SourceClip]:
        """The test files of the user's copy; `MissingAssetError` if there is no copy."""
        root, about = self.root(chosen), SOURCES[self.source]
        folder = None if root is None else root.resolve() / self.folder
        found = about.reader().find(folder) if folder and folder.exists() else []
        if found:
            return [file for file in found if self.scores(file)]
        got = "no folder was named" if root is None else f"there is none in {root}"
        raise MissingAssetError(
            f"{about.title}: expected a copy of the data set ({about.licence}), {got}; get it at "
            f"{about.where}, unpack it so that ROOT holds {self.layout}, and name it with "
            f"--root ROOT or {self.variable}=ROOT"
        )


def cut_grab(file: SourceClip, options: ProtocolOptions) -> Iterator[clips.Clip]:
    """Clips of each hand in frames in which the other hand does not touch the object.

    The wrist must be within reach. Split and filters are TOCH's: runs of at least one window at 30
    frames a second.
    """
    contact = frames_of_touch(file)
    for recording in clips.recordings_of("grab", file, options.reader_options):
        first, sequence = clips.first_frame(recording, file), recording.sequence
        for hand in sequence.hands:
            other_touches = contact[OTHER_SIDE[hand.side]][first : first + sequence.frames]
            kept = (clips.wrist_gap(hand, sequence.object) <= WITHIN_REACH) & ~other_touches
            yield from clips.excerpts("grab", file, recording, hand.side, kept, options)


def category_of(file: SourceClip) -> str | None:
    """HOI4D: category of a sequence's object, by the part C of its path; None if unknown."""
    number = file.path.parts[-5].removeprefix("C")
    return CATEGORIES.get(int(number)) if number.isdigit() else None


def cut_hoi4d(file: SourceClip, options: ProtocolOptions) -> Iterator[clips.Clip]:
    """The first window from the category's first frame on, within frames with a known object."""
    category = category_of(file)
    start = START_FRAMES[category] if category and options.start_frames == "paper" else 0
    one = options if options.windows == "whole" else replace(options, windows="first")
    for recording in clips.recordings_of("hoi4d", file, options.reader_options):
        frames = np.arange(recording.sequence.frames) + clips.first_frame(recording, file)
        if found := clips.excerpts("hoi4d", file, recording, "right", frames >= start, one):
            yield found[0]
            return


def cut_arctic(file: SourceClip, options: ProtocolOptions) -> Iterator[clips.Clip]:
    """Windows of the right hand in which the wrist is within reach in all frames."""
    reach = WITHIN_REACH if options.reach == "paper" else math.sqrt(WITHIN_REACH)
    for recording in clips.recordings_of("arctic", file, options.reader_options):
        every, far = np.ones(recording.sequence.frames, dtype=bool), None
        for hand in recording.sequence.hands:
            if hand.side == "right" and options.windows != "whole":
                far = clips.wrist_gap(hand, recording.sequence.object) > reach
        yield from clips.excerpts("arctic", file, recording, "right", every, options, without=far)


def _example(root: Path | None) -> clips.Clip | None:
    """TACO's example recording: 146 frames of a left hand with its object (CC BY 4.0).

    Without `root` it is the installed one; None if `root` holds no example.
    """
    package = Path(str(files("geneoh")))
    # An installation has it in the package, a working copy beside the package.
    places = (package / "examples", package.parent / "examples") if root is None else (root,)
    for folder in places:
        if (folder / TRACK).is_file() and (folder / MESH).is_file():
            return clips.Clip(EXAMPLE, partial(load, folder / TRACK, obj=folder / MESH))
    if root is None:
        raise MissingAssetError(
            f"taco: expected the example {TRACK} with {MESH} in {places[0]}, got neither; install "
            "geneoh again, or name a copy of TACO with --root"
        )
    return None


def cut_taco(file: SourceClip, options: ProtocolOptions) -> Iterator[clips.Clip]:
    """Windows of both hands, each with the object it holds, in frames with the wrist in reach."""
    for recording in clips.recordings_of("taco", file, options.reader_options):
        (hand,) = recording.sequence.hands
        near = clips.wrist_gap(hand, recording.sequence.object) <= WITHIN_REACH
        yield from clips.excerpts("taco", file, recording, hand.side, near, options)


GRAB = Protocol(
    *("grab", "grab/s1 to s10 and tools/object_meshes", "grab", cut_grab),
    scores=lambda file: file.path.stem.split("_")[0] in TEST_OBJECTS,
)
HOI4D_LAYOUT = "HOI4D_annotations, handpose/refinehandpose_right and HOI4D_CAD_Model_for_release"
ARCTIC_LAYOUT = "raw_seqs/s01 and meta/object_vtemplates"
TACO_LAYOUT = "Hand_Poses, Object_Poses and Object_Models"
# HOI4D: the paper gives the number of sequences but not their names, so all sequences of its nine
# categories are used in which the object is annotated and the hand mostly observed. ARCTIC: the
# paper tests on subject s01. TACO: the paper has no protocol.
PROTOCOLS: dict[Dataset, Protocol] = {
    "grab": GRAB,
    "grab-beta": GRAB,
    "hoi4d": Protocol(
        *("hoi4d", HOI4D_LAYOUT, "HOI4D_annotations", cut_hoi4d),
        scores=lambda file: category_of(file) in START_FRAMES,
    ),
    "arctic": Protocol("arctic", ARCTIC_LAYOUT, "raw_seqs/s01", cut_arctic),
    "taco": Protocol("taco", TACO_LAYOUT, "Hand_Poses", cut_taco),
}
"""The protocols of all data sets except `synthetic`."""


def data_root(dataset: Dataset, root: Path | None) -> Path | None:
    """The root folder of the user's copy, from the option or the environment; None without."""
    return PROTOCOLS[dataset].root(root) if dataset in PROTOCOLS else None


ON_DISK = tuple(PROTOCOLS)
USES: dict[str, tuple[str, ...]] = {
    "windows": ON_DISK,
    "stride": ON_DISK,
    "objects": ON_DISK,
    "frames": (*ON_DISK, "synthetic"),
    "start_frames": ("hoi4d",),
    "reach": ("arctic",),
}
"""The data sets that use a setting, by its name; other settings are not checked."""


def _refuse_unused(name: str, options: ProtocolOptions) -> None:
    """`ConfigError` for a changed setting that has no effect on the data set `name`."""
    plain = ProtocolOptions()
    for setting, used_by in USES.items():
        if name not in used_by and getattr(options, setting) != getattr(plain, setting):
            raise ConfigError(
                f"--set {setting}: expected none with {name}, whose clips are not cut by it, got "
                f"{getattr(options, setting)}; leave it out"
            )


def clips_by_file(
    dataset: Dataset, root: Path | None, options: ProtocolOptions
) -> Iterator[list[clips.Clip]]:
    """The clips of each file of a data set, in a fixed random order that mixes objects and people.

    A missing copy is reported at once; files are read lazily, and one that cannot be read becomes
    an `unreadable_clip`. `synthetic` and the example of `taco` need no copy. `ConfigError` for
    settings that the data set does not use.
    """
    clip = _example(data_root(dataset, root)) if dataset == "taco" else None
    _refuse_unused("the example of taco" if clip else dataset, options)
    if dataset == "synthetic":
        return iter([[each] for each in synthetic.find(options)])
    if clip is not None:
        return iter([[clip]])
    protocol = PROTOCOLS[dataset]
    ordered = sorted(protocol.files(root), key=lambda file: seed_of("order", file.name))
    return (_clips_of(protocol, file, options) for file in ordered)


def _clips_of(protocol: Protocol, file: SourceClip, options: ProtocolOptions) -> list[clips.Clip]:
    """The clips of one file; a damaged file becomes an `unreadable_clip`."""
    try:
        return list(protocol.cut(file, options))
    except (InputError, MissingAssetError) as error:
        return [clips.unreadable_clip(file.name, error)]


def spread_over_groups(groups: Iterable[Sequence[Item]], limit: int | None) -> list[Item]:
    """At most `limit` items: the first of each group, then the second of each, and so on.

    A larger limit keeps all items of a smaller one. No more groups are read than necessary.
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
