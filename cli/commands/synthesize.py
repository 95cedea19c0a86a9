"""`geneoh synthesize`: synthetic interactions to learn from."""

from pathlib import Path
from typing import Any

import click

from .. import options


@click.command()
@click.option(
    *("-o", "--output", "data"),
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("runs/data"),
    show_default=True,
    help="Folder to write to.",
)
@click.option(
    "--count",
    type=click.IntRange(min=1),
    show_default="20480",
    help="Interactions to make, 4 seconds each.",
)
@click.option(
    *("--objects", "meshes"),
    type=options.FOLDER,
    help="Folder of meshes to be held beside the made objects, such as scans of your own; names in "
    "its held_out.txt are for validation alone.",
)
@options.unit
@options.config
@options.settings
@options.seed
def synthesize(
    data: Path,
    count: int | None,
    meshes: Path | None,
    unit: Any,
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
    from geneoh.files.outputs import keep_others
    from geneoh.hand.library import load_hand
    from geneoh.synthesis.scans import find_scans
    from geneoh.synthesis.shards import SynthesisConfig, write_shards
    from geneoh.viz.canvas import save_picture
    from geneoh.viz.sheet import contact_sheet, one_of_each

    from .. import progress

    path = None if config is None else options.find_config(config)
    settings = settings if count is None else (*settings, f"count={count}")
    chosen = configured(SynthesisConfig(), path, settings)
    hand, sheet = load_hand("right"), data / "sheet.png"
    keep_others(sheet, "choose another folder")
    with progress.progress_bars() as on_progress:
        scans = find_scans(data, meshes, unit, on_mesh=partial(on_progress, "objects"))
        on_shard = partial(on_progress, "shards")
        made = write_shards(data, chosen, hand, seed=seed, scans=scans, on_shard=on_shard)
        if made or not sheet.exists():
            clips = one_of_each(data, hand)
            save_picture(contact_sheet(clips, on_step=partial(on_progress, "sheet")), sheet)
    click.echo(f"{data}: {made} shards made, of {chosen.shard} interactions each; see {sheet}")
