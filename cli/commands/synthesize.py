"""`geneoh synthesize`: synthetic interactions to learn from."""

from pathlib import Path
from typing import Any

import click

from .. import options, progress


@click.command()
@options.option("-o --output data: Folder to write to.", options.FOLDER, Path("runs/data"))
@options.flag(
    "--actions: Make actions with a verb, one or two hands and up to 5 seconds, from which "
    "`geneoh generate` is learned, instead of interactions to clean."
)
@options.option(
    "--count: Interactions to make.", options.COUNT, show_default="20480, or 8192 actions"
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
    actions: bool,
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
    shows a grasp of each family and of some meshes, and how deep its skin is in the object; there
    is none of actions. Settings are those of SynthesisConfig, such as grasps.steps=200 or
    animation.object.table_share=0.8, and of ActionSynthesisConfig, such as acting.left=0.5.
    """
    from functools import partial

    from geneoh.config import configured
    from geneoh.files.atomic import write_whole
    from geneoh.files.outputs import keep_others
    from geneoh.hand.library import load_hand
    from geneoh.synthesis.action_shards import DEFAULTS, synthesize_actions
    from geneoh.synthesis.scans import find_scans
    from geneoh.synthesis.shards import SynthesisConfig, synthesize_shard, write_shards
    from geneoh.viz.canvas import png_bytes
    from geneoh.viz.sheet import contact_sheet, one_of_each

    path = None if config is None else options.find_config(config)
    settings = settings if count is None else (*settings, f"count={count}")
    chosen = configured(DEFAULTS if actions else SynthesisConfig(), path, settings)
    make = synthesize_actions if actions else synthesize_shard
    hand, sheet = load_hand("right"), data / "sheet.png"
    keep_others(sheet, "choose another folder")
    with progress.progress_bars() as on_progress:
        scans = find_scans(data, meshes, unit, on_mesh=partial(on_progress, "objects"))
        on_shard = partial(on_progress, "shards")
        how = {"scans": scans, "jobs": jobs, "on_shard": on_shard, "synthesize": make}
        made = write_shards(data, chosen, hand, seed=seed, **how)
        if not actions and (made or not sheet.exists()):
            picture = contact_sheet(one_of_each(data, hand), on_step=partial(on_progress, "sheet"))
            write_whole(sheet, png_bytes(picture))
    kind = "actions each" if actions else f"interactions each; see {sheet}"
    click.echo(f"{data}: {made} shards made, of {chosen.shard} {kind}")
