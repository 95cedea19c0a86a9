"""Options that several commands share, with one meaning and one help text each."""

from pathlib import Path

import click

INPUT_FILE = click.Path(exists=False, dir_okay=False, path_type=Path)
"""A file to read. That it is there is checked on reading, which says more about what is wrong."""

output = click.option(
    *("-o", "--output"),
    type=click.Path(dir_okay=False, path_type=Path),
    help="File to write; replaced in one step when all is done.",
)
seed = click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of all randomness."
)
side = click.option(
    "--side",
    type=click.Choice(["left", "right"]),
    help="Which hand, where the file does not say; of two hands, the one to take.",
)
fps = click.option("--fps", type=float, help="Frames a second, where the file does not say.")
mano = click.option(
    "--mano",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder of your MANO_RIGHT.pkl and MANO_LEFT.pkl; otherwise GENEOH_MANO_DIR says where.",
)
