"""`geneoh batch`: clean many clips, and go on where single ones fail."""

from pathlib import Path
from typing import Any

import click

from geneoh.errors import numbered

from .. import options, progress, sources
from ..options import FOLDER, option

PRINTED_FAILURES = 5
"""Most failed clips that are printed; the summary has all of them."""


@click.command()
@click.argument("inputs", type=click.Path(path_type=Path), nargs=-1, required=True)
@option(
    "-o --out folder: Folder for the results, the journal and the summary.", FOLDER, required=True
)
@sources.of_source("INPUTS")
@options.many(
    f"--obj: {options.OBJ_HELP} By default the mesh beside a file with its name, else those "
    "that the file names.",
    options.FILE,
)
@options.jobs
@option("--ray: Work on a Ray cluster instead: its address, auto, or local.", metavar="ADDRESS")
@options.cleaning
@sources.reader_options
def batch(
    inputs: tuple[Path, ...],
    folder: Path,
    source: str | None,
    obj: tuple[Path, ...],
    jobs: int | None,
    ray: str | None,
    mano: Path | None,
    **chosen: Any,
) -> None:
    """Clean many clips, each into an npz of its name in the folder --out.

    INPUTS are files that `geneoh denoise` reads, folders of npz files, patterns such as
    'data/*/*.npz', or manifests: CSV files with the columns input, name, meshes, source and
    options, of which only input is needed. A clip that fails is told and stops no other. Started
    again with the same folder, the command does what is left. It keeps journal.jsonl, and at the
    end writes summary.csv and summary.html, with what changed most first. Exit code 2 says that
    some clips failed.
    """
    from geneoh.batch.cleaning import BatchOptions
    from geneoh.batch.clips import find_batch_clips
    from geneoh.batch.run import clean_batch
    from geneoh.workers.pool import cores

    settings = options.cleaner(mano, chosen)
    clips = find_batch_clips(inputs, source, folder, obj)
    if all(clip.source is None for clip in clips):
        options.refuse(sources.NEEDS_SOURCE, "needs --from SOURCE, got none")
    with progress.progress_bars() as on_progress:
        wanted = BatchOptions(folder, settings, chosen)
        made = clean_batch(clips, wanted, jobs=jobs or cores(), ray=ray, on_progress=on_progress)
    for outcome in made.failed[:PRINTED_FAILURES]:
        click.echo(f"{outcome.clip}: failed, {outcome.failed}", err=True)
    if (more := len(made.failed) - PRINTED_FAILURES) > 0:
        click.echo(f"and {more} more, see {folder / 'summary.csv'}", err=True)
    done = len(clips) - len(made.failed)
    click.echo(
        f"{numbered(done, 'clip')} done, {made.before} of them before, {len(made.failed)} failed; "
        f"wrote {folder / 'summary.html'}"
    )
    if made.failed:
        raise click.exceptions.Exit(2)
