"""`geneoh convert`: files of data sets and estimators, as distributed, into sequences."""

from pathlib import Path
from typing import Any

import click
from click import Choice

from geneoh.readers.registry import SOURCES

from .. import options, progress, sources


@click.command(epilog=sources.table_of_sources())
@click.argument("source", type=Choice(list(SOURCES)), metavar="SOURCE")
@click.argument(
    "paths", type=click.Path(path_type=Path), nargs=-1, required=True, metavar="PATH..."
)
@options.option(
    "-o --output folder: Folder to write to. Clips that were converted into it before, from the "
    "same files and with the same options, are skipped.",
    options.FOLDER,
)
@options.flag("--check: Compare the files with their convention and report contradictions.")
@options.many(f"--obj: {options.OBJ_HELP} For sources without an object.", options.FILE)
@options.overwrite
@options.reading
@sources.reader_options
def convert(
    source: str,
    paths: tuple[Path, ...],
    folder: Path | None,
    check: bool,
    overwrite: bool,
    mano: Path | None,
    **others: Any,
) -> None:
    """Convert the clips of SOURCE at or below each PATH to sequences.

    Writes one npz for each recording, the meshes of its objects beside them in objects/, and says
    what it could not read. A clip that fails --check is not written. Exit code 2 says that some
    clips were not read, or failed.
    """
    from geneoh.readers.convert import convert as converted
    from geneoh.readers.recordings import find_clips, options_with_files, source_named

    if folder is None and not check:
        raise click.UsageError("give -o DIR to write to, or --check to look only")
    options.refuse_unit_without(others["obj"])
    chosen = source_named(source)
    given = options_with_files(mano_dir=mano, **others)
    clips = find_clips(chosen, list(paths), folder)
    click.echo(f"found {len(clips)} clip{'s' * (len(clips) != 1)} of {chosen.title}")
    doing = converted(chosen, clips, folder, given, check=check, overwrite=overwrite)
    with progress.progress_bars() as on_progress:
        outcomes = []
        for outcome in doing:
            outcomes.append(outcome)
            for line in sources.lines(outcome):
                click.echo(line)
            on_progress("clips", len(outcomes), len(clips))
    click.echo(sources.conversion_summary(outcomes, folder))
    if any(outcome.failed for outcome in outcomes):
        raise click.exceptions.Exit(2)
