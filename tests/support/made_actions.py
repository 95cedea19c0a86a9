"""Small made-up actions: spheres or boxes that hands hold while they rise from the table.

They are made without any search for grasps. Also an encoder of sentences that learns nothing.
"""

from dataclasses import replace
from pathlib import Path

import torch

from geneoh.generators.text import TextEncoder
from geneoh.generators.text2hoi.physics.standing import StandingObject
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.synthesis.action_shards import DEFAULTS
from geneoh.synthesis.actions.action import VERBS, Actions
from geneoh.synthesis.shards import ShardRecord, write_clips

NAMES = ("mug", "drawer", "gso_black_razer_mouse")
HALF = torch.tensor([0.03, 0.04, 0.05])
"""Half extents of the box without a change of size, metres."""


class WordEncoder(TextEncoder):
    """The words of a sentence, each a random vector of its own, added up."""

    width = 8

    def __init__(self) -> None:
        """Learn nothing."""

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


def box_actions(
    verbs: list[str],
    *,
    frames: int = 20,
    length: int | None = None,
    points: int = 64,
    hands: tuple[bool, bool] = (False, True),
    jointed: bool = False,
    seed: int = 0,
) -> Actions:
    """One action per verb, each at another place, with another size of box, height and hand.

    A jointed box opens its upper half about a hinge. Hands are beside the box, bent as at random.
    """
    batch, generator = len(verbs), torch.Generator().manual_seed(seed)
    length = frames if length is None else length

    def drawn(*shape: int, low: float = 0.0, high: float = 1.0) -> torch.Tensor:
        return low + (high - low) * torch.rand(*shape, generator=generator)

    normals = torch.nn.functional.one_hot(torch.arange(points) % 3, 3).float()
    normals = normals * (1 - 2 * (torch.arange(points) // 3 % 2))[:, None]
    flat = 2 * drawn(batch, points, 3) - 1
    half = HALF * drawn(batch, 1, 1, low=0.8, high=1.2)
    surface = torch.where(normals != 0, normals, flat) * half + half * torch.tensor([0.0, 0, 1])
    part = (surface[..., 2] > half[..., 2]).long() * jointed
    time = (torch.arange(frames) / (length - 1)).clamp(max=1)
    progress = time**2 * (3 - 2 * time)
    turn = progress[:, None] * drawn(batch, 1, low=-1.0)[..., None] * torch.eye(3)[2]
    rise = progress[:, None] * drawn(batch, 1, 1, low=0.1, high=0.2) * torch.eye(3)[2]
    taking = torch.tensor([hands]).expand(batch, 2)
    pose = drawn(batch, 2, 1, 16, 3, low=-0.3, high=0.3).expand(-1, -1, frames, -1, -1)
    side = torch.tensor([[-1.0, 0, 0], [1.0, 0, 0]])[None, :, None]
    wrist = rise[:, None] + side * 0.1 + torch.tensor([0.0, 0.0, 0.05])
    there = taking[:, :, None, None]
    return Actions(
        verb=torch.tensor([VERBS.index(verb) for verb in verbs]),
        name=torch.arange(batch),
        hands=taking.clone(),
        length=torch.full((batch,), length),
        pose=pose * there[..., None],
        wrist=wrist * there,
        rotation=axis_angle_to_matrix(turn),
        translation=rise,
        joint=progress.expand(batch, frames) * jointed,
        points=surface,
        normals=normals.expand_as(surface).clone(),
        part=part,
        axis=torch.eye(3)[0].expand(batch, 3) * jointed,
        pivot=half[:, 0] * torch.tensor([0.0, 1.0, 1.0]) * jointed,
        slides=torch.zeros(batch, dtype=torch.bool),
    )


def on_object(actions: Actions, stood: StandingObject) -> Actions:
    """One action whose object is another one, which does not turn."""
    frames = actions.rotation.shape[1]
    return replace(
        actions,
        points=stood.points[None],
        normals=stood.normals[None],
        part=torch.zeros(1, len(stood.points), dtype=torch.long),
        rotation=torch.eye(3).expand(1, frames, 3, 3),
    )


def write_action_shards(folder: Path, **splits: Actions) -> None:
    """A folder as `geneoh synthesize --actions` writes it, with one shard of each split."""
    folder.mkdir(parents=True)
    for number, (split, actions) in enumerate(splits.items()):
        path = folder / f"{split}_{number:05d}.safetensors"
        write_clips(path, actions, ShardRecord(DEFAULTS, 0))


def write_actions(folder: Path) -> None:
    """A shard of each split, of spheres."""
    write_action_shards(folder, val=made_actions(seed=1), train=made_actions(seed=0))


def passing(giver: int):
    """An object that one hand holds in the first half of an action and the other in the second."""
    actions = box_actions(["pass"], hands=(True, True))
    there = torch.arange(20) < 10
    holds = torch.stack([there, ~there][:: 1 - 2 * giver])[None, :, :, None]
    return replace(actions, wrist=actions.wrist + 5.0 * ~holds)
