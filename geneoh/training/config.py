"""Settings of a training run; `configs/` holds differences from these."""

from dataclasses import dataclass, field

from geneoh.baselines.regression import RegressionConfig
from geneoh.baselines.toch import TochConfig
from geneoh.denoisers.motion import MotionConfig
from geneoh.denoisers.spatial import SpatialConfig
from geneoh.denoisers.temporal import TemporalConfig
from geneoh.denoisers.trajectory import TrajectoryConfig


@dataclass(frozen=True)
class TrainConfig:
    """One stage's training; every value is saved with the weights."""

    steps: int = 8000
    batch: int = 32
    rate: float = 6e-4
    """Peak learning rate."""
    warmup: int = 200
    decay: float = 0.3
    """Share of the steps, at the end, over which the rate falls linearly to zero. Constant before,
    so a run can be resumed with more steps without having learned at a dead rate."""
    weight_decay: float = 0.01
    clip: float = 1.0
    """Largest gradient norm."""
    ema: float = 0.998
    """Decay of the averaged weights, the ones that are used."""
    withheld: float = 0.2
    """Share of windows whose observation is hidden (the paper's canonical denoiser)."""
    autoencoder_steps: int = 3000
    """Temporal stage only: steps spent on the autoencoder before its latent is denoised."""
    seed: int = 0
    checkpoint_every: int = 250
    validate_every: int = 250
    validation_batches: int = 8
    motion: MotionConfig = field(default_factory=MotionConfig)
    spatial: SpatialConfig = field(default_factory=SpatialConfig)
    temporal: TemporalConfig = field(default_factory=TemporalConfig)
    trajectory: TrajectoryConfig = field(default_factory=TrajectoryConfig)
    toch: TochConfig = field(default_factory=TochConfig)
    regression: RegressionConfig = field(default_factory=RegressionConfig)
