"""`geneoh realism`: how near synthetic interactions are to a real recording."""

from pathlib import Path
from typing import Any

import click

from .. import options


@click.command()
@click.argument("recording", type=options.FILE)
@options.obj
@options.data
@options.flag(
    "--augmented: Compare the synthetic hands with the augmentation that training puts on them."
)
@options.output
@options.reading
@options.bare
def realism(
    recording: Path,
    obj: tuple[Path, ...],
    data: Path,
    mano: Path | None,
    output: Path | None,
    overwrite: bool,
    **reading: Any,
) -> None:
    """Compare what `geneoh synthesize` made with a real RECORDING.

    Prints, for both, speed and acceleration of wrist and fingertips, joint angles, contact and
    penetration, and the accuracy of a classifier that separates them on snippets of one second; -o
    writes it as JSON.
    """
    from dataclasses import asdict

    import geneoh
    from geneoh.evaluation.realism import measure_realism, table
    from geneoh.files.atomic import write_whole
    from geneoh.files.outputs import check_outputs
    from geneoh.files.text import json_text

    if output is not None:
        read = [recording, *obj, data]
        check_outputs([output], endings=(".json",), inputs=read, overwrite=overwrite)
    augmented = reading.pop("augmented")
    sequence = geneoh.load(recording, obj=obj, mano_dir=mano, **reading)
    report = measure_realism(sequence, data, augmented=augmented)
    for line in table(report):
        click.echo(line)
    if output is not None:
        whole = {"generator": "geneoh realism", **asdict(report)}
        write_whole(output, json_text(whole, indent=2) + "\n")
        click.echo(f"wrote {output}")
