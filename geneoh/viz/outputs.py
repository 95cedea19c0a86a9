"""Which file formats a scene can be written as: one table from endings to writers."""

from collections.abc import Callable, Iterable
from pathlib import Path

from geneoh.files.outputs import check_ending, check_outputs
from geneoh.progress import OnStep
from geneoh.viz.export import write_meshes, write_smplx
from geneoh.viz.glb import write_glb
from geneoh.viz.look import Look
from geneoh.viz.page import write_page
from geneoh.viz.scene import Scene
from geneoh.viz.strip import write_filmstrip
from geneoh.viz.video import write_film

Writer = Callable[[Scene, Path, Look, OnStep | None], None]

WRITERS: dict[str, Writer] = {
    ".html": write_page,
    ".png": write_filmstrip,
    ".mp4": write_film,
    ".gif": write_film,
    ".glb": write_glb,
    ".npz": write_smplx,
    ".obj": write_meshes,
    ".ply": write_meshes,
}


def writer_for(path: Path) -> Writer:
    """The writer of a file's format.

    Raises:
        InputError: the ending is of no format that can be written.
    """
    check_ending(path, WRITERS)
    return WRITERS[path.suffix.lower()]


def check_scene_outputs(
    paths: Iterable[Path], *, inputs: Iterable[Path | None], overwrite: bool
) -> None:
    """Refuse files that a scene cannot be written to; see `check_outputs`.

    Raises:
        InputError: an ending of no format, or a place that cannot be written or must be kept.
    """
    paths = list(paths)
    meshes = [path for path in paths if writer_for(path) is write_meshes]
    files = [path for path in paths if path not in meshes]
    folders = [path.with_suffix("") for path in meshes]
    check_outputs(files, folders=folders, inputs=inputs, overwrite=overwrite)


def write(
    scene: Scene, path: Path, look: Look | None = None, *, on_step: OnStep | None = None
) -> None:
    """Write a scene in the format that the ending of the path names.

    `.html` is a page, `.png` a filmstrip, `.mp4` and `.gif` a film of all versions. `.glb`, `.npz`
    (smplx names), `.obj` and `.ply` hold the last version; the mesh formats make a folder of one
    file per frame, named without the ending.

    Raises:
        InputError: another ending, or the place cannot be written to.
    """
    writer_for(path)(scene, path, look or Look(), on_step)
