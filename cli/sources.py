"""What `convert` and `denoise --from` share: the table of sources, their options, the reports."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from click import Choice

from geneoh.choices import OF_SOURCES, POSE_FRAMES, TRANSLATIONS
from geneoh.errors import numbered
from geneoh.readers.registry import SOURCES

from . import options
from .options import FILE, FILE_OR_FOLDER, FOLDER, Decorator, flag, option

if TYPE_CHECKING:
    from geneoh.readers.convert import ConversionOutcome
    from geneoh.sequence.sequence import Sequence

reader_options = options.together(
    option(
        "--objects: Folder of the data set's object meshes, where they are not in their usual "
        "place.",
        FOLDER,
    ),
    option("--body: Your SMPL+H model, for sources whose hands belong to a body.", FILE),
    option(
        "--object-pose: Poses of the object, object's frame to hand's frame, for sources without "
        "an object: npy of (T, 4, 4) matrices, a trajectory (TUM, KITTI, CSV, JSON), or a folder "
        "of texts as FoundationPose writes.",
        FILE_OR_FOLDER,
    ),
    option(
        "--object-pose-frame: Frame that --object-pose leads to: the hand's world, or that of the "
        "camera, whose motion HaWoR and Dyn-HaMR write.",
        Choice(POSE_FRAMES),
        "world",
    ),
    options.unit,
    options.bare,
    option(
        "--translation: Point that the translation of bare MANO parameters places.",
        Choice(TRANSLATIONS),
    ),
    flag("--swap-parts: HOI4D: the poses of two parts are in another order than their kind has."),
    option(
        "--mean-pose/--no-mean-pose: Whether bare MANO parameters are relative to MANO's mean pose."
    ),
    option("--focal: Focal length of the camera in pixels, for HaMeR, WiLoR and MediaPipe.", float),
    option(
        "--image-size: Width and height of the camera's images in pixels, as 1280x720: with them "
        "and --focal the hands of --from landmarks, if MediaPipe's, get their places before the "
        "camera.",
        metavar="WxH",
    ),
    options.camera,
    option(
        "--camera-pose: Poses of a camera that moves, camera to world, where hands and object are "
        "in its frame: files as of --object-pose. They are cleaned in the world; the result is in "
        "the camera's frame again.",
        FILE_OR_FOLDER,
    ),
)
"""Options that a source may need to be read."""


def of_source(what: str) -> Decorator:
    """The option that names the source of what a command reads."""
    return option(
        f"--from source: Read {what} as files of this data set or estimator; `geneoh convert "
        "--help` lists them.",
        Choice(list(SOURCES)),
        metavar="SOURCE",
    )


NEEDS_SOURCE = (*OF_SOURCES, "clip")
"""Parameters that apply only where --from names the source of a file."""


def read_sequence(
    path: Path, source: str | None, *, mano: Path | None, **others: Any
) -> "Sequence":
    """The sequence in a file of any layout, or the one recording of a named source."""
    import geneoh

    options.refuse_unit_without(others["obj"])
    if source is not None:
        return geneoh.read(source, path, mano_dir=mano, **others)
    options.refuse(NEEDS_SOURCE, "needs --from SOURCE, got none")
    bare = {name: value for name, value in others.items() if name not in NEEDS_SOURCE}
    return geneoh.load(path, mano_dir=mano, **bare)


def beside(noisy: Path) -> Path:
    """The default path of the clean sequence; a folder passed as . or .. gets its real name."""
    named = noisy if noisy.name.strip(".") else noisy.resolve()
    return named.with_name(f"{named.stem}_clean.npz")


def table_of_sources() -> str:
    """The sources with what they hold, their licence and where to get them."""
    rows = [f"{s.name}: {s.title}, {s.holds}. {s.licence}; {s.where}" for s in SOURCES.values()]
    return "\b\nSOURCE is one of:\n" + "\n".join(f"  {row}" for row in rows)


def lines(outcome: "ConversionOutcome") -> Iterator[str]:
    """The outcome of one clip in lines of text; none for a clip that was converted before."""
    name = outcome.clip.name
    if outcome.problem is not None:
        yield f"{name}: not read, {outcome.problem}"
    elif outcome.contradictions:
        yield f"{name}: contradicts its convention"
        yield from (f"  {words}" for words in outcome.contradictions)
    elif not outcome.skipped:
        yield f"{name}: {', '.join(outcome.notes)}"


def conversion_summary(outcomes: "list[ConversionOutcome]", folder: Path | None) -> str:
    """How many clips were read, and how many sequences were written."""
    skipped = sum(outcome.skipped for outcome in outcomes)
    failed = sum(outcome.failed for outcome in outcomes)
    written = sum(len(outcome.files) for outcome in outcomes if not outcome.skipped)
    where = "" if folder is None else f", {numbered(written, 'sequence')} written to {folder}"
    before = f", {skipped} done before" if skipped else ""
    return f"{len(outcomes) - skipped - failed} read, {failed} not{before}{where}"
