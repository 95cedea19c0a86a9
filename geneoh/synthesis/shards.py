"""Interactions on disk: seeded shards that can be made in any order and read without loading."""

import hashlib
import json
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import torch
from safetensors import safe_open
from safetensors.torch import save_file
from torch import Tensor

from geneoh.errors import InputError
from geneoh.hand.model import HandModel
from geneoh.synthesis.grasps import Grasps, synthesize_grasps
from geneoh.synthesis.motion import Interactions, animate
from geneoh.synthesis.objects import FAMILIES, Solids, draw_objects


@dataclass(frozen=True)
class SynthesisConfig:
    """What a synthetic data set is made of; saved in every shard."""

    count: int = 20480
    """Interactions in all."""
    frames: int = 120
    points: int = 512
    """Surface points kept of each object."""
    shard: int = 256
    """Interactions per file."""
    shape_std: float = 0.8
    """Spread of the hands' shape coefficients."""
    bone_std: float = 0.04
    """Relative spread of each bone's length beyond what the shape coefficients can make."""
    held_out: tuple[str, ...] = ("mug", "loop_tool", "spoon", "kettle")
    """Families that appear in validation shards only."""
    validation: float = 0.03
    """Share of the shards that hold the held-out families."""


def seed_of(*parts: object) -> int:
    """A stable 63-bit seed from any values: the same for every run, shard order and machine."""
    digest = hashlib.sha256("/".join(map(str, parts)).encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


def synthesize_shard(
    config: SynthesisConfig, families: list[str], hand: HandModel, *, generator: torch.Generator
) -> Interactions:
    """Interactions of the given families that passed the grasp checks, `config.shard` of them."""
    kept: list[Interactions] = []
    while (missing := config.shard - sum(len(part.wrist) for part in kept)) > 0:
        tried = missing + missing // 8 + 1  # about one grasp in ten fails the checks
        pick = torch.randint(len(families), (tried,), generator=generator)
        solids = draw_objects([families[i] for i in pick], generator=generator)
        betas = config.shape_std * torch.randn(tried, 10, generator=generator)
        stretch = 1 + config.bone_std * torch.randn(tried, 20, 1, generator=generator)
        offsets = hand.shaped(betas).offsets * stretch
        grasps = synthesize_grasps(solids, offsets, generator=generator)
        solids = Solids(*(getattr(solids, f.name)[grasps.kept] for f in fields(Solids)))
        grasps = Grasps(*(getattr(grasps, f.name)[grasps.kept] for f in fields(Grasps)))
        kept.append(animate(grasps, solids, config.frames, config.points, generator=generator))
    return Interactions(
        **{
            f.name: torch.cat([getattr(part, f.name) for part in kept])[: config.shard]
            for f in fields(Interactions)
        }
    )


def write_shards(
    folder: Path,
    config: SynthesisConfig,
    hand: HandModel,
    *,
    seed: int,
    on_shard: Callable[[int, int], None] | None = None,
) -> int:
    """Make every shard that is not there yet; returns how many were made.

    Shards are named `train_00000.safetensors` and `val_00000.safetensors`; each is written beside
    and renamed, so an interrupted run leaves only whole files and continues where it stopped.
    """
    folder.mkdir(parents=True, exist_ok=True)
    total = max(2, -(-config.count // config.shard))
    validation = max(1, round(config.validation * total))
    common = [name for name in FAMILIES if name not in config.held_out]
    made = 0
    for index in range(total):
        split = "val" if index < validation else "train"
        path = folder / f"{split}_{index:05d}.safetensors"
        if not path.exists():
            generator = torch.Generator().manual_seed(seed_of(seed, "shard", index))
            families = list(config.held_out) if split == "val" else common
            part = synthesize_shard(config, families, hand, generator=generator)
            # one entry: safetensors writes several in no fixed order
            record = {"record": json.dumps({"config": asdict(config), "seed": seed})}
            tensors = {f.name: getattr(part, f.name).contiguous() for f in fields(part)}
            temporary = path.with_suffix(".part")
            save_file(tensors, temporary, metadata=record)
            os.replace(temporary, path)
            made += 1
        if on_shard is not None:
            on_shard(index + 1, total)
    return made


def read_shards(folder: Path, split: str) -> Interactions:
    """All interactions of one split ("train" or "val") in memory.

    Raises:
        InputError: the folder holds no shard of that split.
    """
    paths = sorted(folder.glob(f"{split}_*.safetensors"))
    if not paths:
        raise InputError(
            f"{folder}: expected {split}_*.safetensors, found none; "
            f"make some with `geneoh synthesize -o {folder}`"
        )
    parts: dict[str, list[Tensor]] = {f.name: [] for f in fields(Interactions)}
    for path in paths:
        with safe_open(path, framework="pt") as shard:
            for name, tensors in parts.items():
                tensors.append(shard.get_tensor(name))
    return Interactions(**{name: torch.cat(tensors) for name, tensors in parts.items()})
