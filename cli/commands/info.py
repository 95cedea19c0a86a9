"""`geneoh info`: what this installation has, for a bug report or a first look."""

from pathlib import Path

import click

from .. import options


@click.command()
@options.mano
def info(mano: Path | None) -> None:
    """Show versions, devices, hand models and weights."""
    from .. import environment

    parts = {
        "Versions": environment.versions(),
        "Devices": environment.devices(),
        "Hands": environment.hands(mano),
        "Weights": environment.weights(),
    }
    for title, lines in parts.items():
        click.echo(title)
        for line in lines:
            click.echo(f"  {line}")
