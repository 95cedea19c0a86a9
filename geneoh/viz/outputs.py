"""What `geneoh view` writes, by the ending of the file."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import Colouring, Side
from geneoh.errors import InputError
from geneoh.files.atomic import write_whole
from geneoh.pipeline.denoise import Denoised
from geneoh.pipeline.results import load_samples
from geneoh.readers.npz_files import load
from geneoh.sequence.sequence import Sequence
from geneoh.viz.export import write_meshes, write_smplx
from geneoh.viz.glb import glb_bytes
from geneoh.viz.page import write_page
from geneoh.viz.scene import Scene, make_scene
from geneoh.viz.strip import filmstrip, save_picture
from geneoh.viz.video import write_film

ENDINGS = (".html", ".png", ".mp4", ".gif", ".glb", ".npz", ".obj", ".ply")
AXES = {
    f"{sign}{name}": direction * row
    for sign, direction in (("", 1.0), ("-", -1.0))
    for name, row in zip("xyz", np.eye(3), strict=True)
}
"""Directions that can be up, by name."""


@dataclass(frozen=True)
class Look:
    """How a scene is to be shown."""

    colouring: Colouring = "penetration"
    up: str = "z"
    frames: tuple[int, ...] = ()
    """Frames of a filmstrip; evenly spread ones when empty."""
    cell: int = 260
    """Side of one picture of a filmstrip, pixels."""

    @property
    def upward(self) -> Float[np.ndarray, " 3"]:
        """The direction in the world that is up."""
        return AXES[self.up]


def open_scene(
    files: Iterable[Path],
    obj: tuple[Path, ...],
    *,
    side: Side | None = None,
    fps: float | None = None,
    mano: Path | None = None,
) -> Scene:
    """The scene of a result, and of what it was made from if that is named too.

    Raises:
        InputError: more than these two files, or one that cannot be read.
    """
    result, *before = files
    if len(before) > 1:
        raise InputError(
            f"expected RESULT [BEFORE], got {len(before) + 1} files; --serve takes many"
        )
    sequences: dict[str, Sequence] = {}
    for path in (*before, result):
        title = path.stem if path.stem not in sequences else str(path)
        sequences[title] = load(path, obj=obj, side=side, fps=fps, mano_dir=mano)
    return make_scene(sequences, samples=load_samples(result), mano_dir=mano)


def write_comparison(
    before: Sequence,
    after: Sequence,
    path: Path,
    *,
    title: str,
    samples: dict[Side, Float[Tensor, "S R 21 3"]] | None = None,
    mano_dir: Path | None = None,
) -> None:
    """Write the page of one interaction before and after it was cleaned.

    Args:
        before: as it came.
        after: the same frames, cleaned; its object is shown.
        path: of the page, `.html`.
        title: of the interaction.
        samples: per side, keypoints of the samples that were drawn.
        mano_dir: folder of the user's MANO files.

    Raises:
        InputError: the frames differ, there is no mesh, or the place cannot be written to.
    """
    sequences = {title: before, f"{title}, cleaned": after}
    scene = make_scene(sequences, samples=samples, mano_dir=mano_dir)
    write_page(scene, path, title, up=Look().upward)


def write_report(
    noisy: Sequence, result: Denoised, path: Path, *, title: str, mano_dir: Path | None = None
) -> None:
    """Write the page of a cleaning that just took place, with its samples."""
    samples: dict[Side, Float[Tensor, "S R 21 3"]] = {
        side: hand.samples.cpu() for side, hand in result.hands.items() if len(hand.samples) > 1
    }
    write_comparison(noisy, result.sequence, path, title=title, samples=samples, mano_dir=mano_dir)


def check_ending(path: Path) -> None:
    """Refuse a file whose ending says nothing that can be written.

    Raises:
        InputError: another ending.
    """
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{path}: expected {', '.join(ENDINGS)}, got {path.suffix!r}; name it so")


def write(
    scene: Scene,
    path: Path,
    look: Look | None = None,
    *,
    on_step: Callable[[int, int], None] | None = None,
) -> None:
    """Write a scene as its file's ending says.

    `.html` a page of all takes; `.png` a filmstrip and `.mp4`, `.gif` a film of all takes; `.glb`,
    `.npz` (smplx names), `.obj` and `.ply` the last take. The mesh formats make a folder of one
    file per frame, named without the ending.

    Raises:
        InputError: another ending, or the place cannot be written to.
    """
    check_ending(path)
    look, last = look or Look(), scene.takes[-1]
    match path.suffix.lower():
        case ".html":
            write_page(scene, path, last.title, up=look.upward)
        case ".png":
            picture = filmstrip(
                scene,
                frames=list(look.frames) or None,
                colouring=look.colouring,
                cell=look.cell,
                up=look.upward,
                on_picture=on_step,
            )
            save_picture(picture, path)
        case ".mp4" | ".gif":
            write_film(scene, path, colouring=look.colouring, up=look.upward, on_picture=on_step)
        case ".glb":
            write_whole(path, glb_bytes(scene, last, up=look.upward))
        case ".npz":
            write_smplx(scene, last, path)
        case ".obj":
            write_meshes(scene, last, path.with_suffix(""), "obj", on_frame=on_step)
        case ".ply":
            write_meshes(scene, last, path.with_suffix(""), "ply", on_frame=on_step)
