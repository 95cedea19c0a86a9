"""`geneoh convert`: what the field produces, as distributed, into sequences."""

from pathlib import Path
from typing import Any

import click

from geneoh.readers.registry import SOURCES

from .. import options, sources


@click.command(epilog=sources.table())
@click.argument("source", type=click.Choice(list(SOURCES)), metavar="SOURCE")
@click.argument(
    "paths", type=click.Path(path_type=Path), nargs=-1, required=True, metavar="PATH..."
)
@click.option(
    *("-o", "--output", "folder"),
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder to write to; what was converted into it before is not done again.",
)
@click.option("--check", is_flag=True, help="Hold the files against their convention, in words.")
@click.option(
    "--obj",
    type=options.INPUT_FILE,
    multiple=True,
    help="Mesh of the object in metres, for sources without an object; once per rigid part.",
)
@options.mano
@options.side
@options.fps
@sources.known
def convert(
    source: str, paths: tuple[Path, ...], folder: Path | None, check: bool, **known: Any
) -> None:
    """Convert the clips of SOURCE at or below each PATH to sequences.

    Writes one npz for each recording, the meshes of its objects beside them in objects/, and says
    what it could not read. A clip that fails --check is not written.
    """
    from geneoh.readers.convert import convert as converted
    from geneoh.readers.recordings import find_clips, source_named

    from .. import progress

    if folder is None and not check:
        raise click.UsageError("give -o DIR to write to, or --check to look only")
    chosen, tally = source_named(source), sources.Tally()
    clips = find_clips(chosen, list(paths))
    click.echo(f"found {len(clips)} clip{'s' * (len(clips) != 1)} of {chosen.title}")
    with progress.progress_bars() as on_progress:
        outcomes = converted(chosen, clips, folder, sources.known_of(**known), check=check)
        for done, outcome in enumerate(outcomes, 1):
            for line in tally.lines(outcome):
                click.echo(line)
            on_progress("clips", done, len(clips))
    click.echo(tally.summary(folder))
    if tally.failed:
        raise click.exceptions.Exit(2)
