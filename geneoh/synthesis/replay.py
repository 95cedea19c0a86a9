"""What a shard leaves out, drawn again from its seed: families, objects as solids, hands with skin.

A shard keeps what networks learn from. Its seed tells the rest without a new search for grasps:
objects and people are drawn before it, and every person has bones of their own, by which the clips
that were kept are found among those that were tried.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.errors import InputError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.model import HandModel, PosedHand, ShapedHand
from geneoh.hand.skeleton import forward_kinematics
from geneoh.synthesis.motion import Interactions
from geneoh.synthesis.shards import (
    Attempts,
    attempts_for,
    draw_attempts,
    read_shard,
    shard_generator,
    shard_record,
)

SAME = 1e-5
"""Distance between two skeletons, metres over all bones, below which they are one person's."""


@dataclass(frozen=True)
class Replay:
    """Clips of a shard, with what they were made from."""

    clips: Interactions
    made_from: Attempts

    @property
    def joints(self) -> Float[Tensor, "B T 21 3"]:
        """Keypoints in the world frame, metres."""
        turns = axis_angle_to_matrix(self.clips.pose)
        return forward_kinematics(turns, self.clips.wrist, self.clips.offsets[:, None])[0]

    def chosen(self, which: Int[Tensor, " C"]) -> "Replay":
        """Some of the clips."""
        return Replay(self.clips.take(which, "B"), chosen_attempts(self.made_from, which))

    def held_frames(self) -> Int[Tensor, " B"]:
        """The frame of each clip in which the fingers are nearest to the object's surface.

        Not those in which a hand that comes or goes passes through the object.
        """
        fingers = self.in_object(self.joints)[:, :, 1:]
        every = torch.arange(fingers.shape[1]).expand(len(fingers), -1)
        gap = self.distance(fingers, every)
        return (gap.abs().mean(-1) + (-gap.amin(-1)).clamp(min=0)).argmin(-1)

    def in_object(self, world: Float[Tensor, "B T P 3"]) -> Float[Tensor, "B T P 3"]:
        """Points of the world in the frame of the object's first part, frame by frame."""
        clips = self.clips
        return (world - clips.translation[:, :, :1]) @ clips.rotation[:, :, 0]

    def skin(self, frames: Int[Tensor, "B F"]) -> PosedHand:
        """Hands of some frames of each clip in the frame of the object's first part."""
        at = torch.arange(len(frames))[:, None]
        clips, hands = self.clips, self.made_from.hands
        # one axis more for the frames
        people = replace(
            hands,
            verts=hands.verts[:, None],
            joints=hands.joints[:, None],
            offsets=hands.offsets[:, None],
        )
        posed = people.posed(clips.pose[at, frames], clips.wrist[at, frames])
        turn, shift = clips.rotation[at, frames, 0], clips.translation[at, frames, :1]
        return PosedHand((posed.verts - shift) @ turn, (posed.joints - shift) @ turn)

    def joint_pose(
        self, frames: Int[Tensor, "B F"]
    ) -> tuple[Float[Tensor, "B F 3 3"], Float[Tensor, "B F 3"]]:
        """Rotation and translation of the second part in the frame of the first."""
        at = torch.arange(len(frames))[:, None]
        turn, shift = self.clips.rotation[at, frames], self.clips.translation[at, frames]
        apart = (shift[:, :, 1:] - shift[:, :, :1]) @ turn[:, :, 0]
        return turn[:, :, 0].mT @ turn[:, :, 1], apart[:, :, 0]

    def distance(
        self, points: Float[Tensor, "B F P 3"], frames: Int[Tensor, "B F"]
    ) -> Float[Tensor, "B F P"]:
        """Signed distance in metres to each clip's object of points in its first part's frame."""
        turn, shift = self.joint_pose(frames)
        solids, moved = self.made_from.solids, (points - shift[:, :, None]) @ turn
        first, second = (
            solids.only(part).signed_distance(there.flatten(1, 2))
            for part, there in enumerate((points, moved))
        )
        return torch.minimum(first, second).unflatten(1, points.shape[1:3])


def chosen_attempts(tried: Attempts, which: Int[Tensor, " C"]) -> Attempts:
    """Some of the attempts."""
    hands = tried.hands
    return Attempts(
        [tried.families[i] for i in which.tolist()],
        tried.solids.chosen(which),
        ShapedHand(hands.model, hands.verts[which], hands.joints[which], hands.offsets[which]),
    )


def replay_shard(path: Path, hand: HandModel) -> Replay:
    """The clips of a shard that came of its first round of grasps, nearly all.

    Raises:
        InputError: the file is no whole shard, or another version of geneoh made it.
    """
    record = shard_record(path)
    config = record.config
    index = int(path.stem.rpartition("_")[2])
    tried = draw_attempts(
        config,
        config.families_of(index),
        hand,
        attempts_for(config.shard),
        generator=shard_generator(record.seed, index),
    )
    clips = read_shard(path)
    # the shortcut through a matrix product is off by more than two people differ
    apart = torch.cdist(
        clips.offsets.flatten(1),
        tried.hands.offsets.flatten(1),
        compute_mode="donot_use_mm_for_euclid_dist",
    )
    nearest, who = apart.min(1)
    found = torch.nonzero(nearest < SAME)[:, 0]
    if not len(found):
        raise InputError(
            f"{path}: expected the people that its seed {record.seed} draws, got others: "
            "another version of geneoh made it; make the data again"
        )
    return Replay(clips.take(found, "B"), chosen_attempts(tried, who[found]))
