"""What `geneoh eval` was asked, as the library takes it and as a line to repeat."""

import shlex
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from geneoh.config import configured
from geneoh.evaluation.plan import Choices
from geneoh.evaluation.protocols import ProtocolOptions
from geneoh.pipeline.denoise import Options


def choices_of(
    *,
    samples: int | None,
    selection: Any,
    hand: Any,
    mano: Path | None,
    weights: Path | None,
    settings: tuple[str, ...],
    **asked: Any,
) -> Choices:
    """The command's options as one value."""
    return Choices(
        **asked,
        protocol=configured(ProtocolOptions(mano_dir=mano), settings=settings),
        options=Options(
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
