"""Settings of the training of a stage; the TOML files of `configs/` hold differences from these."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from geneoh.baselines.networks import RegressionConfig, TochConfig
from geneoh.choices import STAGES
from geneoh.config import Limited, Limits
from geneoh.denoisers.latent import LatentConfig
from geneoh.denoisers.motion import MotionConfig
from geneoh.denoisers.relations import RelationConfig
from geneoh.denoisers.spatial import SpatialConfig
from geneoh.denoisers.temporal import TemporalConfig
from geneoh.denoisers.trajectory import TrajectoryConfig
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.training.augmentation import AugmentationConfig
from geneoh.training.corruption import CorruptionConfig
from geneoh.training.recordings import ClipConfig
from geneoh.training.run_config import RunConfig
from geneoh.training.windows import WindowConfig

FOLLOWS = ("spatial", "temporal", "relations")  # stages that are trained on MotionDiff's output


@dataclass(frozen=True)
class TrainConfig(RunConfig):
    """The training of one stage of the cleaner; every value is saved with the weights."""

    LIMITS: ClassVar[Limits] = {
        **RunConfig.LIMITS,
        **{"autoencoder_steps": (0, Limited.LARGEST), "motion_level": (1, 1000)},
        "motion_steps": (1, 1000),
    }
    READ_BY: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **{stage: (stage,) for stage in STAGES},
        "autoencoder_steps": ("latent",),
        **dict.fromkeys(("motion_level", "motion_steps"), FOLLOWS),
    }

    autoencoder_steps: int = 3000
    """Latent stage only: training steps of the autoencoder, before the denoiser is trained."""
    motion_level: int = 650
    """Stages after MotionDiff only: noise level from which MotionDiff denoises their input."""
    motion_steps: int = 3  # its denoising steps, fewer than at inference since it runs every batch
    windows: WindowConfig = field(default_factory=WindowConfig)
    augmentation: AugmentationConfig = field(default_factory=AugmentationConfig)
    corruption: CorruptionConfig = field(default_factory=CorruptionConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    spatial: SpatialConfig = field(default_factory=SpatialConfig)
    temporal: TemporalConfig = field(default_factory=TemporalConfig)
    trajectory: TrajectoryConfig = field(default_factory=TrajectoryConfig)
    relations: RelationConfig = field(default_factory=RelationConfig)
    latent: LatentConfig = field(default_factory=LatentConfig)
    toch: TochConfig = field(default_factory=TochConfig)
    regression: RegressionConfig = field(default_factory=RegressionConfig)
    synthesis: SynthesisConfig = field(default_factory=SynthesisConfig)
    """How interactions are synthesized if the data folder is empty."""
    clips: ClipConfig = field(default_factory=ClipConfig)  # how clips are cut out of recordings
