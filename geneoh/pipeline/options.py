"""The settings of `geneoh.denoise`."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from inspect import signature
from pathlib import Path
from typing import Any

import torch

from geneoh.choices import CLEANING, Ablation, HandSource, PresetName, Selection
from geneoh.config import check_fields, closest_name
from geneoh.errors import ConfigError
from geneoh.pipeline.presets import Preset, preset
from geneoh.readers.arrays import MESH_NAMES
from geneoh.readers.npz.files import load

NEEDED_TO_REFINE: tuple[Ablation, ...] = ("object", "mesh")
"""Parts of the method without which the object is not examined."""


@dataclass(frozen=True)
class Options:
    """The settings of `geneoh.denoise`; the defaults are those of `geneoh denoise`."""

    preset: PresetName = "default"
    """The method: "default", the most accurate that we have; "paper", as GeneOH Diffusion describes
    it; "fast", the default with one sample and fewer steps."""
    samples: int | None = None
    """Number of diffusion chains that are drawn, 1 or more. None leaves it to the preset: 4 in the
    default one, else 1. With 2 or more the result has `HandTrack.joint_spread`."""
    seed: int = 0
    """Seed of all random numbers. The same seed, input and settings give the same result; each hand
    of a sequence starts from the same seed."""
    steps: int | None = None
    """Denoiser calls of MotionDiff, 1 or more and at most its noise level (650), and rounds of
    SpatialDiff, at most 20; TemporalDiff always makes one call. In the preset "paper" calls of
    every stage, at most their noise levels. None leaves it to the preset: 4 of both by default, 1
    and 3 rounds for the fast one, 400, 200 and 100 for the paper's. More than those of the preset
    take longer and do not make results better."""
    selection: Selection | None = None
    """Which sample is kept: "closest", the one nearest to the input as in the paper, or "mean", the
    mean of all; None for the mean. In the preset `paper` it also holds for chains of MotionDiff."""
    without: tuple[Ablation, ...] = ()
    """Ablation: parts of the method that are left out; none by default."""
    hand: HandSource = "embedded"
    """Hand model of the result: "embedded", the one that ships with geneoh, "mano", from the user's
    files, where a left hand with betas of the official file keeps the model of that file, or
    "mano-as-shipped"."""
    mano_dir: Path | None = None
    """Folder of the user's MANO files. None leaves it to the environment variable GENEOH_MANO_DIR;
    the embedded hand needs no file."""
    weights: Path | None = None
    """Folder of the weights of the preset's three stages, as `geneoh train` writes it; None for
    those that ship."""
    trust_object: bool = False
    """Whether the object's poses are taken as exact and their frame as still: they are neither
    examined nor cleaned, and no filter that the hand or the object went through is undone, nor the
    motion of a camera removed. A mesh in which fingers stay deep is relied on as well."""
    refine_object: bool = False
    """Whether the result has poses of the object that agree with the clean hands
    (`geneoh.objects.refine`) and not those of the input. It needs the examination of the object,
    and so excludes `trust_object`, and "object" and "mesh" in `without`."""
    hand_delay: float | int = 0.0
    """Delay of the hands relative to the object, frames, such as from a sensor with its own clock;
    negative if the hands come earlier. Cleaning and result have the delay removed."""
    device: str = "cpu"
    """Device that the networks and the fit run on, as torch names it: "cpu", "cuda", "cuda:1". The
    result is on the device of the sequence."""

    def __post_init__(self) -> None:
        """Take paths given as text, and refuse values that no setting has.

        Raises:
            ConfigError: a value has a wrong type, is not among its field's choices or out of its
                limits, or `refine_object` is combined with a setting that excludes it.
        """
        if isinstance(self.device, torch.device):
            object.__setattr__(self, "device", str(self.device))
        check_fields(self, CLEANING)
        unexamined = [f"without {part!r}" for part in self.without if part in NEEDED_TO_REFINE]
        unexamined += ["trust_object"] * self.trust_object
        if self.refine_object and unexamined:
            raise ConfigError(
                "Options: 'refine_object' (--refine-object) needs an object that is examined, got "
                f"it beside {' and '.join(unexamined)}; leave one of them out"
            )

    def resolved(self) -> Preset:
        """The preset with the user's changes."""
        chosen = preset(self.preset)
        if self.steps is not None:
            chosen = chosen.with_steps(self.steps)
        trusted: tuple[Ablation, ...] = ("object",) if self.trust_object else ()
        for part in (*self.without, *trusted):
            chosen = chosen.without(part)
        selection, motion = self.selection or chosen.selection, chosen.motion
        if motion is not None and motion.chains > 1:
            motion = replace(motion, kept=selection)
        samples = self.samples or chosen.samples
        return replace(chosen, motion=motion, samples=samples, selection=selection)


def with_settings(
    options: Options | None,
    settings: Mapping[str, Any],
    caller: str = "geneoh.denoise",
    arguments: Iterable[str] = (),
) -> Options:
    """The options, or the default ones, with some fields replaced by name.

    `caller` is the function's name in error messages. `arguments` are the names of its other
    arguments if it reads no file, for hints about misspelt names.

    Raises:
        ConfigError: a name is not a field of `Options`, or a value is refused.
    """
    options = Options() if options is None else options
    if not isinstance(options, Options):
        raise ConfigError(
            f"expected geneoh.Options as the second argument, got {options!r:.60}; "
            'settings go by name, such as geneoh.denoise(sequence, preset="fast")'
        )
    names = [field.name for field in fields(Options)]
    for name in settings:
        if name not in names:
            hint = closest_name(name, [*names, *arguments])
            if name in MESH_NAMES and "meshes" in arguments:
                hint = "did you mean 'meshes'?"
            elif name in signature(load).parameters and not arguments:
                hint = f"geneoh.load(path, {name}=...) makes the sequence with it"
            raise ConfigError(f"{caller}: '{name}' is no setting; {hint}")
    return replace(options, **settings)
