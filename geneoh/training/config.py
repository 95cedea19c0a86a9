"""Settings of a training run; the TOML files of `configs/` hold differences from these."""

from dataclasses import dataclass, field

from geneoh.baselines.regression import RegressionConfig
from geneoh.baselines.toch import TochConfig
from geneoh.denoisers.motion import MotionConfig
from geneoh.denoisers.relations import RelationConfig
from geneoh.denoisers.spatial import SpatialConfig
from geneoh.denoisers.temporal import TemporalConfig
from geneoh.denoisers.trajectory import TrajectoryConfig
from geneoh.synthesis.shards import SynthesisConfig
from geneoh.training.augmentation import AugmentationConfig
from geneoh.training.corruption import CorruptionConfig
from geneoh.training.recordings import ClipConfig
from geneoh.training.windows import WindowConfig


@dataclass(frozen=True)
class TrainConfig:
    """The training of one stage; every value is saved with the weights."""

    steps: int = 8000  # optimiser steps in all, a batch each
    batch: int = 32  # windows in a batch, of all processes together
    accumulate: int = 1
    """Pieces that a process works off its part of a batch in, which takes less memory; the steps
    stay the same."""
    rate: float = 6e-4  # peak learning rate
    warmup: int = 200  # steps over which the learning rate rises linearly at the start
    decay: float = 0.3  # share of the steps, at the end, over which the rate falls linearly to zero
    weight_decay: float = 0.01  # decoupled weight decay, relative to the rate
    clip: float = 1.0  # largest norm of the gradient
    ema: float = 0.998  # decay of the averaged weights, which are the ones that are used
    condition_dropout: float = 0.2
    """Share of the windows whose observation is hidden: the paper's canonical denoiser."""
    autoencoder_steps: int = 3000
    """Temporal stage only: steps spent on the autoencoder before its latent is denoised."""
    motion_level: int = 650
    """Spatial and temporal stages: level from which MotionDiff denoises what they are shown."""
    motion_steps: int = 3  # denoising steps of that, fewer than in use: it is run for every batch
    seed: int = 0  # of the first weights and of every batch
    checkpoint_every: int = 250  # steps between two saved states of the run
    validate_every: int = 250  # steps between two validations
    validation_batches: int = 8  # batches of each validation, the same ones every time
    windows: WindowConfig = field(default_factory=WindowConfig)
    augmentation: AugmentationConfig = field(default_factory=AugmentationConfig)
    corruption: CorruptionConfig = field(default_factory=CorruptionConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    spatial: SpatialConfig = field(default_factory=SpatialConfig)
    temporal: TemporalConfig = field(default_factory=TemporalConfig)
    trajectory: TrajectoryConfig = field(default_factory=TrajectoryConfig)
    relations: RelationConfig = field(default_factory=RelationConfig)
    toch: TochConfig = field(default_factory=TochConfig)
    regression: RegressionConfig = field(default_factory=RegressionConfig)
    synthesis: SynthesisConfig = field(default_factory=SynthesisConfig)
    """Of the interactions that are made where the run's folder of them is empty."""
    clips: ClipConfig = field(default_factory=ClipConfig)  # how clips are cut out of recordings
