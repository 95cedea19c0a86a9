"""What is fuzzed of the generators: sentences, meshes, weights, and the actions they learn from."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from shutil import copyfile

import torch
import trees
from made_actions import write_actions
from made_networks import TINY

from geneoh.config import as_dict
from geneoh.generators.text2hoi.networks.autoencoders import (
    ContactNetwork,
    LengthConfig,
    LengthNetwork,
)
from geneoh.generators.text2hoi.networks.interaction import InteractionNetwork
from geneoh.generators.text2hoi.networks.library import SHIPPED
from geneoh.generators.text2hoi.networks.refiner import RefinerNetwork
from geneoh.nn.checkpoint import Checkpoint, save_checkpoint

from .target import Target

QUICK = ("--steps", "1", "--frames", "12", "--refine", "paper", "-o", "{out}/clip.npz")
ONE_STEP = ("steps=1", "batch=2", "validation_batches=1", "interaction.width=16")
ONE_STEP += ("interaction.heads=2", "interaction.depth=1")


def generator_targets(folder: Path) -> Iterator[Target]:
    """A sentence, a mesh and weights that make an interaction, and shards to learn from."""
    root, s = folder / "generator", trees.scene()
    root.mkdir(parents=True)
    (root / "sentence.txt").write_text("lift the small mug with the left hand\n")
    trees.write_mesh(root / "object.obj", s.verts, s.faces)
    write_networks(root)
    files = ("@{in}/sentence.txt", "--obj", "{in}/object.obj", "--weights", "{in}")
    command = ("generate", *files, *QUICK)
    yield Target("sentence", "sentence", root, ("sentence.txt",), command)
    yield Target("mesh to generate with", "obj", root, ("object.obj",), command)
    weights = tuple(path.name for path in sorted(root.glob("*.safetensors")))
    yield Target("generator", "safetensors", root, weights, command)
    write_actions(folder / "actions")
    shards = tuple(path.name for path in sorted((folder / "actions").glob("*.safetensors")))
    settings = [word for setting in ONE_STEP for word in ("--set", setting)]
    train = ("train", "--stage", "interaction", "--data", "{in}", "-o", "{out}/run", *settings)
    yield Target("actions", "safetensors", folder / "actions", shards, tuple(train))


def write_networks(root: Path) -> None:
    """Small networks that learned nothing, and the shipped text encoder."""
    copyfile(SHIPPED / "text.safetensors", root / "text.safetensors")
    torch.manual_seed(0)
    built = {
        "contact": (ContactNetwork, replace(TINY.contact, text=128)),
        "interaction": (InteractionNetwork, replace(TINY.interaction, text=128)),
        "length": (LengthNetwork, LengthConfig(text=128)),
        "refiner": (RefinerNetwork, TINY.refiner),
    }
    for name, (network, config) in built.items():
        record = {"config": {name: as_dict(config)}}
        checkpoint = Checkpoint(network(config).state_dict(), record)
        save_checkpoint(root / f"{name}.safetensors", checkpoint)
