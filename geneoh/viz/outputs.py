"""Which file formats a scene can be written as."""

from collections.abc import Iterable
from pathlib import Path

from geneoh.files.atomic import write_whole
from geneoh.files.outputs import check_ending, check_outputs
from geneoh.progress import OnStep
from geneoh.viz.canvas import png_bytes
from geneoh.viz.export import write_meshes, write_smplx
from geneoh.viz.glb import glb_bytes
from geneoh.viz.look import Look
from geneoh.viz.page import page_html
from geneoh.viz.scene import Scene
from geneoh.viz.strip import filmstrip
from geneoh.viz.video import write_film

MESHES = (".obj", ".ply")
"""Endings of the formats that make a folder."""
ENDINGS = (".html", ".png", ".mp4", ".gif", ".glb", ".npz", *MESHES)


def check_scene_outputs(
    paths: Iterable[Path], *, inputs: Iterable[Path | None], overwrite: bool
) -> None:
    """Refuse files that a scene cannot be written to; see `check_outputs`.

    Raises:
        InputError: an ending of no format, or a place that cannot be written or must be kept.
    """
    files, folders = [], []
    for path in paths:
        check_ending(path, ENDINGS)
        if path.suffix.lower() in MESHES:
            folders.append(path.with_suffix(""))
        else:
            files.append(path)
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
    look = look or Look()
    check_ending(path, ENDINGS)
    match path.suffix.lower():
        case ".html":
            write_whole(path, page_html(scene, look))
        case ".png":
            write_whole(path, png_bytes(filmstrip(scene, look, on_step)))
        case ".glb":
            write_whole(path, glb_bytes(scene, look))
        case ".npz":
            write_smplx(scene, path)
        case ".obj" | ".ply":
            write_meshes(scene, path, on_step)
        case _:
            write_film(scene, path, look, on_step)
