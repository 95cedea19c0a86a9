"""`geneoh synthesize`: synthetic interactions to learn from."""

from pathlib import Path
from typing import Any

import click

from geneoh.choices import UNITS
from geneoh.errors import numbered

from .. import options, progress


@click.command()
@options.option("-o --output data: Folder to write to.", options.FOLDER, Path(options.INTERACTIONS))
@options.flag(
    "--actions: Make actions with a verb, one or two hands and up to 5 seconds, from which "
    "`geneoh generate` is learned, instead of interactions to clean."
)
@options.flag(
    "--bodies: Make bodies that gesture, with fingers and sentences for either hand, from which "
    "`geneoh generate --body` is learned."
)
@options.option(
    "--with-actions holding: With --bodies: folder of --actions; a quarter of the bodies do these.",
    options.FOLDER,
)
@options.option(
    "--count: Clips to make, rounded up to whole shards (`--set shard`), of which there are two or "
    "more.",
    options.COUNT,
    show_default="20480, 8192 actions or 16384 bodies",
)
@options.option(
    "--objects meshes: Folder of meshes to be held beside the made objects, such as scans of "
    "your own; names in its held_out.txt are for validation alone.",
    options.FOLDER,
)
@options.option(
    "--unit: Unit of the meshes of --objects, where it is not metres.", click.Choice(UNITS), "m"
)
@options.option(
    "--jobs: Number of processes; with 1, this one with all its threads.", options.COUNT, 1
)
@options.config_and_settings
@options.seed
def synthesize(
    data: Path,
    actions: bool,
    bodies: bool,
    holding: Path | None,
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
    Some object families, and some ways of making gestures, are held out for the validation shards.
    The file sheet.png in the folder shows a grasp of each family and of some meshes, and how deep
    its skin is in the object, or a body that makes each gesture; there is none of actions. Settings
    are those of SynthesisConfig, such as grasps.steps=200 or animation.object.table_share=0.8, of
    ActionSynthesisConfig, such as acting.left=0.5, and of GestureConfig, such as
    body.shares.walking=0.3.
    """
    from functools import partial

    from geneoh.config import configured
    from geneoh.files.atomic import write_whole
    from geneoh.files.outputs import keep_others
    from geneoh.synthesis.action_shards import UNREAD
    from geneoh.synthesis.kinds import kind_of_data
    from geneoh.synthesis.replay import NoFirstGraspsError
    from geneoh.synthesis.shards import ANY_OBJECTS, ShardRecord, refuse_other_shards, write_shards
    from geneoh.training.run_config import refuse_settings
    from geneoh.viz.canvas import png_bytes
    from geneoh.viz.sheet import sheet_of

    options.refuse_unit_without(meshes, "--objects")
    if meshes is None:
        refuse_settings("scanned", settings, "--objects")
    if holding is None:
        refuse_settings("handling", settings, "--with-actions")
    for name in UNREAD if actions else ():
        refuse_settings(name, settings, "interactions")
    path = None if config is None else options.find_config(config)
    settings = settings if count is None else (*settings, f"count={count}")
    data_kind = kind_of_data(actions, bodies, meshes, holding)
    kind = data_kind.defaults.kind
    chosen = configured(data_kind.defaults, path, settings)
    chosen.check_size()
    sheet = data / "sheet.png"
    keep_others(sheet)
    if meshes is not None:  # before they are built, which takes long and leaves their file
        refuse_other_shards(data, ShardRecord(chosen, seed, ANY_OBJECTS))
    with progress.progress_bars() as on_progress:
        source = data_kind.source(data, unit, partial(on_progress, "objects"))
        how = {"jobs": jobs, "on_shard": partial(on_progress, "shards")}
        how |= {"scans": source, "synthesize": data_kind.synthesize}
        made = write_shards(data, chosen, seed=seed, **how)
        lacking = ""
        if (made or not sheet.exists()) and kind != "actions":
            try:
                picture = sheet_of(kind, data, partial(on_progress, "sheet"))
                write_whole(sheet, png_bytes(picture))
            except NoFirstGraspsError as error:  # the clips are whole without it
                lacking = f"note: no sheet is drawn of {error}"
    if lacking:
        click.echo(lacking)
    seen = f"; see {sheet}" if sheet.exists() else ""
    click.echo(f"{data}: {numbered(made, 'shard')} made, of {chosen.shard} {kind} each{seen}")
