"""What `convert` and `denoise --from` share: the table of sources, their options, the reports."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from geneoh.choices import JOINT_ORDERS, TRANSLATIONS
from geneoh.readers.registry import SOURCES

if TYPE_CHECKING:
    from geneoh.readers.base import ReaderOptions
    from geneoh.readers.convert import Outcome
    from geneoh.sequence.sequence import Sequence

MESH_FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)

OPTIONS = (
    click.option(
        "--objects",
        type=FOLDER,
        help="Folder of the data set's object meshes, where they are not in their usual place.",
    ),
    click.option(
        "--body",
        type=MESH_FILE,
        help="Your SMPL+H model, for sources whose hands belong to a body.",
    ),
    click.option(
        "--object-pose",
        type=MESH_FILE,
        help="npy file of (T, 4, 4) matrices, object's frame to hand's frame, for sources without "
        "an object.",
    ),
    click.option("--joint-order", type=click.Choice(JOINT_ORDERS), help="Order of bare keypoints."),
    click.option(
        "--translation",
        type=click.Choice(TRANSLATIONS),
        help="Point that the translation of bare MANO parameters places.",
    ),
    click.option(
        "--swap-parts",
        is_flag=True,
        help="HOI4D: the poses of the two parts are stored in exchanged order.",
    ),
    click.option(
        "--mean-pose/--no-mean-pose",
        default=None,
        help="Whether bare MANO parameters are relative to MANO's mean pose.",
    ),
    click.option(
        "--focal", type=float, help="Focal length of the camera in pixels, for HaMeR and WiLoR."
    ),
)
NAMES = (
    *("objects", "body", "object_pose", "joint_order", "translation", "swap_parts", "mean_pose"),
    "focal",
)
"""Of these options, as the commands get them."""


def known(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that say what a source leaves open."""
    for option in reversed(OPTIONS):
        command = option(command)
    return command


def known_of(
    mano: Path | None = None,
    obj: tuple[Path, ...] = (),
    object_pose: Path | None = None,
    joint_order: str | None = None,
    **rest: Any,
) -> "ReaderOptions":
    """What the caller said, with its files read."""
    from geneoh.geometry.mesh import load_mesh
    from geneoh.readers.base import ReaderOptions
    from geneoh.readers.foreign_files import read_array

    shapes = (("T", 4, 4), ("T", "Q", 4, 4))
    return ReaderOptions(
        mano_dir=mano,
        meshes=tuple(load_mesh(path) for path in obj),
        object_pose=None if object_pose is None else read_array(object_pose, *shapes),
        joint_order=joint_order or "openpose",
        **rest,
    )


def read(
    path: Path,
    obj: tuple[Path, ...],
    source: str | None,
    clip: str | None,
    *,
    side: Any,
    fps: float | None,
    mano: Path | None,
    **said: Any,
) -> "Sequence":
    """The sequence in a file of any layout, or the one recording of a named source, checked."""
    import geneoh
    from geneoh.readers.recordings import read_one
    from geneoh.sequence.validation import check_sequence

    if source is not None:
        known = known_of(mano, obj, side=side, fps=fps, **said)
        recording = read_one(source, path, known, clip)
        check_sequence(recording.sequence, recording.name)
        return recording.sequence
    if not obj:
        raise click.UsageError("Missing option '--obj'")
    return geneoh.load(path, obj=obj, side=side, fps=fps, mano_dir=mano)


def beside(noisy: Path) -> Path:
    """Where the clean sequence goes by default: a folder may be given as . or .. too."""
    named = noisy if noisy.name.strip(".") else noisy.resolve()
    return named.with_name(f"{named.stem}_clean.npz")


def table() -> str:
    """The sources with what they hold, their licence and where to get them."""
    rows = [f"{s.name}: {s.title}, {s.holds}. {s.licence}; {s.where}" for s in SOURCES.values()]
    return "\b\nSOURCE is one of:\n" + "\n".join(f"  {row}" for row in rows)


class Tally:
    """Counts what became of the clips, and says it."""

    def __init__(self) -> None:
        self.written = self.skipped = self.failed = self.sound = 0

    def lines(self, outcome: "Outcome") -> Iterator[str]:
        """What to say of one clip."""
        name = outcome.clip.name
        self.skipped += outcome.skipped
        self.written += 0 if outcome.skipped else len(outcome.files)
        if outcome.problem is not None:
            self.failed += 1
            yield f"{name}: not read, {outcome.problem}"
        elif outcome.contradictions:
            self.failed += 1
            yield f"{name}: contradicts its convention"
            yield from (f"  {words}" for words in outcome.contradictions)
        elif not outcome.skipped:
            self.sound += 1
            yield f"{name}: {', '.join(outcome.notes)}"

    def summary(self, folder: Path | None) -> str:
        """The last line."""
        where = "" if folder is None else f", {self.written} sequences written to {folder}"
        before = f", {self.skipped} done before" if self.skipped else ""
        return f"{self.sound} read, {self.failed} not{before}{where}"
