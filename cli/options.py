"""Options that several commands share, each with one meaning and one help text."""

from collections.abc import Callable
from functools import reduce
from importlib.resources import files
from pathlib import Path
from typing import Any

import click

from geneoh.choices import PRESETS, RESULT_HANDS, SELECTIONS, SIDES, UNITS
from geneoh.errors import ConfigError

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def together(*decorators: Decorator) -> Decorator:
    """One decorator that adds several options to a command, in this order."""

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        return reduce(lambda made, decorator: decorator(made), reversed(decorators), command)

    return add


INPUT_FILE = click.Path(dir_okay=False, path_type=Path)
"""A file to read. Reading checks that it exists, because its error says more."""
FOLDER = click.Path(file_okay=False, path_type=Path)

OBJ_HELP = (
    "Mesh file of the object, in metres. Repeat it for each rigid part, in order of the parts."
)


class Place(click.ParamType):
    """A point of the world, metres, as X,Y,Z or `origin`."""

    name = "X,Y,Z|origin"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, ...]:
        """Three numbers."""
        try:
            x, y, z = (0.0, 0.0, 0.0) if value == "origin" else map(float, value.split(","))
        except ValueError:
            self.fail(f"expected three numbers X,Y,Z in metres, or origin, got {value!r}")
        return x, y, z


camera = click.option(
    "--camera",
    type=Place(),
    help="Position of the camera, metres, for hands that were estimated from its images; origin "
    "where the coordinates are the camera's. Estimators err along its rays.",
)
unit = click.option(
    "--unit",
    type=click.Choice(UNITS),
    default="m",
    show_default=True,
    help="Unit of the meshes of --obj, where it is not metres.",
)
obj = click.option("--obj", type=INPUT_FILE, multiple=True, required=True, help=OBJ_HELP)
obj_or_source = click.option(
    "--obj",
    type=INPUT_FILE,
    multiple=True,
    help=f"{OBJ_HELP} Not needed where the file, or the source of --from, has its own; without any "
    "mesh nothing of contact is known.",
)
output = click.option(
    *("-o", "--output"),
    type=click.Path(dir_okay=False, path_type=Path),
    help="File to write. One that geneoh wrote before is replaced when the new one is complete.",
)
overwrite = click.option(
    "--overwrite",
    is_flag=True,
    help="Also replace files that geneoh did not write. Inputs are never replaced.",
)
preset = click.option(
    "--preset",
    type=click.Choice(PRESETS),
    default="default",
    show_default=True,
    help="Settings to clean with: our best, the paper's, or faster ones.",
)
samples = click.option(
    "--samples",
    type=click.IntRange(min=1),
    help="Number of samples that the diffusion draws.  [default: the preset's]",
)
selection = click.option(
    *("--select", "selection"),
    type=click.Choice(SELECTIONS),
    help="Which sample becomes the result: the one closest to the input, or the mean of all "
    "samples.  [default: the preset's]",
)
hand = click.option(
    "--hand",
    type=click.Choice(RESULT_HANDS),
    default="embedded",
    show_default=True,
    help="Hand model of the result.",
)
seed = click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of every random draw; the same seed gives the same file.",
)
side = click.option(
    "--side",
    type=click.Choice(SIDES),
    help="Side of the hand, where the file does not say; of two hands, the one to read.",
)
fps = click.option("--fps", type=float, help="Frames per second, where the file does not say.")
mano = click.option(
    "--mano",
    type=FOLDER,
    envvar="GENEOH_MANO_DIR",
    show_envvar=True,
    help="Folder that holds your MANO_RIGHT.pkl and MANO_LEFT.pkl.",
)
device = click.option(
    "--device",
    default="cpu",
    show_default=True,
    help="Device to compute on: cpu, cuda, or cuda:N for GPU number N.",
)
weights = click.option(
    "--weights",
    type=FOLDER,
    help="Folder of weights to use instead of the shipped ones: motion.safetensors, "
    "spatial.safetensors and temporal.safetensors.",
)
folder = click.option(
    *("-o", "--output", "folder"),
    type=FOLDER,
    default=Path("runs"),
    show_default=True,
    help="Folder to write to.",
)
data = click.option(
    "--data",
    type=FOLDER,
    default=Path("runs/data"),
    show_default=True,
    help="Folder of interactions that `geneoh synthesize` made.",
)
config = click.option(
    "--config",
    metavar="NAME|PATH",
    help="Configuration: the name of a shipped one, or the path of a TOML file.",
)
settings = click.option(
    *("--set", "settings"),
    multiple=True,
    metavar="NAME=VALUE",
    help="Change one value of the configuration, such as motion.depth=6. May be repeated.",
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
