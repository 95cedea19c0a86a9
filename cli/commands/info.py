"""`geneoh info`: versions, devices, hand models and weights of this installation."""

from pathlib import Path

import click

from .. import options


@click.command()
@options.flag("--json as_json: Print all details as one JSON object.")
@options.mano
def info(mano: Path | None, as_json: bool) -> None:
    """Show versions, devices, hand models and weights of the cleaner.

    With --json also weights of the generators, and how all were trained.
    """
    from geneoh.files.text import json_text

    from .. import environment

    found = environment.facts(mano)
    if as_json:
        click.echo(json_text(found, indent=2))
        return
    for line in environment.facts_as_text(found):
        click.echo(line)
