"""A handful of interactions made without any search for grasps, and the smallest networks."""

from dataclasses import replace

import pytest
import torch
from draws import seeded
from made_grasps import grasps_at

from geneoh.baselines.networks import RegressionConfig, TochConfig
from geneoh.denoisers.latent import LatentConfig
from geneoh.denoisers.motion import MotionConfig
from geneoh.denoisers.relations import RelationConfig
from geneoh.denoisers.spatial import SpatialConfig
from geneoh.denoisers.temporal import TemporalConfig
from geneoh.denoisers.trajectory import TrajectoryConfig
from geneoh.streamed import Streamed
from geneoh.synthesis.motions.motion import Interactions, animate
from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.training.config import TrainConfig


@pytest.fixture(scope="session")
def interactions() -> Interactions:
    """Four interactions of 62 frames with 40 surface points."""
    generator = seeded()
    orient = torch.randn(4, 1, 3, generator=generator)
    grasps = grasps_at(0.05 * torch.randn(4, 3, generator=generator), orient[:, 0])
    solids = draw_objects(["box"] * 4, generator=generator)
    return animate(grasps, solids, 62, 40, generator=generator)


@pytest.fixture(scope="session")
def clips(interactions) -> Streamed[Interactions]:
    """The same, cut to 14 frames: what costs time only does so once per frame."""
    moving = ("pose", "wrist", "rotation", "translation")
    cut = {name: getattr(interactions, name)[:, 20:34] for name in moving}
    return Streamed.of([replace(interactions, **cut)])


@pytest.fixture(scope="session")
def tiny() -> TrainConfig:
    """A run of four steps that saves and validates after the second and the last."""
    return TrainConfig(
        steps=4,
        batch=2,
        warmup=2,
        autoencoder_steps=2,
        checkpoint_every=2,
        validate_every=2,
        validation_batches=1,
        motion=MotionConfig(width=16, depth=1, heads=2),
        trajectory=TrajectoryConfig(width=16, depth=1, heads=2),
        spatial=SpatialConfig(width=16, frames=4),
        relations=RelationConfig(width=16, depth=1, heads=2, point_width=8),
        temporal=TemporalConfig(width=16, depth=1, heads=2),
        latent=LatentConfig(latent=6, point_width=8, width=16, depth=1, heads=2),
        toch=TochConfig(point_width=8, hidden=8, latent=6),
        regression=RegressionConfig(width=16, depth=1, heads=2, point_width=8),
    )
