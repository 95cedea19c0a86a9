"""`geneoh eval --generator`: what a generator makes of sentences, scored."""

from pathlib import Path

import click

from geneoh.choices import ACTION_DATASETS
from geneoh.errors import ConfigError

from . import evaluations, options, progress

GO_WITH_IT = {
    *("generator", "dataset", "root", "refine", "limit", "seeds", "mano", "weights", "settings"),
    *("folder", "jobs"),
}
"""Parameters of `geneoh eval` that mean something for a generator."""
NOT_FOR_BODIES = {"refine": "whose hands hold nothing", "jobs": "which works in one process"}
"""Those of them that mean nothing for hands of a body, and why."""


def score_generator(ctx: click.Context) -> None:
    """Score the generator that the command line names, write the report and print it."""
    from functools import partial

    from geneoh.config import configured
    from geneoh.evaluation.generation.report import as_text, keep_other_reports, write_report
    from geneoh.evaluation.generation.runner import GenerationOptions, evaluate_generator
    from geneoh.evaluation.gestures.runner import GestureOptions, evaluate_gestures
    from geneoh.workers.pool import cores

    check_parameters(ctx)
    asked = ctx.params
    given = {"limit": asked["limit"], "seed": next(iter(asked["seeds"]), None)}
    chosen = {name: value for name, value in given.items() if value is not None}
    chosen["weights"] = asked["weights"]
    root, settings = asked["root"], asked["settings"]
    if asked["generator"] == "both2hands":
        hands = configured(GestureOptions(root, **chosen), settings=settings)
        evaluate = partial(evaluate_gestures, hands)
    else:
        data = {name: asked[name] for name in ("dataset", "refine", "mano")}
        actions = GenerationOptions(root, **data, **chosen)
        scored = configured(actions, settings=settings)
        evaluate = partial(evaluate_generator, scored, jobs=asked["jobs"] or cores())
    folder = asked["folder"] or Path("runs", "eval", f"{asked['generator']}-{asked['dataset']}")
    keep_other_reports(folder)
    command = evaluations.command_line(ctx)
    with progress.progress_bars() as on_progress:
        made = evaluate(folder, command=command, on_progress=on_progress)
    for line in [*as_text(made), *(f"note: {remark}" for remark in made.remarks())]:
        click.echo(line)
    click.echo(f"wrote {', '.join(str(path) for path in write_report(made, folder))}")


def check_parameters(ctx: click.Context) -> None:
    """`ConfigError` for a data set of another kind, for none at all, and for other options."""
    kind = {"text2hoi": "actions", "both2hands": "bodies"}[ctx.params["generator"]]
    known = ACTION_DATASETS if kind == "actions" else ("synthetic",)
    for name, given in options.on_command_line().items():
        if name not in GO_WITH_IT:
            raise ConfigError(f"--generator: expected no {given} with it, got one; leave it out")
    if ctx.params["dataset"] not in known:
        raise ConfigError(
            f"--dataset: expected {', '.join(known)} with --generator {ctx.params['generator']}, "
            f"got {ctx.params['dataset']}; choose one, and make the {kind} of synthetic with "
            f"`geneoh synthesize --{kind}`"
        )
    if ctx.params["root"] is None:
        raise ConfigError(
            f"--root: expected a folder of {kind} with --generator, got none; "
            f"make one with `geneoh synthesize --{kind} -o FOLDER`, or name your copy of a data set"
        )
    for name, why in NOT_FOR_BODIES.items() if kind == "bodies" else ():
        if (value := ctx.params[name]) not in (None, "none"):
            raise ConfigError(
                f"--{name}: expected none with --generator both2hands, {why}, got {value}; "
                "leave it out"
            )
    if len(ctx.params["seeds"]) > 1:
        raise ConfigError("--seed: expected one with --generator, got several; name one")
