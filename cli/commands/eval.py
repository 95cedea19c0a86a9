"""`geneoh eval`: how well each method cleans clips of data sets that people have."""

from pathlib import Path
from typing import Any

import click

from geneoh.errors import numbered

from .. import evaluations, progress


@click.command()
@evaluations.eval_options
@click.pass_context
def eval(
    ctx: click.Context, folder: Path | None, inputs: Path | None, jobs: int | None, **other: Any
) -> None:
    """Score methods of cleaning on noisy clips, or a generator.

    Methods: the input; low-pass filters tuned once, and the best of all filters, alone and with the
    best offset, chosen with the ground truth, which no user has; optimisation without learning; a
    TOCH-style autoencoder and a regression trained on our data; MotionDiff in one call; geneoh.
    Prints tables and writes scores.csv, evaluation.json, report.md and report.html. An interrupted
    run goes on when it is started again. Exit code 2 says that every clip of some method failed.

    With --generator text2hoi: prints how near its clips are to real ones, by accuracy and features
    of a classifier of verbs, and how physical they are, beside real clips, random verbs and the
    nearest training clips. With both2hands: how well its hands fit their sentences and bodies,
    beside real ones and those of other clips. Writes generation.json, generation.csv and
    generation.md.
    """
    from geneoh.evaluation.cases import find_cases, write_inputs
    from geneoh.evaluation.report import keep_other_reports, write_report
    from geneoh.evaluation.runner import evaluate
    from geneoh.files.outputs import refuse_inputs
    from geneoh.workers.pool import cores

    if (other.pop("generator"), other.pop("refine"))[0] is not None:
        return evaluations.score_generator(ctx)
    evaluations.refuse_ignored(other, inputs)
    how = {name: other.pop(name) for name in ("fresh", "pages")}
    chosen = evaluations.evaluation_options(**other)
    if inputs is not None:
        read = (chosen.noisy_inputs, *chosen.predictions)
        refuse_inputs(inputs, inputs.resolve(), [path for path in read if path is not None])
        written = write_inputs(find_cases(chosen), inputs)
        click.echo(f"wrote {numbered(written, 'clip')} to {inputs}")
        return
    folder = folder or Path("runs", "eval", chosen.dataset)
    keep_other_reports(folder)
    how |= {"jobs": jobs or cores(), "command": evaluations.command_line(ctx)}
    with progress.progress_bars() as on_progress:
        made = evaluate(chosen, folder, on_progress=on_progress, **how)
    click.echo(made)
    if made.reused:
        click.echo(f"note: {made.reused} of {len(made.scores)} scores were there already")
    click.echo(f"wrote {', '.join(str(path) for path in write_report(made, folder))}")
    evaluations.refuse_without_scores(made, folder)
