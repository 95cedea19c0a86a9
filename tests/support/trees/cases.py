"""Every source with how it is written, and what its twin in a wrong convention is caught by."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from geneoh.readers.base import ReaderOptions, Recording, SourceClip
from geneoh.readers.recordings import find_clips, read_clip, source_named
from trees.estimators import (
    arcticnet,
    aria,
    dynhamr,
    halved,
    hamer,
    hawor,
    keypoint_array,
    landmarks,
    parameter_array,
    video_to_data,
)
from trees.interaction import Scene, scene
from trees.mano_files import SIDES
from trees.mocap import (
    arctic,
    arctic_processed,
    both57m,
    centred,
    egoallo,
    grab,
    grab_clips,
    grab_clips_left,
    in_clip,
    oakink2,
)
from trees.videos import (
    dexycb,
    fphab,
    gigahands,
    h2o,
    h2o3d,
    ho3d,
    hocap,
    hoi4d,
    hoi4d_articulated,
    hoi4d_cases,
    hot3d,
    oakink,
    of_few_coefficients,
    of_one_subject,
    taco,
    taco_pickle,
)


@dataclass(frozen=True)
class Case:
    """How one source is written, and what its wrong twin is caught by."""

    source: str
    build: Callable[[Path, Scene, bool], None]
    caught: str
    """Words of the self-test about the wrong twin."""
    start: str = "."
    """Where the reading starts."""
    parts: int = 1
    only: tuple[str, ...] = SIDES
    fps: float = 30.0
    posed: bool = True
    joints: bool = True
    left: str = "as shipped"
    object: bool = True
    expected: Callable[[Scene], Scene] = lambda s: s
    """The sequence that the files hold, where they cannot hold all of it."""
    fitted: bool = False
    """Betas are not in the file and found from vertices."""
    unknown: tuple[int, ...] = ()
    """Keypoints that the source does not have."""
    known: tuple[tuple[str, object], ...] = ()

    def write(self, root: Path, *, wrong: bool = False) -> None:
        """The known interaction below a folder, or its twin in the wrong convention."""
        self.build(root, scene(self.left), wrong)

    def options(self, root: Path) -> dict[str, Any]:
        """What the caller says, with paths below the folder."""
        paths = ("objects", "body")
        return {name: root / str(v) if name in paths else v for name, v in self.known}

    def clips(self, root: Path) -> list[SourceClip]:
        """The clips below the folder."""
        return find_clips(source_named(self.source), [(root / self.start).resolve()])

    def read(self, root: Path, mano_dir: Path | None) -> list[Recording]:
        """All recordings below the folder."""
        source, known = source_named(self.source), ReaderOptions(mano_dir, **self.options(root))
        return [each for clip in self.clips(root) for each in read_clip(source, clip, known)]


CASES = [
    Case("grab", grab, "rotation transposed", fps=120.0),
    Case(
        "grab_clips",
        grab_clips,
        "from the stored object",
        only=("right",),
        expected=lambda s: in_clip(s, "right"),
    ),
    Case(
        "grab_clips",
        grab_clips_left,
        "from the stored object",
        only=("left",),
        fitted=True,
        expected=lambda s: centred(in_clip(s, "left"), "left"),
    ),
    Case("hoi4d_cases", hoi4d_cases, "origin to its wrist", only=("right",), fps=15.0),
    Case("hoi4d", hoi4d, "that of the wrist", fps=15.0),
    Case("hoi4d", hoi4d_articulated, "the order of the parts", parts=2, fps=15.0),
    Case("arctic", arctic, "parts.json calls top", parts=2),
    Case("arctic_processed", arctic_processed, "from the stored object", "outputs", parts=2),
    Case(
        "arcticnet",
        arcticnet,
        "that of the wrist",
        "eval",
        parts=2,
        expected=halved,
        known=(("objects", "data/meta/object_vtemplates"),),
    ),
    Case("taco", taco, "too small for a hand"),
    Case("taco_pickle", taco_pickle, "from the stored object", only=("left",)),
    Case("h2o", h2o, "origin to its wrist"),
    Case("dexycb", dexycb, "origin to its wrist", only=("right",)),
    Case("hocap", hocap, "too small for a hand", expected=of_one_subject),
    Case("hot3d", hot3d, "too small for a hand", left="mirrored", expected=of_few_coefficients),
    Case("ho3d", ho3d, "origin to its wrist", only=("right",)),
    Case("h2o3d", h2o3d, "origin to its wrist", expected=of_one_subject),
    Case("oakink", oakink, "origin to its wrist", only=("right",)),
    Case("gigahands", gigahands, "from the stored keypoints"),
    Case("oakink2", oakink2, "that of the origin"),
    Case("fphab", fphab, "origin to its wrist", only=("right",)),
    Case(
        "both57m",
        both57m,
        "bend backward",
        "data",
        joints=False,
        object=False,
        known=(("body", "SMPLH_MALE.pkl"),),
    ),
    Case(
        "egoallo",
        egoallo,
        "bend backward",
        "trajectory",
        joints=False,
        object=False,
        known=(("body", "SMPLH_NEUTRAL.pkl"),),
    ),
    Case(
        "hamer",
        hamer,
        "misses the stored keypoints",
        object=False,
        left="mirrored",
        known=(("focal", 600.0),),
    ),
    Case("hawor", hawor, "bend backward", object=False, left="mirrored"),
    Case("dynhamr", dynhamr, "bend backward", object=False, left="mirrored"),
    Case("video_to_data", video_to_data, "bend backward", left="mirrored"),
    Case("aria", aria, "millimetres", fps=10.0, posed=False, object=False, unknown=(1,)),
    Case("landmarks", landmarks, "curl away from the palm", fps=72.0, posed=False, object=False),
    Case(
        "keypoints",
        keypoint_array,
        "another order",
        only=("right",),
        posed=False,
        object=False,
        known=(("side", "right"), ("joint_order", "fphab")),
    ),
    Case(
        "parameters",
        parameter_array,
        "convert degrees to radians",
        only=("left",),
        object=False,
        known=(("side", "left"), ("translation", "origin")),
    ),
]


def case_of(source: str) -> Case:
    """The first case of a source."""
    return next(case for case in CASES if case.source == source)


def written(source: str, root: Path) -> Case:
    """The first case of a source, written below a folder."""
    case = case_of(source)
    case.write(root)
    return case
