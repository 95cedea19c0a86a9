"""Bodies whose hands hold objects: arms that follow the wrists of synthetic actions."""

import math
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.body.arms import reach
from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import JOINT_NAMES, WRISTS, Skeleton
from geneoh.choices import SIDES
from geneoh.files.fingerprints import file_digest
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.language.vocabulary import VERB_WORDS, noun_of, with_article
from geneoh.synthesis.action_shards import DEFAULTS, action_shard, names_of_shard
from geneoh.synthesis.actions.action import VERBS, Actions
from geneoh.synthesis.gestures.sentences import Doing
from geneoh.synthesis.shards import find_shards

Y_UP = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
"""Rotation from the world frame of actions (z up) to that of bodies (y up)."""
IN_REACH = 0.02  # limit of the distance between a wrist and its place in the action, metres
MOST_BEND = 1.75  # limit of the rotation of a wrist relative to its forearm, radians
FOREARM = {"left": (-1.0, 0.0, 0.0), "right": (1.0, 0.0, 0.0)}
"""Direction from the wrist to the forearm in a hand's own frame."""


@dataclass(frozen=True)
class ActionSource:
    """Shards of actions that `geneoh synthesize --actions` made."""

    folder: Path
    fingerprint: str  # hash of the shards' files

    @staticmethod
    def of(folder: Path) -> "ActionSource":
        """The shards of a folder; `InputError` if it has none of a split."""
        splits = (find_shards(folder, split, DEFAULTS) for split in ("val", "train"))
        return ActionSource(folder, file_digest(path for paths in splits for path in paths))

    def drawn(
        self, split: str, count: int, *, generator: torch.Generator
    ) -> tuple[Actions, list[str]]:
        """Random actions of one random shard of a split, and the names of all objects."""
        paths = find_shards(self.folder, split, DEFAULTS)
        path = paths[int(torch.randint(len(paths), (), generator=generator))]
        actions = action_shard(path)
        which = torch.randperm(len(actions.verb), generator=generator)[:count]
        return actions.take(which, "B"), names_of_shard(path)


def manipulating(
    skeleton: Skeleton, body: BodyMotion, actions: Actions, *, generator: torch.Generator
) -> tuple[BodyMotion, Float[Tensor, " B"], Float[Tensor, " B"]]:
    """Bodies whose arms follow the hands of actions in front of them.

    Hands that take no part move as in `body`. Returns the motion and, for each body, the largest
    distance of a wrist from its place in metres and the largest bend of a wrist in radians.
    """
    rest = pose(skeleton, body)
    places, turns = _placed(actions, rest.positions, generator=generator)
    wrists = [WRISTS[side] for side in SIDES]
    part = actions.hands[:, None, :, None]
    places = torch.where(part, places, rest.positions[:, :, wrists])
    turns = torch.where(part[..., None], turns, rest.rotations[:, :, wrists])
    fingers = axis_angle_to_matrix(actions.pose[:, :, :, 1:]).transpose(1, 2).flatten(2, 3)
    held = part.squeeze(-1).repeat_interleave(15, 2)[..., None, None]
    rotations = body.rotations.clone()
    rotations[:, :, 22:] = torch.where(held, fingers, rotations[:, :, 22:])
    motion = reach(skeleton, BodyMotion(body.root, rotations), places, turns)
    missed = (pose(skeleton, motion).positions[:, :, wrists] - places).norm(dim=-1)
    bend = matrix_to_axis_angle(motion.rotations[:, :, wrists]).norm(dim=-1)
    return motion, missed.amax((1, 2)), (bend * part.squeeze(-1)).amax((1, 2))


def _placed(
    actions: Actions, body: Float[Tensor, "B T 52 3"], *, generator: torch.Generator
) -> tuple[Float[Tensor, "B T 2 3"], Float[Tensor, "B T 2 3 3"]]:
    """Wrist positions and rotations of the actions in the world frame of the bodies: in front of
    each body, and turned about the vertical so that forearms point back to it."""
    to_world = torch.tensor(Y_UP)
    wrist = actions.wrist.transpose(1, 2) @ to_world.T
    turn = to_world @ axis_angle_to_matrix(actions.pose[:, :, :, 0]).transpose(1, 2)
    valid = (actions.valid[:, :, None] & actions.hands[:, None]).float()[..., None]
    forearm = (turn @ torch.tensor([FOREARM[side] for side in SIDES])[..., None])[..., 0]
    back = (forearm * valid).sum((1, 2))
    # the heading that turns the mean forearm to -z, which is behind
    angle = math.pi - torch.atan2(back[:, 0], back[:, 2])
    heading = axis_angle_to_matrix(angle[:, None] * torch.tensor([0.0, 1.0, 0.0]))
    wrist = (heading[:, None, None] @ wrist[..., None])[..., 0]
    turn = heading[:, None, None] @ turn
    middle = (wrist * valid).sum((1, 2)) / valid.sum((1, 2))
    shoulders = body[:, 0, [JOINT_NAMES.index(f"{side}_shoulder") for side in SIDES]]
    share = actions.hands.float() / actions.hands.sum(1, keepdim=True)
    goal = (share[..., None] * shoulders).sum(1)
    drawn = torch.rand(len(goal), 3, generator=generator)
    goal = goal + torch.tensor([-0.08, -0.42, 0.26]) + drawn * torch.tensor([0.16, 0.2, 0.14])
    return wrist + (goal - middle)[:, None, None], turn


def doings(actions: Actions, names: list[str], rest: Doing) -> list[tuple[Doing, Doing]]:
    """Phrases for the left and the right hand of each action."""
    phrases = []
    for verb, name, hands in zip(actions.verb, actions.name, actions.hands.tolist(), strict=True):
        thing = with_article(noun_of(names[int(name)]))
        words = VERB_WORDS[VERBS[int(verb)]]
        doing = Doing(tuple(f"{word} {thing}" for word in words))
        phrases.append(tuple(doing if part else rest for part in hands))
    return phrases
