"""Options that several commands share, with one meaning and one help text each."""

from importlib.resources import files
from pathlib import Path

import click

from geneoh.choices import SIDES
from geneoh.errors import ConfigError

INPUT_FILE = click.Path(dir_okay=False, path_type=Path)
"""A file to read. That it is there is checked on reading, which says more about what is wrong."""

obj = click.option(
    "--obj",
    type=INPUT_FILE,
    multiple=True,
    required=True,
    help="Mesh of the object in metres; once per rigid part, in the order of the parts.",
)
obj_or_source = click.option(
    "--obj",
    type=INPUT_FILE,
    multiple=True,
    help="Mesh of the object in metres; once per rigid part, in the order of the parts. Needed "
    "unless --from names a source that has its own.",
)
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
    type=click.Choice(SIDES),
    help="Which hand, where the file does not say; of two hands, the one to take.",
)
fps = click.option("--fps", type=float, help="Frames a second, where the file does not say.")
mano = click.option(
    "--mano",
    type=click.Path(file_okay=False, path_type=Path),
    envvar="GENEOH_MANO_DIR",
    show_envvar=True,
    help="Folder of your MANO_RIGHT.pkl and MANO_LEFT.pkl.",
)
device = click.option(
    "--device", default="cpu", show_default=True, help="cpu, cuda, or cuda:N for the Nth GPU."
)
weights = click.option(
    "--weights",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder of motion, spatial and temporal.safetensors, instead of the shipped ones.",
)
folder = click.option(
    *("-o", "--output", "folder"),
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("runs"),
    show_default=True,
    help="Folder to write to.",
)
data = click.option(
    "--data",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("runs/data"),
    show_default=True,
    help="Folder of interactions, as `geneoh synthesize` makes it.",
)
config = click.option(
    "--config", metavar="NAME|PATH", help="A configuration that geneoh ships, or a TOML file."
)
settings = click.option(
    *("--set", "settings"),
    multiple=True,
    metavar="NAME=VALUE",
    help="Change one value of the configuration, such as motion.depth=6; may be repeated.",
)


def find_config(name: str) -> Path:
    """The TOML file of a configuration by its path, or by the name it ships under."""
    if name.endswith(".toml"):
        return Path(name)
    shipped = {
        Path(file.name).stem: Path(str(file))
        for file in files(f"{__package__}.configs").iterdir()
        if file.name.endswith(".toml")
    }
    if name not in shipped:
        known = ", ".join(sorted(shipped)) or "no name at all"
        raise ConfigError(f"--config {name}: expected {known}, or the path of a .toml file")
    return shipped[name]
