"""`geneoh view`: a result as a page, a film, pictures, or files for other programs."""

from pathlib import Path
from typing import Any

import click

from geneoh.choices import COLOURINGS

from .. import options


@click.command()
@click.argument("files", type=options.INPUT_FILE, nargs=-1, required=True)
@click.option(
    "--obj",
    type=options.INPUT_FILE,
    multiple=True,
    help="Mesh of the object in metres; once per rigid part. --serve finds it by the clip's name.",
)
@click.option(
    *("-o", "--output", "outputs"),
    type=click.Path(path_type=Path),
    multiple=True,
    help="File to write, may be repeated: .html (default), .png filmstrip, .mp4, .gif, .glb, "
    ".npz with smplx names, .obj or .ply as a folder of one mesh per frame.",
)
@click.option(
    "--colour",
    "colouring",
    type=click.Choice(COLOURINGS),
    default="penetration",
    show_default=True,
    help="What the hand's colour tells in pictures and films.",
)
@click.option(
    "--up",
    type=click.Choice(["x", "y", "z", "-x", "-y", "-z"]),
    default="z",
    show_default=True,
    help="Direction of the recording that is up.",
)
@click.option("--frame", "frames", type=int, multiple=True, help="Frame of a filmstrip; repeated.")
@click.option("--cell", type=click.IntRange(64, 2048), default=260, help="Filmstrip picture, px.")
@click.option("--serve", is_flag=True, help="Look at many results live, sorted by a measure.")
@click.option("--port", type=int, default=8080, show_default=True, help="Of --serve.")
@options.mano
@options.side
@options.fps
def view(
    files: tuple[Path, ...],
    obj: tuple[Path, ...],
    outputs: tuple[Path, ...],
    serve: bool,
    port: int,
    **asked: Any,
) -> None:
    """Look at RESULT, beside what it was made from where BEFORE is given too.

    FILES are RESULT [BEFORE], in any layout that geneoh reads. Writes RESULT.html unless -o says
    otherwise. With --serve, FILES are results; NAME.npz beside NAME_clean.npz is its input.
    """
    from functools import partial

    from geneoh.viz.outputs import Look, check_ending, open_scene, write

    from .. import progress

    opened = partial(open_scene, **{name: asked.pop(name) for name in ("side", "fps", "mano")})
    look = Look(**asked)
    if serve:
        from geneoh.viz.serve import Gallery, find_clips

        with progress.progress_bars() as on_progress:
            clips = find_clips(files, obj, opened, on_clip=partial(on_progress, "clips"))
        gallery = Gallery(clips, up=look.upward, port=port)
        click.echo(f"{len(clips)} clips at {gallery.address}, Ctrl-C ends")
        gallery.run()
        return
    for output in outputs:
        check_ending(output)
    scene = opened(files, obj)
    for output in outputs or (files[0].with_suffix(".html"),):
        with progress.progress_bars() as on_progress:
            write(scene, output, look, on_step=partial(on_progress, output.name))
        click.echo(f"wrote {output}")
