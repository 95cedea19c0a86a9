"""`geneoh view`: a result as a page, a film, pictures, or files for other programs."""

from pathlib import Path
from typing import Any

import click
from click import Choice

from geneoh.choices import AXES, CELL_LIMITS, COLOURINGS, STRIP_CELL

from .. import options, progress
from ..options import FILE, OBJ_HELP, flag, many, option


@click.command()
@click.argument("files", type=FILE, nargs=-1, required=True)
@many(
    f"--obj: {OBJ_HELP} Without it, those that RESULT names, or "
    "with --serve a mesh that is named like the result.",
    FILE,
)
@many(
    "-o --output outputs: File to write; its ending names the format: .html page (default), "
    ".png filmstrip, .mp4 or .gif film, .glb scene, .npz with smplx names, .bvh body, .obj or "
    ".ply new folder of one mesh per frame. May be repeated.",
    click.Path(path_type=Path),
)
@options.overwrite
@option(
    "--colour colouring: Quantity that the colour of the hand shows in pictures and films.",
    Choice(COLOURINGS),
    "penetration",
)
@option(
    "--up: Axis of the world that points up.  [default: that of the body in the file, else z]",
    Choice(AXES),
)
@many("--frame frames: Frame of a filmstrip. May be repeated.  [default: five, evenly spread]", int)
@option(
    "--cell: Side of one picture of a filmstrip, in pixels.",
    click.IntRange(*CELL_LIMITS),
    STRIP_CELL,
)
@flag("--serve: Show many results live, sorted by a measure.")
@option("--port: Network port of --serve.", click.IntRange(0, 65535), 8080)
@options.unit
@options.reading
@options.bare
def view(
    files: tuple[Path, ...],
    obj: tuple[Path, ...],
    outputs: tuple[Path, ...],
    overwrite: bool,
    serve: bool,
    port: int,
    **chosen: Any,
) -> None:
    """Show RESULT, beside BEFORE, what it was made from, where that is given too.

    FILES are RESULT [BEFORE], in any layout that geneoh reads. Writes RESULT.html unless -o names
    other files. With --serve, FILES are results, and NAME.npz beside NAME_clean.npz is its input.
    """
    from dataclasses import replace
    from functools import partial

    from geneoh.errors import InputError
    from geneoh.geometry.mesh import size_warning
    from geneoh.hand.mano import refuse_without_mano
    from geneoh.viz.look import Look
    from geneoh.viz.outputs import check_scene_outputs, refuse_formats, write
    from geneoh.viz.view import open_scene

    outputs = outputs or (files[0].with_suffix(".html"),)
    _refuse_unused(outputs, serve=serve)
    if "mano" in options.on_command_line():
        refuse_without_mano(chosen["mano"])
    if not serve:  # --serve finds meshes by name
        options.refuse_unit_without(obj)
    read = ("side", "fps", "unit", "joint_order", "keypoint_unit")
    given = {name: chosen.pop(name) for name in read}
    opened = partial(open_scene, mano_dir=chosen.pop("mano"), **given)
    up = chosen.pop("up")
    look = Look(up=up or "z", **chosen)
    if serve:
        return _serve(files, obj, opened, up, port)
    if len(files) > 2:
        raise InputError(f"expected RESULT [BEFORE], got {len(files)} files; --serve takes many")
    check_scene_outputs(outputs, inputs=[*files, *obj], overwrite=overwrite)
    scene = opened(*files, obj=obj)
    look = replace(look, up=up or scene.up)
    if not scene.object.meshes:
        click.echo("note: without a mesh the hands are shown alone; --obj MESH names one")
    for warning in filter(None, map(size_warning, scene.object.meshes)):
        click.echo(f"note: {warning}")
    meshes = [mesh.source for mesh in scene.object.meshes]
    check_scene_outputs(outputs, inputs=meshes, overwrite=overwrite)
    refuse_formats(scene, outputs, look)
    for output in outputs:
        with progress.progress_bars() as on_progress:
            written = write(scene, output, look, on_step=partial(on_progress, output.name))
        click.echo(f"wrote {written}")


def _serve(files: tuple[Path, ...], obj: tuple[Path, ...], opened: Any, up: Any, port: int) -> None:
    """Show many results live until Ctrl-C; `opened` makes the scene of one."""
    from contextlib import suppress
    from functools import partial

    from geneoh.errors import numbered
    from geneoh.viz.serve import Gallery, gallery_items

    with progress.progress_bars() as on_progress:
        items, left_out = gallery_items(files, obj, opened, on_step=partial(on_progress, "results"))
    for words in left_out:
        click.echo(f"left out: {words}", err=True)
    gallery = Gallery(items, up=up, port=port)
    click.echo(f"{numbered(len(items), 'result')} at {gallery.address}, Ctrl-C ends")
    with suppress(KeyboardInterrupt):
        gallery.run()


def _refuse_unused(outputs: tuple[Path, ...], *, serve: bool) -> None:
    """Refuse, by name, options that would be ignored."""
    from geneoh.viz.outputs import USED_BY, lacking

    if serve:
        shown = ("outputs", "overwrite", "colouring", "frames", "cell")
        options.refuse(shown, "has no meaning with --serve, which writes no file")
        return
    options.refuse(["port"], "needs --serve")
    for name in USED_BY:
        if words := lacking(name, outputs):
            options.refuse([name], f"needs {words}")
