"""Options that several commands share, each with one meaning and one help text."""

from collections.abc import Callable, Collection
from dataclasses import fields
from functools import partial, reduce
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click import Choice
from click.core import ParameterSource

from geneoh.choices import (
    JOINT_ORDERS,
    PRESETS,
    RESULT_HANDS,
    SEED_LIMITS,
    SELECTIONS,
    SIDES,
    UNITS,
)
from geneoh.errors import ConfigError

if TYPE_CHECKING:
    from geneoh.pipeline.options import Options

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def together(*decorators: Decorator) -> Decorator:
    """One decorator that adds several options to a command, in this order."""

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        return reduce(lambda made, decorator: decorator(made), reversed(decorators), command)

    return add


def on_command_line() -> dict[str, str]:
    """The options and arguments of the command line, by the names of their parameters.

    Environment variables do not count, because they are set for all commands.
    """
    context = click.get_current_context()
    return {
        parameter.name: _shown(parameter)
        for parameter in context.command.params
        if parameter.name
        and context.get_parameter_source(parameter.name) is ParameterSource.COMMANDLINE
    }


def _shown(parameter: click.Parameter) -> str:
    """A parameter as the help names it, an option by its long name."""
    if isinstance(parameter, click.Argument):
        return parameter.human_readable_name
    return max(parameter.opts, key=len)


def refuse(names: Collection[str], why: str) -> None:
    """Refuse the options of some parameters on the command line, which would be ignored."""
    for name, given in on_command_line().items():
        if name in names:
            raise click.UsageError(f"{given} {why}; leave it out")


def refuse_unit_without(meshes: Any, option: str = "--obj") -> None:
    """Refuse --unit without meshes of an option: those that files or sources name are in metres."""
    if not meshes:
        refuse(["unit"], f"is of the meshes of {option}, which is not given")


FILE = click.Path(dir_okay=False, path_type=Path)
"""A file to read or to write. Click does not check that it exists: our own message says more."""
FILE_OR_FOLDER = click.Path(path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
COUNT = click.IntRange(min=1)


def option(text: str, kind: Any = None, default: Any = None, **how: Any) -> Decorator:
    """An option from a text "NAMES: HELP", with the type of its value and its default.

    Of the names, such as "-o --output folder", the one without dashes is the parameter's.
    """
    names, _, help_text = text.partition(": ")
    if not how.get("required"):  # click takes a default, even None, for a passed value
        how["default"] = default
    return click.option(*names.split(), help=help_text, type=kind, **how)


many = partial(option, multiple=True)
"""An option that may be repeated."""
flag = partial(option, is_flag=True, default=False)

OBJ_HELP = (
    "Mesh file of the object, in metres. Repeat it for each rigid part, in order of the parts."
)


class Place(click.ParamType):
    """A point of the world, metres, as X,Y,Z or `origin`."""

    name = "X,Y,Z|origin"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, ...]:
        """Three numbers."""
        from geneoh.errors import InputError
        from geneoh.readers.base import place_in

        try:
            return place_in(value)
        except InputError as error:
            self.fail(str(error))


camera = option(
    "--camera: Position of the camera, metres, for hands that were estimated from its "
    "images; origin where the coordinates are the camera's. Estimators err along its rays.",
    Place(),
)
unit = option("--unit: Unit of the meshes of --obj, where it is not metres.", Choice(UNITS), "m")
bare = together(
    option("--joint-order: Order of bare keypoints.", Choice(JOINT_ORDERS), "openpose"),
    option(
        "--keypoint-unit: Unit of bare keypoints, and of the poses of object and camera and the "
        "`camera_position` beside them, except poses in TUM's or KITTI's format, which are in "
        "metres.  "
        "[default: m]",
        Choice(UNITS),
    ),
)
"""Options for keypoints that are not in OpenPose's order and in metres."""
obj = many(f"--obj: {OBJ_HELP}", FILE, required=True)
obj_or_source = many(
    f"--obj: {OBJ_HELP} Not needed where the file, or the source of --from, has its own; without "
    "any mesh nothing of contact is known.",
    FILE,
)
overwrite = flag(
    "--overwrite: Also replace files that geneoh did not write. Inputs are never replaced."
)
output = together(
    option(
        "-o --output: File to write. One that geneoh wrote before is replaced when the new one "
        "is complete.",
        FILE,
    ),
    overwrite,
)
preset = option(
    "--preset: Settings to clean with: our best, the paper's, or faster ones.",
    Choice(PRESETS),
    "default",
)
samples = option(
    "--samples: Number of samples that the diffusion draws.  [default: the preset's]", COUNT
)
selection = option(
    "--select selection: Which sample becomes the result: the one closest to the input, or "
    "the mean of all samples.  [default: the preset's]",
    Choice(SELECTIONS),
)
hand = option("--hand: Hand model of the result.", Choice(RESULT_HANDS), "embedded")
seed = option(
    "--seed: Seed of every random draw; the same seed gives the same file.",
    click.IntRange(*SEED_LIMITS),
    0,
)
side_and_fps = together(
    option(
        "--side: Side of the hand, where the file does not say; of two hands, the one to read.",
        Choice(SIDES),
    ),
    option("--fps: Frames per second, where the file does not say.", float),
)
mano = option(
    "--mano: Folder that holds your MANO_RIGHT.pkl and MANO_LEFT.pkl.",
    FOLDER,
    envvar="GENEOH_MANO_DIR",
    show_envvar=True,
)
reading = together(mano, side_and_fps)
"""Options for what a file may leave open: the MANO files, the side and the frame rate."""
jobs = option("--jobs: Number of processes.  [default: one for each core]", COUNT)
trust_and_refine = together(
    flag(
        "--trust-object: Take the object's poses as exact. Without it, poses that shake or jump "
        "are smoothed before the hand is cleaned, a filter that one of hand and object went "
        "through is undone, the motion of a camera is estimated, and a mesh that is too large is "
        "left out."
    ),
    flag(
        "--refine-object: Write poses of the object that agree with the clean hands, and not "
        "those of the input."
    ),
)
hand_delay = option(
    "--hand-delay: Frames by which the hands come later than the object, such as from a sensor "
    "with a clock of its own; negative where they come earlier.",
    float,
    0.0,
)
device = option(
    "--device: Device to compute on: cpu, cuda, or cuda:N for GPU number N.", default="cpu"
)
weights = option(
    "--weights: Folder of weights to use instead of the shipped ones: motion.safetensors, "
    "spatial.safetensors and temporal.safetensors, for the preset paper trajectory.safetensors, "
    "relations.safetensors and latent.safetensors.",
    FOLDER,
)
steps = option(
    "--steps: Number of denoiser calls of MotionDiff and of rounds of SpatialDiff, in the preset "
    "paper of calls in each stage.  [default: the preset's]",
    COUNT,
)
cleaning = together(
    *(preset, samples, selection, steps, hand, mano, trust_and_refine, weights, seed),
    *(hand_delay, side_and_fps, device),
)
"""Options of cleaning: the fields of `geneoh.Options`, and the side and the frame rate."""
folder = option("-o --output folder: Folder to write to.", FOLDER, Path("runs"))
INTERACTIONS = "runs/data"
"""Default folder of made interactions."""
data = option(
    "--data: Folder of interactions that `geneoh synthesize` made.", FOLDER, Path(INTERACTIONS)
)
config_and_settings = together(
    option(
        "--config: Configuration: the name of a shipped one, or the path of a TOML file.",
        metavar="NAME|PATH",
    ),
    many(
        "--set settings: Change one value of the configuration; may be repeated.",
        metavar="NAME=VALUE",
    ),
)


def cleaner(mano: Path | None, chosen: dict[str, Any]) -> "Options":
    """The options of `cleaning`, removed from `chosen`, after a check of their device."""
    from geneoh import Options
    from geneoh.nn.devices import named_device  # torch, which takes seconds

    named_device(chosen["device"])
    names = [field.name for field in fields(Options) if field.name in chosen]
    return Options(mano_dir=mano, **{name: chosen.pop(name) for name in names})


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
