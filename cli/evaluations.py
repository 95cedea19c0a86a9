"""The options of `geneoh eval`, as the library takes them, and the command as a line to repeat."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from geneoh.choices import ABLATIONS, CASE_NOISES, DATASETS, METHODS, PRESETS

from . import options

if TYPE_CHECKING:
    from geneoh.evaluation.options import EvaluationOptions

POSITIVE = click.IntRange(min=1)

eval_options = options.together(
    click.option(
        "--dataset", type=click.Choice(DATASETS), required=True, help="Data set to score on."
    ),
    click.option(
        "--root",
        type=options.FOLDER,
        help="Your copy of the data set; or set GENEOH_DATA_GRAB, _HOI4D, _ARCTIC or _TACO.",
    ),
    click.option(
        *("--noise", "noises"),
        type=click.Choice(CASE_NOISES),
        multiple=True,
        help="Noise to put on the clips; may be repeated. `clean` adds none; `recorded` takes the "
        "recording as the noisy input.  [default: the data set's own]",
    ),
    click.option(
        *("--seed", "seeds"),
        type=click.IntRange(min=0),
        multiple=True,
        help="Seed of the noise and of the methods; may be repeated.  [default: 11, 22 and 77; 11 "
        "for synthetic]",
    ),
    click.option("--limit", type=POSITIVE, help="Largest number of clips."),
    click.option(
        *("--method", "methods"),
        type=click.Choice(METHODS),
        multiple=True,
        help="Method to compare; may be repeated.  [default: all but gaussian and one-euro]",
    ),
    click.option(
        *("--preset", "presets"),
        type=click.Choice(PRESETS),
        multiple=True,
        default=("default",),
        show_default=True,
        help="Preset of geneoh; may be repeated.",
    ),
    click.option(
        *("--ablate", "ablations"),
        type=click.Choice(ABLATIONS),
        multiple=True,
        help="Also score geneoh without this part; may be repeated.",
    ),
    click.option(
        "--predictions",
        type=options.FOLDER,
        multiple=True,
        help="Also score the results of another method: a folder of CLIP_NOISE_SEED.npz; may be "
        "repeated.",
    ),
    click.option(
        "--inputs",
        type=options.FOLDER,
        help="Write the noisy clips to this folder, and score nothing.",
    ),
    click.option(
        *("--twins", "noisy_inputs"),
        type=options.FOLDER,
        help="Read the noisy clips from this folder instead of drawing noise.",
    ),
    click.option(
        "--close-frames",
        type=POSITIVE,
        help="Frames of a clip in which intersection volume and contact on the object are "
        "measured.  [default: 20; 5 for synthetic]",
    ),
    options.samples,
    options.selection,
    options.hand,
    options.mano,
    options.weights,
    click.option(
        *("--set", "settings"),
        multiple=True,
        metavar="NAME=VALUE",
        help="Change a setting of the protocol, such as windows=whole; may be repeated.",
    ),
    click.option(
        *("-o", "--output", "folder"),
        type=options.FOLDER,
        help="Folder for the scores and the report.  [default: runs/eval/DATASET]",
    ),
    click.option(
        "--jobs", type=POSITIVE, help="Number of processes.  [default: one for each core]"
    ),
    click.option("--fresh", is_flag=True, help="Throw earlier scores in the folder away."),
    click.option(
        "--pages", is_flag=True, help="Also write a page in 3D of every clip that geneoh cleans."
    ),
)
"""All options of `geneoh eval`."""


def evaluation_options(
    *,
    samples: int | None,
    selection: Any,
    hand: Any,
    mano: Path | None,
    weights: Path | None,
    settings: tuple[str, ...],
    **asked: Any,
) -> "EvaluationOptions":
    """What was asked for, as the library takes it."""
    from geneoh.config import configured
    from geneoh.evaluation.options import EvaluationOptions
    from geneoh.evaluation.protocols import ProtocolOptions
    from geneoh.pipeline.options import Options

    return EvaluationOptions(
        **asked,
        protocol=configured(ProtocolOptions(mano_dir=mano), settings=settings),
        cleaner=Options(
            samples=samples, selection=selection, hand=hand, mano_dir=mano, weights=weights
        ),
    )


def command_line(ctx: click.Context) -> str:
    """The command with the options that were given."""
    words = ["geneoh", ctx.command.name or ""]
    for parameter in ctx.command.params:
        name = parameter.name or ""
        if ctx.get_parameter_source(name) is not ParameterSource.COMMANDLINE:
            continue
        value = ctx.params[name]
        flag = max(parameter.opts, key=len)
        if value is True:
            words.append(flag)
            continue
        for one in value if isinstance(value, tuple) else (value,):
            words += [flag, str(one)]
    return shlex.join(words)
