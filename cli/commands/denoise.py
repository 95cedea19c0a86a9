"""`geneoh denoise`: a noisy track in, a clean one and a short report out."""

from pathlib import Path
from typing import Any

import click

from geneoh.choices import PRESETS, SELECTIONS
from geneoh.readers.registry import SOURCES

from .. import options, sources


@click.command()
@click.argument("noisy", type=click.Path(path_type=Path))
@options.obj_or_source
@click.option(
    "--from",
    "source",
    type=click.Choice(list(SOURCES)),
    metavar="SOURCE",
    help="Read NOISY as a data set's or estimator's own files; `geneoh convert --help` lists them.",
)
@click.option("--clip", help="With --from: which recording, where NOISY holds several.")
@options.output
@click.option(
    "--preset",
    type=click.Choice(PRESETS),
    default="default",
    show_default=True,
    help="How: our best, as the paper does it, or quickly.",
)
@click.option(
    "--samples", type=int, help="Diffusion chains to draw; the preset has its own number."
)
@click.option(
    "--select",
    "selection",
    type=click.Choice(SELECTIONS),
    help="Which sample is kept: the one closest to the input, or the mean.",
)
@click.option("--steps", type=int, help="Denoiser calls per stage, instead of the preset's.")
@click.option(
    "--hand",
    type=click.Choice(["embedded", "mano"]),
    default="embedded",
    show_default=True,
    help="Hand model of the result.",
)
@options.mano
@click.option(
    "--report",
    type=click.Path(dir_okay=False, path_type=Path),
    help="HTML page to write as well: before and after in 3D, with what was measured.",
)
@options.weights
@options.seed
@options.side
@options.fps
@options.device
@sources.known
def denoise(
    noisy: Path,
    obj: tuple[Path, ...],
    output: Path | None,
    mano: Path | None,
    report: Path | None,
    **chosen: Any,
) -> None:
    """Clean the hand-object interaction in NOISY.

    NOISY is an npz in any layout that geneoh reads (its own, smplx names, TACO names, bare joints)
    with the object's pose per frame. Writes NOISY with `_clean` before its ending, unless -o says
    otherwise, and prints what was done and what it changed.
    """
    import geneoh
    from geneoh.pipeline.results import save_result

    from .. import devices, progress, reports

    devices.named(chosen["device"])
    asked = {name: chosen.pop(name) for name in ("source", "clip", "side", "fps", *sources.NAMES)}
    settings = geneoh.Options(mano_dir=mano, **chosen)
    sequence = sources.read(noisy, obj, mano=mano, **asked)
    with progress.progress_bars() as on_progress:
        result = geneoh.denoise(sequence, settings, on_progress=on_progress)
    output = output or sources.beside(noisy)
    save_result(result, settings, output)
    for line in reports.denoised(sequence, result, output):
        click.echo(line)
    if report is not None:
        from geneoh.viz.outputs import write_report

        write_report(sequence, result, report, title=noisy.stem, mano_dir=mano)
        click.echo(f"wrote {report}")
