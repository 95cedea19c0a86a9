"""Which file formats a scene can be written as: one table from endings to writers."""

from collections.abc import Callable
from pathlib import Path

from geneoh.errors import InputError
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
    if path.suffix.lower() not in WRITERS:
        raise InputError(f"{path}: expected {', '.join(WRITERS)}, got {path.suffix!r}; name it so")
    return WRITERS[path.suffix.lower()]


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
