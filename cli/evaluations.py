"""`geneoh eval`: its options, their conversion for the library, and the scoring of generators."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click import Choice

from geneoh.choices import (
    ABLATIONS,
    ACTION_DATASETS,
    CASE_NOISES,
    DATASETS,
    GENERATORS,
    METHODS,
    ON_REQUEST,
    PRESETS,
    SEED_LIMITS,
)
from geneoh.errors import ConfigError, InputError

from . import options, progress
from .options import COUNT, FOLDER, flag, many, option

if TYPE_CHECKING:
    from geneoh.evaluation.options import EvaluationOptions
    from geneoh.evaluation.report import Evaluation

eval_options = options.together(
    option(
        "--dataset: Data set to score on; h2o goes with a generator alone.",
        Choice(tuple(dict.fromkeys((*DATASETS, *ACTION_DATASETS)))),
        required=True,
    ),
    option(
        "--generator: Score what this generator makes of sentences, instead of methods of "
        "cleaning, on the held-out clips of shards in --root that `geneoh synthesize --actions` "
        "(text2hoi) or --bodies (both2hands) made; text2hoi also on h2o, grab and arctic. "
        "--root, --refine, --limit, --seed, --mano, --weights, --set, --jobs and -o go with it.",
        Choice(GENERATORS),
    ),
    option(
        "--refine: geneoh also scores the generator's clips with hands mended by the cleaner, "
        "which takes several seconds a clip.",
        Choice(("geneoh", "none")),
        "none",
    ),
    option(
        "--root: Your copy of the data set; or set GENEOH_DATA_GRAB, _HOI4D, _ARCTIC or _TACO.",
        FOLDER,
    ),
    many(
        "--noise noises: Noise to put on the clips; may be repeated. `clean` adds none; "
        "`recorded` takes the recording as the noisy input.  [default: the data set's own]",
        Choice(CASE_NOISES),
    ),
    many(
        "--seed seeds: Seed of the noise and of the methods; may be repeated.  [default: 11, 22 "
        "and 77; 11 for synthetic; with a generator 0]",
        click.IntRange(*SEED_LIMITS),
    ),
    option("--limit: Largest number of clips.  [default: all; with a generator 256]", COUNT),
    many(
        "--method methods: Method to compare; may be repeated.  "
        f"[default: all but {' and '.join(ON_REQUEST)}]",
        Choice(METHODS),
    ),
    many("--preset presets: Preset of geneoh; may be repeated.", Choice(PRESETS), ("default",)),
    many(
        "--ablate ablations: Also score geneoh without this part; may be repeated.",
        Choice(ABLATIONS),
    ),
    many(
        "--predictions: Also score the results of another method: a folder of "
        "CLIP_NOISE_SEED.npz; may be repeated.",
        FOLDER,
    ),
    option("--inputs: Write the noisy clips to this folder, and score nothing.", FOLDER),
    option(
        "--twins noisy_inputs: Read the noisy clips from this folder instead of drawing noise.",
        FOLDER,
    ),
    option(
        "--close-frames: Frames of a clip in which intersection volume and contact on the object "
        "are measured.  [default: 20; 5 for synthetic]",
        COUNT,
    ),
    options.samples,
    options.selection,
    options.hand,
    options.mano,
    options.weights,
    options.device,
    many(
        "--set settings: Change a setting of the protocol, such as windows=whole; may be repeated.",
        metavar="NAME=VALUE",
    ),
    option(
        "-o --output folder: Folder for the scores and the report.  [default: runs/eval/DATASET, "
        "with a generator runs/eval/GENERATOR-DATASET]",
        FOLDER,
    ),
    options.jobs,
    flag("--fresh: Throw earlier scores and pages in the folder away."),
    flag("--pages: Also write a page in 3D of every clip that geneoh cleans."),
)
"""All options of `geneoh eval`."""

OF_GENEOH = ("presets", "ablations", "samples", "selection", "device", "pages")
LEARNED = {"toch", "regression", "one-call", "geneoh"}
"""Methods that have weights."""
OF_SCORES = (
    *OF_GENEOH,
    *("methods", "predictions", "close_frames", "hand", "weights", "folder", "jobs", "fresh"),
)
"""Parameters that apply only where geneoh is scored, and those only where anything is scored."""


def refuse_ignored(chosen: dict[str, Any], inputs: Path | None) -> None:
    """Refuse options that would be ignored, and a data set that only generators are scored on."""
    if (dataset := chosen["dataset"]) not in DATASETS:
        raise ConfigError(
            f"--dataset {dataset}: expected one of {', '.join(DATASETS)} without --generator, got "
            "one that only a generator is scored on; add --generator text2hoi and --root with your "
            "copy, or choose one of those"
        )
    options.refuse(["refine"], "needs --generator")
    if inputs is not None:
        options.refuse(OF_SCORES, "has no meaning with --inputs, which scores nothing")
    if chosen["methods"] and "geneoh" not in chosen["methods"]:
        used = {"device"} if "one-call" in chosen["methods"] else set[str]()
        options.refuse({*OF_GENEOH} - used, "needs --method geneoh too")
    if chosen["methods"] and LEARNED.isdisjoint(chosen["methods"]):
        options.refuse(["weights"], "needs a --method that has weights")
    if chosen["dataset"] == "synthetic":
        options.refuse(["root"], "has no meaning with --dataset synthetic, which needs no copy")


def evaluation_options(
    *, mano: Path | None, settings: tuple[str, ...], **chosen: Any
) -> "EvaluationOptions":
    """The options of the command line as `EvaluationOptions`."""
    from geneoh.config import configured
    from geneoh.evaluation.options import EvaluationOptions, ProtocolOptions
    from geneoh.nn.devices import named_device
    from geneoh.pipeline.options import Options

    named_device(chosen["device"])
    ours = {n: chosen.pop(n) for n in ("samples", "selection", "hand", "weights", "device")}
    protocol = configured(ProtocolOptions(mano_dir=mano), settings=settings)
    return EvaluationOptions(**chosen, protocol=protocol, cleaner=Options(**ours, mano_dir=mano))


def refuse_without_scores(made: "Evaluation", folder: Path) -> None:
    """`InputError` where every clip of some method failed; the report is already written."""
    scored = {score.method for score in made.scores if not score.failed}
    for method in made.methods:
        failed = [score.failed for score in made.scores if score.method == method]
        if method not in scored and failed:
            raise InputError(
                f"{method}: expected results that can be scored, got none of {len(failed)} (the "
                f"first: {failed[0]}); correct them and run the command again, "
                f"{folder / 'scores.csv'} has all reasons"
            )


def command_line(ctx: click.Context) -> str:
    """The command with the options that were given."""
    words = ["geneoh", ctx.command.name or ""]
    for name, given in options.on_command_line().items():
        value = ctx.params[name]
        for one in value if isinstance(value, tuple) else (value,):
            words += [given] if one is True else [given, str(one)]
    return shlex.join(words)


GO_WITH_IT = {
    *("generator", "dataset", "root", "refine", "limit", "seeds", "mano", "weights", "settings"),
    *("folder", "jobs"),
}
"""Parameters of `geneoh eval` that mean something for a generator."""
NOT_FOR_BODIES = {"refine": "whose hands hold nothing", "jobs": "which works in one process"}
"""Those of `GO_WITH_IT` that have no meaning for hands of a body, and why."""


def score_generator(ctx: click.Context) -> None:
    """Score the generator that the command line names, write the report and print it."""
    from functools import partial

    from geneoh.config import configured
    from geneoh.evaluation.generation.report import (
        keep_other_generation_reports,
        write_generation_report,
    )
    from geneoh.evaluation.generation.runner import GenerationOptions, evaluate_generator
    from geneoh.evaluation.gestures.runner import GestureOptions, evaluate_gestures
    from geneoh.workers.pool import cores

    check_parameters(ctx)
    values = ctx.params
    given = {"limit": values["limit"], "seed": next(iter(values["seeds"]), None)}
    chosen = {name: value for name, value in given.items() if value is not None}
    chosen["weights"] = values["weights"]
    root, settings = values["root"], values["settings"]
    if values["generator"] == "both2hands":
        hands = configured(GestureOptions(root, **chosen), settings=settings)
        evaluate = partial(evaluate_gestures, hands)
    else:
        data = {name: values[name] for name in ("dataset", "refine", "mano")}
        actions = GenerationOptions(root, **data, **chosen)
        scored = configured(actions, settings=settings)
        evaluate = partial(evaluate_generator, scored, jobs=values["jobs"] or cores())
    folder = values["folder"] or Path("runs", "eval", f"{values['generator']}-{values['dataset']}")
    keep_other_generation_reports(folder)
    command = command_line(ctx)
    with progress.progress_bars() as on_progress:
        made = evaluate(folder, command=command, on_progress=on_progress)
    click.echo(made)
    click.echo(f"wrote {', '.join(str(path) for path in write_generation_report(made, folder))}")


def check_parameters(ctx: click.Context) -> None:
    """`ConfigError` for options without meaning for a generator, a wrong data set, or no data."""
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
    if ctx.params["dataset"] == "synthetic":
        options.refuse(["mano"], f"is for recordings, got {kind} of `geneoh synthesize`")
    if len(ctx.params["seeds"]) > 1:
        raise ConfigError("--seed: expected one with --generator, got several; name one")
