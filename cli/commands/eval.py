"""`geneoh eval`: how far each way of cleaning gets, on data people have."""

from pathlib import Path
from typing import Any

import click

from geneoh.choices import ABLATIONS, CASE_NOISES, DATASETS, METHODS, PRESETS, SELECTIONS

from .. import options

FOLDER = click.Path(file_okay=False, path_type=Path)


@click.command()
@click.option("--dataset", type=click.Choice(DATASETS), required=True, help="What to score on.")
@click.option("--root", type=FOLDER, help="Your copy of the data set; or its GENEOH_DATA_NAME.")
@click.option(
    *("--noise", "noises"),
    type=click.Choice(CASE_NOISES),
    multiple=True,
    help="Noise on the clips, may be repeated; clean is none. The data set has its own.",
)
@click.option(
    *("--seed", "seeds"),
    type=click.IntRange(min=0),
    multiple=True,
    help="Of noise and cleaner, may be repeated.  [default: 11, 22, 77; 11 for synthetic]",
)
@click.option("--limit", type=click.IntRange(min=1), help="Clips at most.")
@click.option(
    *("--row", "rows"),
    type=click.Choice(METHODS),
    multiple=True,
    help="Ways of cleaning, may be repeated; all but gaussian and one-euro otherwise.",
)
@click.option(
    *("--preset", "presets"),
    type=click.Choice(PRESETS),
    multiple=True,
    default=("default",),
    show_default=True,
    help="Of geneoh's rows, may be repeated.",
)
@click.option(
    *("--ablate", "ablations"),
    type=click.Choice(ABLATIONS),
    multiple=True,
    help="Add a row of geneoh without this part, may be repeated.",
)
@click.option(
    "--predictions",
    type=FOLDER,
    multiple=True,
    help="Score somebody's results: a folder of CLIP_NOISE_SEED.npz; may be repeated.",
)
@click.option("--inputs", type=FOLDER, help="Only write the noisy clips to this folder.")
@click.option("--twins", type=FOLDER, help="Take the noisy clips from a folder instead.")
@click.option(
    "--close-frames",
    type=click.IntRange(min=1),
    help="Frames of a clip in which volume and contact on the object are taken.  [default: 20; 5 "
    "for synthetic]",
)
@click.option("--samples", type=click.IntRange(min=1), help="Of geneoh; the preset has its own.")
@click.option(
    *("--select", "selection"),
    type=click.Choice(SELECTIONS),
    help="Which sample is kept: the one closest to the input, or the mean.",
)
@click.option("--hand", type=click.Choice(["embedded", "mano"]), default="embedded")
@options.mano
@options.weights
@click.option(
    *("--set", "settings"),
    multiple=True,
    metavar="NAME=VALUE",
    help="Change a choice of the protocol, such as windows=whole; may be repeated.",
)
@click.option(
    *("-o", "--output", "folder"),
    type=FOLDER,
    help="Folder of the record and the report.  [default: runs/eval/DATASET]",
)
@click.option("--jobs", type=click.IntRange(min=1), help="Processes; as many as there are cores.")
@click.option("--fresh", is_flag=True, help="Begin anew instead of going on.")
@click.option("--pages", is_flag=True, help="Leave a page in 3D of every clip that geneoh cleans.")
@click.pass_context
def eval(
    ctx: click.Context,
    folder: Path | None,
    inputs: Path | None,
    jobs: int | None,
    fresh: bool,
    pages: bool,
    **asked: Any,
) -> None:
    """Score every way of cleaning on noisy clips.

    Rows: the input; low-pass filters tuned once, and the best of all filters chosen with the ground
    truth in hand, which no user has; optimisation without learning; a TOCH-style autoencoder and a
    regression trained on our data; geneoh. Prints tables and writes scores.csv, evaluation.json,
    report.md and report.html. Started again, it goes on where it was stopped.
    """
    from geneoh.evaluation.external_results import write_inputs
    from geneoh.evaluation.plan import cases_of, cores, evaluate
    from geneoh.evaluation.report import write_report
    from geneoh.evaluation.tables import as_text

    from .. import evaluations, progress

    choices = evaluations.choices_of(**asked)
    if inputs is not None:
        click.echo(f"wrote {write_inputs(cases_of(choices), inputs)} clips to {inputs}")
        return
    folder = folder or Path("runs", "eval", choices.dataset)
    with progress.progress_bars() as on_progress:
        made = evaluate(
            choices,
            folder,
            command=evaluations.command_line(ctx),
            jobs=jobs or cores(),
            fresh=fresh,
            pages=pages,
            on_progress=lambda done, total: on_progress("eval", done, total),
        )
    for line in as_text(made.blocks):
        click.echo(line)
    for line in made.remarks():
        click.echo(f"note: {line}")
    click.echo(f"wrote {', '.join(str(path) for path in write_report(made, folder))}")
