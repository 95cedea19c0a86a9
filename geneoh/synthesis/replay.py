"""Draws again from a shard's seed what the shard does not store: families, objects, hand shapes.

Objects and hands are drawn before the search for grasps, so they can be drawn without it. The bone
lengths of each hand are unique, and match the stored clips with their attempts.
"""

from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.errors import InputError
from geneoh.geometry.distance import pairwise_distances
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.model import PosedHand
from geneoh.hand.skeleton import forward_kinematics
from geneoh.synthesis.attempts import Attempts, draw_attempts
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.motions.clearance import MovingSolids
from geneoh.synthesis.motions.motion import Interactions
from geneoh.synthesis.shards import read_shard, scans_of, shard_generator, shard_record

SAME_SKELETON = 1e-5  # norm of the difference of all bones below which hands are the same, metres


class NoFirstGraspsError(InputError):
    """No clip of a shard matches the first round of attempts that its seed draws."""


@dataclass(frozen=True)
class Replay(Bundle):
    """Clips of a shard, with the objects and hands that they were made from."""

    clips: Interactions
    made_from: Attempts

    @property
    def joints(self) -> Float[Tensor, "B T 21 3"]:
        """Keypoints in the world frame, metres."""
        turns = axis_angle_to_matrix(self.clips.pose)
        return forward_kinematics(turns, self.clips.wrist, self.clips.offsets[:, None])[0]

    def held_frames(self) -> Int[Tensor, " B"]:
        """The frame of each clip in which the fingers are closest to the object's surface.

        Penetration counts against a frame, because a few approaching hands pass through the object.
        """
        fingers = self.in_object(self.joints)[:, :, 1:]
        every = torch.arange(fingers.shape[1]).expand(len(fingers), -1)
        gap = self.distance(fingers, every)
        return (gap.abs().mean(-1) + (-gap.amin(-1)).clamp(min=0)).argmin(-1)

    def in_object(self, world: Float[Tensor, "B T P 3"]) -> Float[Tensor, "B T P 3"]:
        """World points of each frame in the frame of the object's first part."""
        clips = self.clips
        return (world - clips.translation[:, :, :1]) @ clips.rotation[:, :, 0]

    def skin(self, frames: Int[Tensor, "B F"]) -> PosedHand:
        """Hands of some frames of each clip in the frame of the object's first part."""
        at = torch.arange(len(frames))[:, None]
        clips = self.clips
        # an axis to broadcast over frames
        hands = self.made_from.hands.map(lambda value: value[:, None], "B")
        posed = hands.posed(clips.pose[at, frames], clips.wrist[at, frames])
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
        """Signed distance in metres of points in the first part's frame to each clip's object."""
        solids = self.made_from.solids
        return MovingSolids.on_joint(solids, *self.joint_pose(frames)).signed_distance(points)


def replay_shard(path: Path) -> Replay:
    """The clips of a shard from its first round of attempts, which are nearly all; those of hands
    with the same bones as another one's are left out, as their objects are not known.

    Raises `NoFirstGraspsError` if there is none, for example because another version of geneoh made
    the shard, and `InputError` if the file is no whole shard.
    """
    record, scans = shard_record(path), scans_of(path)
    config = record.config
    assert isinstance(config, SynthesisConfig), "the settings of a shard of interactions"
    index = int(path.stem.rpartition("_")[2])
    names, generator = config.families_of(index, scans), shard_generator(record.seed, index)
    tried = draw_attempts(config, names, config.shard, generator=generator, scans=scans)
    clips = read_shard(path)
    ours, theirs = clips.offsets.flatten(1), tried.hands.offsets.flatten(1)
    same = pairwise_distances(ours, theirs) < SAME_SKELETON
    found, who = torch.nonzero(same.sum(1) == 1)[:, 0], same.int().argmax(1)
    if not len(found):
        raise NoFirstGraspsError(
            f"{path}: expected hands of the first grasps that its seed {record.seed} draws, got "
            f"none among {len(clips.offsets)}: another version of geneoh made it, or none of these "
            "grasps held, or hands have the same bones (shape_std and bone_std of 0); make the "
            "data again, with more clips in each shard if they are few"
        )
    return Replay(clips.take(found, "B"), tried.take(who[found], "B"))
