"""`geneoh synthesize`: synthetic interactions to learn from."""

from pathlib import Path
from typing import Any

import click

from .. import options, progress


@click.command()
@options.option("-o --output data: Folder to write to.", options.FOLDER, Path("runs/data"))
@options.option(
    "--count: Interactions to make, 4 seconds each.", options.COUNT, show_default="20480"
)
@options.option(
    "--objects meshes: Folder of meshes to be held beside the made objects, such as scans of "
    "your own; names in its held_out.txt are for validation alone.",
    options.FOLDER,
)
@options.unit
@options.option(
    "--jobs: Number of processes; with 1, this one with all its threads.", options.COUNT, 1
)
@options.config_and_settings
@options.seed
def synthesize(
    data: Path,
    count: int | None,
    meshes: Path | None,
    unit: Any,
    jobs: int,
    config: str | None,
    settings: tuple[str, ...],
    seed: int,
) -> None:
    """Make synthetic hand-object interactions, in shards that `geneoh train` reads.

    An interrupted run continues when it is started again with the same folder, settings and seed.
    Some object families are held out for the validation shards. The file sheet.png in the folder
    shows a grasp of each family and of some meshes, and how deep its skin is in the object.
    Settings are those of SynthesisConfig, such as grasps.steps=200 or
    animation.object.table_share=0.8.
    """
    from functools import partial

    from geneoh.config import configured
    from geneoh.files.atomic import write_whole
    from geneoh.files.outputs import keep_others
    from geneoh.hand.library import load_hand
    from geneoh.synthesis.scans import find_scans
    from geneoh.synthesis.shards import SynthesisConfig, write_shards
    from geneoh.viz.canvas import png_bytes
    from geneoh.viz.sheet import contact_sheet, one_of_each

    path = None if config is None else options.find_config(config)
    settings = settings if count is None else (*settings, f"count={count}")
    chosen = configured(SynthesisConfig(), path, settings)
    hand, sheet = load_hand("right"), data / "sheet.png"
    keep_others(sheet, "choose another folder")
    with progress.progress_bars() as on_progress:
        scans = find_scans(data, meshes, unit, on_mesh=partial(on_progress, "objects"))
        on_shard = partial(on_progress, "shards")
        made = write_shards(
            data, chosen, hand, seed=seed, scans=scans, jobs=jobs, on_shard=on_shard
        )
        if made or not sheet.exists():
            picture = contact_sheet(one_of_each(data, hand), on_step=partial(on_progress, "sheet"))
            write_whole(sheet, png_bytes(picture))
    click.echo(f"{data}: {made} shards made, of {chosen.shard} interactions each; see {sheet}")
