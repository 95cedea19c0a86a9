"""What a user can choose about an evaluation, and what is scored where he chooses nothing.

The protocols' defaults are the paper's text (GeneOH Diffusion, C.1) wherever it gives one.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from geneoh import choices
from geneoh.config import Limited, Limits, check_fields
from geneoh.errors import ConfigError
from geneoh.pipeline.options import Options
from geneoh.readers.base import ReaderOptions

LIMITS: Limits = dict.fromkeys(("limit", "close_frames"), (1, math.inf))
"""Least and largest of numbers that are chosen."""
SEEDS = (11, 22, 77)  # seeds of the paper's Table 5
DEFAULT_METHODS: tuple[choices.MethodName, ...] = (
    *("input", "savgol", "centroid", "best-filter", "best-offset", "optimisation"),
    *("toch", "regression", "one-call", "geneoh"),
)
"""The Gaussian and the One-Euro filter are left out: they are candidates of the best filter."""


@dataclass(frozen=True)
class DatasetDefaults:
    """What is scored on a data set unless the user chooses something else."""

    noises: tuple[choices.CaseNoise, ...]
    seeds: tuple[int, ...] = SEEDS
    close_frames: int = 20
    """Frames of a clip in which the expensive metrics are measured."""


DEFAULTS: dict[choices.Dataset, DatasetDefaults] = {
    # Many short clips: one seed and a few frames of each say as much as more of fewer clips.
    "synthetic": DatasetDefaults(("gauss", "beta"), SEEDS[:1], 5),
    "taco": DatasetDefaults(("gauss", "beta")),
    "grab": DatasetDefaults(("paper",)),
    "grab-beta": DatasetDefaults(("paper",)),
    "hoi4d": DatasetDefaults(("recorded",)),
    "arctic": DatasetDefaults(("paper",)),
}


@dataclass(frozen=True)
class ProtocolOptions(Limited):
    """How the clips of a data set are cut and how the paper's noise is drawn.

    The example of `taco` is always whole; synthetic clips have `frames` frames and no windows.
    """

    windows: Literal["all", "first", "whole"] = "all"
    """Windows of `frames` every `stride` frames (paper); only the first window of each recording
    (released code); or the whole recording, which is what a user cleans."""
    frames: int = 60
    """Length of a window, and the shortest stretch that counts, in frames of the protocol."""
    stride: int = 30
    """Frames between the starts of two windows."""
    noise_sizes: Literal["paper", "code"] = "paper"
    """Size of the noise "paper": as in the paper's text, or as in the released code."""
    finger_noise: Literal["components", "angles"] = "components"
    """The noise "paper" is drawn on the first 24 of MANO's pose components (paper and code), which
    needs the user's MANO files, or on each finger joint's axis-angle, which is larger."""
    start_frames: Literal["paper", "zero"] = "paper"
    """HOI4D: the paper's first frame of each category, or frame 0 for all (released code)."""
    reach: Literal["paper", "code"] = "paper"
    """ARCTIC: largest distance from the wrist to the object: 15 cm (paper) or 38.7 cm, because the
    released code compares the squared distance with 0.15."""
    object_noise: choices.ObjectNoise | None = None
    """Noise on the object's poses that the methods see; scores are measured on the true ones. None:
    the methods see the true poses."""
    mano_dir: Path | None = None
    """Folder of the user's MANO files; GRAB and ARCTIC need it."""
    objects: Path | None = None
    """Folder of the object meshes, if they are not where the data set puts them."""

    @property
    def reader_options(self) -> ReaderOptions:
        """What the readers of data sets need to know."""
        return ReaderOptions(mano_dir=self.mano_dir, objects=self.objects)


@dataclass(frozen=True)
class EvaluationOptions:
    """Which clips are scored, under which noise, which methods clean them, and how exactly."""

    dataset: choices.Dataset
    """The data set, which has a protocol of its own; see `geneoh.evaluation.protocols.datasets`."""
    root: Path | None = None
    """Folder of the user's copy of the data set; without it the environment variable
    GENEOH_DATA_NAME names one. `synthetic` and the example of `taco` need none."""
    noises: tuple[choices.CaseNoise, ...] = ()
    """Noises to put on each clip; empty: the data set's own."""
    seeds: tuple[int, ...] = ()
    """Seeds of the noise and of the methods that sample; empty: the paper's three, for `synthetic`
    the first of them."""
    limit: int | None = None
    """Most clips to score, spread over the recordings; None: all."""
    methods: tuple[choices.MethodName, ...] = ()
    """Methods to compare; empty: `DEFAULT_METHODS` without baselines whose weights are missing."""
    presets: tuple[choices.PresetName, ...] = ("default",)
    """Presets of geneoh, each scored as a method."""
    ablations: tuple[choices.Ablation, ...] = ()
    """Parts of geneoh; for each, the first preset without that part is scored as well."""
    predictions: tuple[Path, ...] = ()
    """Folders of results of other methods, one `CLIP_NOISE_SEED.npz` for each case."""
    noisy_inputs: Path | None = None
    """Folder of noisy clips, named in the same way, that are used instead of drawing noise."""
    protocol: ProtocolOptions = field(default_factory=ProtocolOptions)
    """How clips are cut and how the paper's noise is drawn."""
    cleaner: Options = field(default_factory=Options)
    """Options of geneoh: samples, selection, steps, hand model, weights. Its preset and its seed
    are set from `presets` and `seeds`; its hand model is also the one that every method without a
    mesh of its own is measured with."""
    close_frames: int | None = None
    """Frames of a clip in which intersection volume and contact on the object, the expensive
    metrics, are measured; None: 20, for `synthetic` 5."""

    def __post_init__(self) -> None:
        """Take lists and paths given as text; what is named twice is one.

        Raises:
            ConfigError: a value is of another type than its field's, or none of its choices, or
                the cleaner has a preset or a seed that is not scored.
        """
        check_fields(self, LIMITS)
        for name in ("noises", "seeds", "methods", "presets", "ablations", "predictions"):
            object.__setattr__(self, name, tuple(dict.fromkeys(getattr(self, name))))
        self._refuse_of_cleaner("preset", self.presets)
        self._refuse_of_cleaner("seed", self.seeds)

    def _refuse_of_cleaner(self, name: str, used: tuple[object, ...]) -> None:
        """Refuse a preset or a seed of the cleaner that is not scored: it would be ignored."""
        given = getattr(self.cleaner, name)
        if given != getattr(Options(), name) and given not in used:
            raise ConfigError(
                f"EvaluationOptions: the {name} of 'cleaner' must be one of '{name}s', got "
                f"{given!r}; give it as {name}s=({given!r},)"
            )

    @property
    def defaults(self) -> DatasetDefaults:
        """What is scored where noises, seeds or close frames are not chosen."""
        return DEFAULTS[self.dataset]

    @property
    def closely_measured(self) -> int:
        """Most frames of a clip that the expensive metrics see: spread evenly, for all methods."""
        return self.close_frames or self.defaults.close_frames
