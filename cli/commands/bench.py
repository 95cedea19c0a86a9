"""`geneoh bench`: how fast this machine cleans, and how much memory that takes."""

from pathlib import Path
from typing import Any

import click
from click import Choice, IntRange

from geneoh.bench.run import FULL, QUICK, TRIANGLES, Bench, Point, run_bench

from .. import options, progress
from ..environment import devices, versions
from ..options import COUNT, FILE, FOLDER, flag, many, option


@click.command()
@many("--frames: Number of frames, along the first axis. May be repeated, like other axes.", COUNT)
@many("--samples: Number of samples.", COUNT)
@many("--triangles: Number of triangles of the object.", IntRange(TRIANGLES, 2_000_000))
@many("--batch clips: Number of clips, cleaned by the workers of `geneoh batch`.", COUNT)
@flag("--full: Measure a larger grid, which takes hours: up to 54,000 frames.")
@flag("--no-paper: Leave out networks of the paper's sizes.")
@options.preset
@options.device
@option("--threads: Number of threads.  [default: torch's]", COUNT)
@option(
    "--by: Time in the tables: by the clock, or of the processor, which other work on the machine "
    "hardly changes.",
    Choice(["clock", "processor"]),
    "clock",
)
@option("--tree: Checkout of another version, to measure beside this one.", FOLDER)
@option(
    "-o --output: JSON file to keep. A run that is started again measures what it does not have.",
    FILE,
    Path("bench.json"),
)
@option("--plot: PNG to draw, by matplotlib.", FILE)
@flag("--fresh: Measure anew what the JSON file has.")
@options.overwrite
def bench(
    full: bool,
    no_paper: bool,
    by: str,
    tree: Path | None,
    output: Path,
    plot: Path | None,
    fresh: bool,
    overwrite: bool,
    threads: int | None,
    **chosen: Any,
) -> None:
    """Measure speed and memory on this machine.

    Prints frames a second and the peak of memory, by stage, against the number of frames, samples,
    triangles and clips, one axis at a time around 180 frames of the example recording; beside it,
    networks of the sizes that the paper publishes, timed by the step. Without any axis a grid of
    ten minutes on two cores. Each point has a process of its own.
    """
    import torch

    from geneoh.bench.report import check_plot, tables, write_plot
    from geneoh.denoisers.library import all_weights
    from geneoh.errors import ConfigError
    from geneoh.files.fingerprints import file_digests
    from geneoh.files.outputs import check_ending, check_outputs
    from geneoh.nn.devices import named_device
    from geneoh.pipeline.presets import preset
    from geneoh.workers.pool import cores

    axes = {axis: values for axis in QUICK if (values := chosen.pop(axis))}
    if axes and full:
        raise ConfigError(f"--full is a grid of its own; leave it or {', '.join(axes)} out")
    named_device(chosen["device"])
    check_ending(output, (".json",))
    check_outputs([output, *check_plot(plot)], overwrite=overwrite)
    few = preset(chosen["preset"]).samples
    base = Point(samples=few, threads=threads or torch.get_num_threads(), **chosen)
    grid = Bench(base, axes or (FULL if full else QUICK), not no_paper, tree)
    machine = {"cores": cores(), "gpus": {k: v for k, v in devices().items() if k != "cpu"}}
    environment = {**machine, "versions": versions(), "weights": file_digests(all_weights(None))}
    with progress.progress_bars() as on_progress:
        found = run_bench(grid, environment, output, fresh=fresh, on_progress=on_progress)
    for line in tables(grid, found, by):
        click.echo(line)
    if plot is not None:
        write_plot(plot, grid, found, by)
    click.echo(f"wrote {output}" + (f" and {plot}" if plot is not None else ""))
