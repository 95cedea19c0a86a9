"""`geneoh denoise`: a noisy track in, a clean one and a short report out."""

from pathlib import Path
from typing import Any

import click

from .. import options, progress, sources
from ..options import FILE, option


@click.command()
@click.argument("noisy", type=click.Path(path_type=Path), required=False)
@options.obj_or_source
@sources.of_source("NOISY")
@option("--clip: With --from: name of the recording, where NOISY holds several.")
@options.output
@option("--report: HTML page to write as well: before and after in 3D, with the metrics.", FILE)
@option(
    "--stream: Clean frames as they come: read them from standard input, one JSON object a line, "
    "and write them to standard output. One hand a side, preset fast, 2 samples.",
    is_flag=True,
)
@option(
    "--lag: With --stream: seconds from a frame to its clean twin.  [default: 0.3]",
    click.FloatRange(0, 1),
)
@options.cleaning
@sources.reader_options
def denoise(
    noisy: Path | None,
    obj: tuple[Path, ...],
    output: Path | None,
    mano: Path | None,
    report: Path | None,
    overwrite: bool,
    stream: bool,
    lag: float | None,
    **chosen: Any,
) -> None:
    """Clean the hand-object interaction in NOISY.

    NOISY is an npz file in any layout that geneoh reads (its own, smplx names, TACO names, bare
    joints), or keypoints as npy, JSON or CSV. The pose of the object in each frame is in it or in
    --object-pose. Without a mesh the hand is cleaned by the prior of hand motion alone. The clean
    sequence is written beside it, with `_clean` added to the name, unless -o names another file.
    The command prints what it read, the time of each stage, and penetration, contact and
    acceleration before and after.

    With --stream there is no NOISY: a tracker is piped through, frame by frame.
    """
    if stream:
        from ..streaming import clean_stream

        return clean_stream(obj, mano, {**chosen, "lag": lag})
    if lag is not None:
        raise click.UsageError("--lag is the lag of --stream; give both, or neither")
    if noisy is None:
        raise click.UsageError("Missing argument 'NOISY'.", click.get_current_context())
    from geneoh.files.outputs import check_ending, check_outputs
    from geneoh.files.reading import refuse_missing

    refuse_missing(noisy)
    output = output or sources.beside(noisy)
    check_ending(output, (".npz",))
    if report is not None:
        check_ending(report, (".html",))
    outputs = [output] if report is None else [output, report]
    read = [noisy, *obj, mano, *(value for value in chosen.values() if isinstance(value, Path))]
    check_outputs(outputs, inputs=read, overwrite=overwrite)

    import geneoh

    settings = options.cleaner(mano, chosen)
    sequence = sources.read_sequence(noisy, obj=obj, mano=mano, **chosen)
    if report is not None:
        from geneoh.viz.scene import refuse_lost_meshes

        refuse_lost_meshes(sequence)
    with progress.progress_bars() as on_progress:
        result = geneoh.denoise(sequence, settings, on_progress=on_progress)
    geneoh.save(result, output, overwrite=overwrite)
    click.echo(f"read {sequence}")
    for line in (*result.lines(), f"wrote {output}"):
        click.echo(line)
    if report is not None:
        from geneoh.viz.view import write_page

        write_page(sequence, result, report, title=noisy.stem, mano_dir=mano)
        click.echo(f"wrote {report}")
