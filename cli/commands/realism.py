"""`geneoh realism`: how near synthetic interactions are to a real recording."""

from pathlib import Path
from typing import Any

import click

from .. import options


@click.command()
@click.argument("recording", type=options.INPUT_FILE)
@options.obj
@options.data
@click.option("--lively", is_flag=True, help="With the unrest that training adds to made hands.")
@options.output
@options.side
@options.fps
def realism(
    recording: Path,
    obj: tuple[Path, ...],
    data: Path,
    lively: bool,
    output: Path | None,
    side: Any,
    fps: float | None,
) -> None:
    """Compare what `geneoh synthesize` made with a real RECORDING.

    Prints, for both, speed and acceleration of wrist and fingertips, joint angles, contact and
    penetration, and how well a classifier tells them apart on one second; -o writes it as JSON.
    """
    import json

    import geneoh
    from geneoh.evaluation.realism import compare_sides, real_side, synthetic_side, table
    from geneoh.files.atomic import write_whole
    from geneoh.hand.library import load_hand

    hand = load_hand("right")
    real = real_side(geneoh.load(recording, obj=obj, side=side, fps=fps), hand)
    report = compare_sides(real, synthetic_side(data, hand, lively=lively))
    for line in table(report):
        click.echo(line)
    if output is not None:
        write_whole(output, json.dumps(report.as_dict(), indent=2) + "\n")
        click.echo(f"wrote {output}")
