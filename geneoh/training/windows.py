"""Random windows of training clips: clean hands, and the object that they hold."""

from dataclasses import dataclass, replace
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.config import Limited, Limits
from geneoh.denoisers.base import POINTS, SELECT_EVERY
from geneoh.denoisers.motion import ObservedMotion
from geneoh.geometry.rotations import axis_angle_to_matrix, interpolate_rotations
from geneoh.representation.nearest_surface import nearest_on_parts
from geneoh.representation.parameters import HandParameters
from geneoh.representation.region import ContactRegion, ObjectSurface, contact_region
from geneoh.streamed import Streamed
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.motions.motion import Interactions


@dataclass(frozen=True)
class WindowConfig(Limited):
    """Length and speed of the windows that networks learn from."""

    LIMITS: ClassVar[Limits] = {"frames": (2, Limited.LARGEST)}

    frames: int = 60  # length of a window (paper: 60 at 30 a second); shorter clips are used whole
    short_share: float = 0.2
    """Share of the batches with a random shorter length, so that networks learn short clips."""
    fast_share: float = 0.25  # share of the batches that play at twice the speed


@dataclass(frozen=True)
class TrainingWindows(ObjectSurface):
    """B windows of T frames, world frame, metres."""

    hand: HandParameters

    def region(self, joints: Float[Tensor, "B T 21 3"]) -> ContactRegion:
        """Generalised contact points of a hand and their canonical frame."""
        return contact_region(joints, self, count=POINTS, every=SELECT_EVERY)

    def observed(
        self, noisy: HandParameters, keep: Bool[Tensor, "B T"], region: ContactRegion
    ) -> ObservedMotion:
        """The input of MotionDiff for a noisy hand, in the canonical frame of a region."""
        near = nearest_on_parts(noisy.joints, self)
        return ObservedMotion.of(noisy, keep.float(), near.points, near.normals, region)

    def shaken(
        self, turn: Float[Tensor, "B T 3"], shift: Float[Tensor, "B T 3"]
    ) -> "TrainingWindows":
        """The windows with noise on the object: `turn` in its own frame, `shift` in the world."""
        rotation = self.rotation @ axis_angle_to_matrix(turn)[:, :, None]
        return replace(self, rotation=rotation, translation=self.translation + shift[:, :, None])


@dataclass(frozen=True, eq=False, kw_only=True)
class WeightedInteractions(Streamed[Interactions]):
    """Interactions with sampling weights, of different lengths, padded to the longest."""

    length: Int[Tensor, " B"]  # frames without the padding
    weight: Float[Tensor, " B"]  # relative probability that a clip is drawn


def draw_windows(
    data: Streamed[Interactions], config: WindowConfig, draws: Draws
) -> TrainingWindows:
    """Random windows, all of one length."""
    whole, generator = draws.whole, draws.generator
    short = torch.rand((), generator=generator) < config.short_share
    frames = config.frames
    if short:
        frames = int(torch.randint(2, max(3, frames), (), generator=generator))
    pick = whole.integers(0, len(data))
    lengths = torch.full_like(pick, data.shards[0].wrist.shape[1])
    if isinstance(data, WeightedInteractions):
        pick = torch.multinomial(data.weight, whole.batch, replacement=True, generator=generator)
        lengths = data.length[pick]
    frames = min(frames, int(lengths.min()))
    fast = torch.rand((), generator=generator) < config.fast_share
    stride = torch.where(fast & (2 * frames <= lengths), 2, 1)
    room = lengths - stride * (frames - 1)
    if isinstance(data, WeightedInteractions):
        start = (whole.share() * room).long()
    else:
        start = whole.integers(0, int(room[0]))
    pick, start, stride = map(draws.own, (pick, start, stride))
    clips, row = data.take(pick), torch.arange(len(pick))[:, None]
    window = start[:, None] + stride[:, None] * torch.arange(frames)
    fixed = clips.points, clips.normals, clips.part
    motion = clips.rotation[row, window], clips.translation[row, window]
    hand = clips.wrist[row, window], clips.pose[row, window], clips.offsets
    return TrainingWindows(*fixed, *motion, HandParameters.of_pose(*hand))


def filled(hand: HandParameters, keep: Bool[Tensor, "B T"]) -> HandParameters:
    """Interpolate frames that are not kept between their kept neighbours; constant at the ends."""
    frames = keep.shape[1]
    time = torch.arange(frames, device=keep.device).expand_as(keep)
    before = torch.where(keep, time, -1).cummax(1).values
    after = torch.where(keep, time, frames).flip(1).cummin(1).values.flip(1)
    start = torch.where(before < 0, after, before)
    end = torch.where(after >= frames, before, after)
    weight = (time - start) / (end - start).clamp(min=1)
    batch = torch.arange(len(keep), device=keep.device)[:, None]

    def interpolated(values: Tensor) -> Tensor:
        share = weight.reshape(*weight.shape, *[1] * (values.ndim - 2)).to(values)
        return torch.lerp(values[batch, start], values[batch, end], share)

    turn = interpolate_rotations(
        hand.turn[batch, start], hand.turn[batch, end], weight.to(hand.wrist)
    )
    turn = torch.where(keep[..., None, None], hand.turn, turn)
    return HandParameters(interpolated(hand.wrist), turn, interpolated(hand.fingers), hand.offsets)
