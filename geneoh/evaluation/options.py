"""The options of an evaluation and their defaults.

The protocols' defaults follow the paper's text (GeneOH Diffusion, C.1) where it specifies them.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from geneoh import choices
from geneoh.config import Limited, check_fields
from geneoh.errors import ConfigError
from geneoh.hand.mano import mano_folder
from geneoh.pipeline.options import Options
from geneoh.readers.base import ReaderOptions

SEEDS = (11, 22, 77)  # seeds of the paper's Table 5


@dataclass(frozen=True)
class DatasetDefaults:
    """The default noises, seeds and frames of a data set."""

    noises: tuple[choices.CaseNoise, ...]
    seeds: tuple[int, ...] = SEEDS
    close_frames: int = 20
    """Frames of a clip in which the expensive metrics are measured."""


DEFAULTS: dict[choices.Dataset, DatasetDefaults] = {
    # There are many short clips, so that one seed and a few frames of each suffice.
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
    """Windows of `frames` every `stride` frames (paper); only the first window of each stretch of
    usable frames (released code); or whole stretches, as a user cleans them."""
    frames: int = 60
    """Length of a window, and the shortest usable stretch, in frames of the protocol."""
    stride: int = 30
    """Frames between the starts of two windows."""
    noise_sizes: Literal["paper", "code"] = "paper"
    """Size of the noise "paper": as in the paper's text, or as in the released code."""
    finger_noise: Literal["components", "angles"] = "components"
    """The noise "paper" is drawn on the first 24 of MANO's pose components (as in the released code
    for GRAB), which needs the user's MANO files, or on each finger joint's axis-angle, which is
    larger."""
    start_frames: Literal["paper", "zero"] = "paper"
    """HOI4D: the paper's first frame of each category, or frame 0 for all (released code)."""
    reach: Literal["paper", "code"] = "paper"
    """ARCTIC: largest distance from the wrist to the object: 15 cm (paper) or 38.7 cm, because the
    released code compares the squared distance with 0.15."""
    object_noise: choices.ObjectNoise | None = None
    """Noise on the object poses in the input; scores use the true poses. None: no noise."""
    mano_dir: Path | None = None
    """Folder of the user's MANO files, which GRAB and ARCTIC need. None leaves it to the
    environment variable GENEOH_MANO_DIR."""
    objects: Path | None = None
    """Folder of the object meshes, if they are not where the data set puts them."""

    def __post_init__(self) -> None:
        """Also find the folder of MANO, which is one of the settings of a run."""
        super().__post_init__()
        object.__setattr__(self, "mano_dir", mano_folder(self.mano_dir))

    @property
    def reader_options(self) -> ReaderOptions:
        """The options for the readers of data sets."""
        return ReaderOptions(mano_dir=self.mano_dir, objects=self.objects)


@dataclass(frozen=True)
class EvaluationOptions:
    """The clips, noises and methods of an evaluation, and how results are measured."""

    dataset: choices.Dataset
    """The data set, which has a protocol of its own; see `geneoh.evaluation.protocols.datasets`."""
    root: Path | None = None
    """Folder of the user's copy of the data set; by default that in the environment variable
    GENEOH_DATA_NAME. `synthetic` and the example of `taco` need none."""
    noises: tuple[choices.CaseNoise, ...] = ()
    """Noises to put on each clip; empty: the defaults of the data set."""
    seeds: tuple[int, ...] = ()
    """Seeds of the noise and of the methods that sample; empty: the paper's three, for `synthetic`
    the first of them."""
    limit: int | None = None
    """Largest number of clips to score, spread over the recordings; None: all."""
    methods: tuple[choices.MethodName, ...] = ()
    """Methods to compare; empty: all but `choices.ON_REQUEST` and baselines without weights."""
    presets: tuple[choices.PresetName, ...] = ("default",)
    """Presets of geneoh, each scored as a method."""
    ablations: tuple[choices.Ablation, ...] = ()
    """Parts of geneoh; for each, the first preset without that part is scored as well."""
    predictions: tuple[Path, ...] = ()
    """Folders of results of other methods, one `CLIP_NOISE_SEED.npz` for each case."""
    noisy_inputs: Path | None = None
    """Folder of noisy clips, named like predictions, that are used instead of drawing noise."""
    protocol: ProtocolOptions = field(default_factory=ProtocolOptions)
    """How clips are cut and how the paper's noise is drawn."""
    cleaner: Options = field(default_factory=Options)
    """Options of geneoh: samples, selection, steps, hand model, weights. Preset and seed are set
    from `presets` and `seeds`. The hand model is also fitted to the keypoints of methods without a
    mesh of their own."""
    close_frames: int | None = None
    """Frames of a clip in which intersection volume and contact on the object, the expensive
    metrics, are measured; None: 20, for `synthetic` 5."""

    def __post_init__(self) -> None:
        """Convert lists and paths given as text, and drop duplicates; `ConfigError` for values that
        no field takes, and for a preset or a seed of the cleaner that is not scored."""
        check_fields(self)
        for name in ("noises", "seeds", "methods", "presets", "ablations", "predictions"):
            object.__setattr__(self, name, tuple(dict.fromkeys(getattr(self, name))))
        self._refuse_of_cleaner("preset", self.presets)
        self._refuse_of_cleaner("seed", self.seeds)

    def _refuse_of_cleaner(self, name: str, used: tuple[object, ...]) -> None:
        """Refuse a preset or a seed of the cleaner that is not scored: it would be ignored."""
        value = getattr(self.cleaner, name)
        if value != getattr(Options(), name) and value not in used:
            raise ConfigError(
                f"EvaluationOptions: the {name} of 'cleaner' must be one of '{name}s', got "
                f"{value!r}; give it as {name}s=({value!r},)"
            )

    @property
    def defaults(self) -> DatasetDefaults:
        """The defaults of the data set for noises, seeds and close frames."""
        return DEFAULTS[self.dataset]

    @property
    def closely_measured(self) -> int:
        """Largest number of frames per clip, evenly spread, for the expensive metrics."""
        return self.close_frames or self.defaults.close_frames
