"""Clips of gestures, and tasks that learn tiny networks of BOTH2Hands from them, for tests."""

from pathlib import Path

import numpy as np
import torch
from made_bodies import SKELETON, SMALL, WORDS, speech, tiny_networks

from geneoh.generators.both2hands.library import Both2HandsNetworks
from geneoh.generators.both2hands.networks import BlendConfig, HandsConfig, TextHandsConfig
from geneoh.generators.both2hands.training import (
    Both2HandsConfig,
    HandsTask,
    kept_features,
    set_scales,
)
from geneoh.synthesis.gestures.clips import Gestures
from geneoh.synthesis.gestures.shards import DEFAULTS
from geneoh.synthesis.shards import ShardRecord, write_clips
from geneoh.training.data import TrainingData


def made_gestures(bodies: int = 6, frames: int = 20, seed: int = 0) -> Gestures:
    """Clips whose fingers bend as their sentences say, and wave as their right arm does."""
    generator = torch.Generator().manual_seed(seed)
    time = torch.linspace(0, 6, frames)
    bent = torch.arange(bodies) % 3
    pose = 0.1 * torch.randn(bodies, 1, 52, 3, generator=generator).repeat(1, frames, 1, 1)
    speed = 1.0 + torch.rand(bodies, 1, generator=generator)
    pose[:, :, 17, 2] += (speed * time).sin()
    pose[:, :, 22:, 2] += 0.5 * bent[:, None, None]
    pose[:, :, 37:, 2] += 0.3 * (speed * time).sin()[..., None]
    said = [[f"the left hand {word}", f"{word} it"] for word in ("rests", "waves", "grasps")]
    return Gestures(
        gesture=torch.zeros(bodies, 2, dtype=torch.long),
        variant=torch.zeros(bodies, 2, dtype=torch.long),
        body=torch.zeros(bodies, dtype=torch.long),
        length=torch.full((bodies,), frames) - torch.arange(bodies) % 2 * 5,
        root=torch.tensor([0.0, 0.9, 0.0]).expand(bodies, frames, 3).clone(),
        pose=pose,
        offsets=SKELETON.offsets.expand(bodies, -1, -1).clone(),
        left=np.array([said[n][0] for n in bent.tolist()]),
        right=np.array(["the right hand waves"] * bodies),
        joined=np.array([said[n] for n in bent.tolist()]),
    )


TINY = Both2HandsConfig(
    steps=6,
    batch=4,
    rate=1e-2,
    warmup=2,
    checkpoint_every=3,
    validate_every=3,
    validation_batches=2,
    body_hands=HandsConfig(**SMALL),
    text_hands=TextHandsConfig(**SMALL, words=WORDS),
    blend=BlendConfig(**SMALL),
)


def tiny_task(stage, config: Both2HandsConfig = TINY, networks: Both2HandsNetworks | None = None):
    """A stage that learns from a few made clips."""
    data = TrainingData(made_gestures(), made_gestures(4, seed=1), {"source": "test"})
    if stage == "blend":
        networks = networks or tiny_networks()
        for network in (networks.body, networks.text):
            set_scales(network, data.training, kept_features(data.training, network.config.frame))
    branches = networks if stage == "blend" else None
    return HandsTask(stage, config, data, speech, branches=branches)


def write_gesture_shards(folder: Path, **splits: Gestures) -> None:
    """A folder as `geneoh synthesize --bodies` writes it, with one shard of each split."""
    folder.mkdir()
    for number, (split, clips) in enumerate(splits.items()):
        path = folder / f"{split}_{number:05d}.safetensors"
        write_clips(path, clips, ShardRecord(DEFAULTS, 0))
