"""Actions without any search for grasps, and an encoder of sentences that learns nothing."""

from dataclasses import fields
from pathlib import Path

import torch

from geneoh.config import as_dict
from geneoh.files.tensors import write_tensors
from geneoh.synthesis.action_shards import DEFAULTS
from geneoh.synthesis.actions import VERBS, Actions
from geneoh.synthesis.shards import ShardRecord

NAMES = ("mug", "drawer", "gso_black_razer_mouse")


class WordEncoder:
    """The words of a sentence, each a random vector of its own, added up."""

    width = 8

    def encode(self, sentences) -> torch.Tensor:
        def vector(word: str) -> torch.Tensor:
            seed = int.from_bytes(word.encode()[:7], "big")
            return torch.randn(self.width, generator=torch.Generator().manual_seed(seed))

        told = [torch.stack([vector(w) for w in text.lower().split()]).sum(0) for text in sentences]
        return torch.stack(told)


def made_actions(count: int = 6, frames: int = 20, points: int = 48, seed: int = 0) -> Actions:
    """Spheres that rise, held by a right hand, a left one or both in turn; one in three is jointed.

    Held means that the wrist keeps its place on the object, with the fingers about it. Every other
    action ends before the last frame.
    """
    draw = torch.Generator().manual_seed(seed)

    def normal(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=draw)

    number = torch.arange(count)
    normals = torch.nn.functional.normalize(normal(count, points, 3), dim=-1)
    radius = 0.03 + 0.02 * torch.rand(count, 1, 1, generator=draw)
    jointed = number % 3 == 2
    rise = torch.linspace(0, 0.2, frames)
    translation = torch.zeros(count, frames, 3)
    translation[..., 2] = rise
    hands = torch.stack([number % 3 != 0, number % 3 != 1], dim=1)
    there = hands[:, :, None, None].float()
    beside = torch.tensor([[[-0.1, 0.0, 0.05]], [[0.1, 0.0, 0.05]]])
    wrist = translation[:, None] + beside + 0.005 * normal(count, 2, 1, 3)
    pose = 0.2 * normal(count, 2, 1, 16, 3).expand(-1, -1, frames, -1, -1)
    part = (jointed[:, None] & (torch.arange(points) % 2 == 1)).long()
    length = torch.where(number % 2 == 0, frames, frames - 5)
    return Actions(
        verb=number % len(VERBS),
        name=number % len(NAMES),
        hands=hands,
        length=length,
        pose=pose * there[..., None],
        wrist=wrist * there,
        rotation=torch.eye(3).expand(count, frames, 3, 3),
        translation=translation,
        joint=0.5 * rise / 0.2 * jointed[:, None],
        points=radius * normals + torch.tensor([0.0, 0.0, 0.05]),
        normals=normals,
        part=part,
        axis=torch.tensor([0.0, 0.0, 1.0]) * jointed[:, None],
        pivot=torch.zeros(count, 3),
        slides=torch.zeros(count, dtype=torch.bool),
    ).ended()


def write_actions(folder: Path) -> None:
    """A shard of each split, as `geneoh synthesize --actions` writes them."""
    folder.mkdir(parents=True)
    record = as_dict(ShardRecord(DEFAULTS, 0))
    for seed, name in enumerate(("train_00001", "val_00000")):
        actions = made_actions(seed=seed)
        tensors = {each.name: getattr(actions, each.name) for each in fields(actions)}
        write_tensors(folder / f"{name}.safetensors", tensors, record)
