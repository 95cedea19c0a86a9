"""The options of `geneoh eval`, as the library takes them, and the command as a line to repeat."""

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
    PRESETS,
    SEED_LIMITS,
)
from geneoh.errors import ConfigError, InputError

from . import options
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
        "--refine, --limit, --seed, --mano, --weights, --set and -o go with it.",
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
        "and 77; 11 for synthetic]",
        click.IntRange(*SEED_LIMITS),
    ),
    option("--limit: Largest number of clips.", COUNT),
    many(
        "--method methods: Method to compare; may be repeated.  [default: all but gaussian and "
        "one-euro]",
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
    many(
        "--set settings: Change a setting of the protocol, such as windows=whole; may be repeated.",
        metavar="NAME=VALUE",
    ),
    option(
        "-o --output folder: Folder for the scores and the report.  [default: runs/eval/DATASET]",
        FOLDER,
    ),
    option("--jobs: Number of processes.  [default: one for each core]", COUNT),
    flag("--fresh: Throw earlier scores and pages in the folder away."),
    flag("--pages: Also write a page in 3D of every clip that geneoh cleans."),
)
"""All options of `geneoh eval`."""

OF_GENEOH = ("presets", "ablations", "samples", "selection", "pages")
LEARNED = {"toch", "regression", "one-call", "geneoh"}
"""Methods that have weights."""
OF_SCORES = (
    *OF_GENEOH,
    *("methods", "predictions", "close_frames", "hand", "weights", "folder", "jobs", "fresh"),
)
"""Parameters that mean something only where geneoh is scored, and only where anything is."""


def refuse_unused(asked: dict[str, Any], inputs: Path | None) -> None:
    """Refuse a data set of generators alone and, by name, options that would be ignored."""
    if (dataset := asked["dataset"]) not in DATASETS:
        raise ConfigError(
            f"--dataset {dataset}: expected one of {', '.join(DATASETS)} without --generator, got "
            "one that only a generator is scored on; add --generator text2hoi and --root with your "
            "copy, or choose one of those"
        )
    options.refuse(["refine"], "needs --generator")
    if inputs is not None:
        options.refuse(OF_SCORES, "has no meaning with --inputs, which scores nothing")
    if asked["methods"] and "geneoh" not in asked["methods"]:
        options.refuse(OF_GENEOH, "needs --method geneoh too")
    if asked["methods"] and LEARNED.isdisjoint(asked["methods"]):
        options.refuse(["weights"], "needs a --method that has weights")
    if asked["dataset"] == "synthetic":
        options.refuse(["root"], "has no meaning with --dataset synthetic, which needs no copy")


def evaluation_options(
    *, mano: Path | None, settings: tuple[str, ...], **asked: Any
) -> "EvaluationOptions":
    """What was asked for, as the library takes it."""
    from geneoh.config import configured
    from geneoh.evaluation.options import EvaluationOptions, ProtocolOptions
    from geneoh.pipeline.options import Options

    ours = {name: asked.pop(name) for name in ("samples", "selection", "hand", "weights")}
    protocol = configured(ProtocolOptions(mano_dir=mano), settings=settings)
    return EvaluationOptions(**asked, protocol=protocol, cleaner=Options(**ours, mano_dir=mano))


def refuse_without_scores(made: "Evaluation", folder: Path) -> None:
    """End a run in which every clip of some method failed with an error, its report written."""
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
