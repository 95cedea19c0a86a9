"""What a user can choose about an evaluation."""

from dataclasses import dataclass, field
from pathlib import Path

from geneoh import choices
from geneoh.errors import ConfigError
from geneoh.evaluation.protocols.options import DEFAULTS, DatasetDefaults, ProtocolOptions
from geneoh.pipeline.options import Options

DEFAULT_METHODS: tuple[choices.MethodName, ...] = (
    *("input", "savgol", "best-filter", "optimisation"),
    *("toch", "regression", "geneoh"),
)
"""One kind of filter is enough here: the other kinds are candidates of the best filter."""


@dataclass(frozen=True)
class EvaluationOptions:
    """Which clips are scored, under which noise, which methods clean them, and how exactly."""

    dataset: choices.Dataset
    """The data set, which has a protocol of its own; see `geneoh.evaluation.protocols`."""
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
        """Refuse with a `ConfigError` what is none of the choices."""
        for what, values, known in (
            ("data set", [self.dataset], choices.DATASETS),
            ("noise", self.noises, choices.CASE_NOISES),
            ("method", self.methods, choices.METHODS),
            ("preset", self.presets, choices.PRESETS),
            ("ablation", self.ablations, choices.ABLATIONS),
        ):
            for value in values:
                if value not in known:
                    raise ConfigError(f"{what} {value}: expected one of {', '.join(known)}")

    @property
    def defaults(self) -> DatasetDefaults:
        """What is scored where noises, seeds or close frames are not chosen."""
        return DEFAULTS[self.dataset]
