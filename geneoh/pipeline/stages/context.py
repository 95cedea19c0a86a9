"""The object, the windows and the canonical frames that all stages share."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.bundle import FRAMES
from geneoh.denoisers.base import POINTS, SELECT_EVERY
from geneoh.denoisers.drifting import drift
from geneoh.denoisers.holding import HeldPlace, holding
from geneoh.denoisers.motion import ObservedMotion
from geneoh.denoisers.sliding import Sliding
from geneoh.denoisers.spatial import SpatialEvidence, track_cues
from geneoh.denoisers.surface_points import surface_points
from geneoh.denoisers.temporal import TemporalEvidence
from geneoh.fitting.subject import Subject
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.sampling import PartSamples
from geneoh.representation.nearest_surface import nearest_on_parts
from geneoh.representation.parameters import HandParameters, turned
from geneoh.representation.region import ContactRegion, ObjectSurface, contact_region
from geneoh.sequence.keypoints import PALM
from geneoh.sequence.windows import WINDOW, fold, unfold, window_starts

WINDOWS_AT_ONCE = 20  # batch size over windows and samples, which bounds the memory
HELD_FRAMES = 150
"""Frames around a window from which sliding is measured: grips last longer than two seconds, and
sliding is better evidence the more the object turns."""
CARRIED = 10.0
"""Upper bound of a hand's noise in the world frame, in multiples of its noise in the object frame.
SpatialDiff was trained with the noise in the object frame. With that in the world frame it corrects
more of the constant errors, but takes a hand that hammers for a noisy one."""
BETTER_SEEN = 0.1  # trust by which a palm must exceed its whole hand to be denoised by its own


@dataclass(frozen=True)
class StageContext(ObjectSurface):
    """Input of the stages besides the hand: the object's surface and motion, trust, camera ray."""

    trust: Float[Tensor, "T 21"]
    fps: float
    canonical: bool = True  # False for the ablation with a canonical frame fixed in the world
    ray: Float[Tensor, "T 3"] | None = None  # unit direction camera to hand, world; None if unknown
    rests: bool = False
    """Whether the object is known to rest in all frames, so that only contact shows a touch."""
    object_noise: Float[Tensor, " 2"] | None = None
    """Standard deviation of white noise on the object's rotation (rad) and translation (m) before
    its track was cleaned; None if the object is trusted."""
    relied: Float[Tensor, " T"] | None = None  # reliability of the poses, 0 to 1; None for 1
    chosen: tuple[int, ...] | None = None  # first frame of each window; None for regular spacing

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.rotation)

    @cached_property
    def starts(self) -> list[int]:
        """First frame of each window."""
        return window_starts(self.frames) if self.chosen is None else list(self.chosen)

    @property
    def size(self) -> int:
        """Frames per window: a short track is one window of its own length."""
        return min(WINDOW, self.frames)

    def cut(self, values: Float[Tensor, "..."], axis: int) -> Float[Tensor, "..."]:
        """Cut a tensor with frames on `axis` into windows; a new axis W precedes the frames."""
        moved = values.movedim(axis, 0)
        windows = unfold(moved.flatten(1).movedim(0, -2), self.starts, self.size)
        windows = windows.unflatten(-1, moved.shape[1:])
        return windows.movedim((0, 1), (axis, axis + 1))

    def windows(self, values: Float[Tensor, "S T ..."]) -> Float[Tensor, "B N ..."]:
        """All windows of all samples as one batch, samples outermost."""
        return self.cut(values, 1).flatten(0, 1)

    def blend(self, windows: Float[Tensor, "B N ..."]) -> Float[Tensor, "S T ..."]:
        """Inverse of `windows`: overlapping windows are cross-faded."""
        parted = windows.flatten(2).unflatten(0, (-1, len(self.starts)))
        return fold(parted, self.starts, self.frames).unflatten(-1, windows.shape[2:])

    def pieces(self, samples: int) -> "list[Piece]":
        """The windows of a track in groups of at most `WINDOWS_AT_ONCE` windows times samples."""
        size, found = max(1, WINDOWS_AT_ONCE // samples), []
        for at in range(0, len(self.starts), size):
            starts = self.starts[at : at + size]
            frames = slice(starts[0], starts[-1] + self.size)
            own = tuple(start - starts[0] for start in starts)
            windows = slice(at, at + len(starts))
            found.append(Piece(windows, frames, replace(self[frames], chosen=own)))
        return found

    def joined(
        self, parts: Iterable[Float[Tensor, "B N ..."]], samples: int
    ) -> Float[Tensor, "S T ..."]:
        """The windows of all pieces, blended."""
        each = [part.unflatten(0, (samples, -1)) for part in parts]
        return self.blend(torch.cat(each, dim=1).flatten(0, 1))

    def region(self, joints: Float[Tensor, "S T 21 3"]) -> ContactRegion:
        """Contact points and canonical frame of each window, for each sample's own hand."""
        surface = self.surface_windows(len(joints))
        region = contact_region(self.windows(joints), surface, count=POINTS, every=SELECT_EVERY)
        return region if self.canonical else region.held_still()

    @property
    def surface(self) -> ObjectSurface:
        """The object in all frames, as a batch of one."""
        own = (self.points, self.normals, self.part, self.rotation, self.translation)
        return ObjectSurface(*(values[None] for values in own))

    def surface_windows(self, samples: int = 1) -> ObjectSurface:
        """The object in each window of each sample, samples outermost."""
        batch = samples * len(self.starts)

        def in_windows(values: Tensor) -> Tensor:
            cut = self.cut(values, 0)
            return cut.expand(samples, *cut.shape).flatten(0, 1)

        rotation, translation = in_windows(self.rotation), in_windows(self.translation)
        points, normals = (each.expand(batch, -1, 3) for each in (self.points, self.normals))
        return ObjectSurface(points, normals, self.part.expand(batch, -1), rotation, translation)

    def evidence(self, observed: HandParameters, hand: HandParameters) -> SpatialEvidence:
        """Input of SpatialDiff for each window, from the mean of MotionDiff's samples `hand` and
        the input `observed` of MotionDiff."""
        joints = self.windows(hand.joints.mean(0, keepdim=True))
        surface = self.surface_windows()
        before = repeated(observed, len(hand.wrist))
        change = self.windows(before.change_to(hand).mean(0, keepdim=True))
        ray = self.points.new_zeros(len(self.starts), 3)
        if self.ray is not None:
            ray = normalize(self.cut(self.ray, 0).mean(1), dim=-1)
        seen = self.hand_windows(observed)
        track = self._cues(seen, change, surface.rotation[:, :, 0], surface.translation[:, :, 0])
        return SpatialEvidence.around(surface, joints, ray, track)

    def sliding(self, joints: Float[Tensor, "T 21 3"], track: Float[Tensor, "W 12"]) -> Sliding:
        """Sliding of a hand over the held part in the frames around each window; `track` has the
        noise levels of each window (`track_cues`)."""
        around, moving = self._around_windows(), self._holding(joints)
        held = HeldPlace.of(*(values[around] for values in moving))
        return Sliding.of(held, track, self.size / around.shape[1])

    def drift(
        self, joints: Float[Tensor, "T 21 3"], track: Float[Tensor, "W 12"]
    ) -> Float[Tensor, "T 3"]:
        """Drift of the hand over the held part (`geneoh.denoisers.drifting`), metres, world frame.

        Zero for a track shorter than a window, which is too short for a reliable mean position.
        `track` has the noise levels of each window (`track_cues`).
        """
        if self.frames < WINDOW:
            return torch.zeros_like(joints[:, 0])
        around, moving = self._around_windows(), self._holding(joints)
        own = torch.tensor(self.starts, device=around.device)[:, None] - around[:, :1]
        own = own + torch.arange(self.size, device=around.device)
        found = []
        for at in range(0, len(around), WINDOWS_AT_ONCE):
            group = slice(at, at + WINDOWS_AT_ONCE)
            held = HeldPlace.of(*(values[around[group]] for values in moving))
            ray = None if self.ray is None else self.ray[around[group]]
            error = drift(held, held.object_noise(track[group]), ray)
            found.append(error.gather(1, own[group, :, None].expand(-1, -1, 3)))
        return self.blend(torch.cat(found))[0]

    def _around_windows(self) -> Int[Tensor, "W N"]:
        """Indices of `HELD_FRAMES` frames (or all) around the centre of each window."""
        span = min(HELD_FRAMES, self.frames)
        last, before = self.frames - span, (span - self.size) // 2
        device = self.rotation.device
        starts = (torch.tensor(self.starts, device=device) - before).clamp(0, last)
        return starts[:, None] + torch.arange(span, device=device)

    def _holding(
        self, joints: Float[Tensor, "T 21 3"]
    ) -> tuple[
        Float[Tensor, "T 3"], Float[Tensor, "T Q 3 3"], Float[Tensor, "T Q 3"], Float[Tensor, "T Q"]
    ]:
        """Centre of the hand, rotation and translation of the object's parts, and the confidence
        that the hand holds each part."""
        apart = (self.nearest_surface(joints)[0] - joints).norm(dim=-1).amin(-1)
        held = holding(joints[None], self.rotation[None], self.translation[None], apart[None])[0]
        if self.relied is not None:
            held = held * self.relied[:, None]
        return joints.mean(1), self.rotation, self.translation, held

    def _cues(
        self,
        seen: HandParameters,
        change: Float[Tensor, "B N 51"],
        rotation: Float[Tensor, "B N 3 3"],
        translation: Float[Tensor, "B N 3"],
    ) -> Float[Tensor, "B 12"]:
        """Noise levels of the hand in the world frame, limited to `CARRIED` times those in the
        object frame."""
        noise = self.points.new_zeros(2) if self.object_noise is None else self.object_noise
        known = self.cut(self.trust, 0).mean(-1), noise.to(self.points).expand(len(change), 2)
        wrist = ((seen.wrist - translation)[..., None, :] @ rotation)[..., 0, :]
        held = replace(seen, wrist=wrist, turn=rotation.mT @ seen.turn)
        world = track_cues(seen, change, *known)
        from_object = track_cues(held, turned(change, rotation), *known)
        return world.minimum(from_object + math.log(CARRIED))

    def hand_windows(self, hand: HandParameters) -> HandParameters:
        """The windows of one sample of a hand."""
        offsets = hand.offsets.expand(len(self.starts), 20, 3)
        return replace(hand.map(self.windows, FRAMES), offsets=offsets)

    def nearest_surface(
        self, joints: Float[Tensor, "T 21 3"]
    ) -> tuple[Float[Tensor, "T 21 3"], Float[Tensor, "T 21 3"]]:
        """The surface point nearest to each keypoint and its outward normal, world frame."""
        near = nearest_on_parts(joints[None], self.surface)
        return near.points[0], near.normals[0]

    def observed_motion(self, hand: HandParameters) -> ObservedMotion:
        """Windows of a world-frame hand (one sample) as the condition of MotionDiff."""
        nearest, outward = self.nearest_surface(hand.joints[0])
        surface = self.cut(nearest, 0), self.cut(outward, 0)
        trust, region = self.cut(self.trust, 0).mean(-1), self.region(hand.joints)
        return ObservedMotion.of(self.hand_windows(hand), trust, *surface, region)

    def trust_of_palm(self) -> Float[Tensor, "W N"] | None:
        """Trust of the palm in each window, at least that of the whole hand; None unless it exceeds
        that by `BETTER_SEEN` in some frame."""
        trust = self.cut(self.trust, 0)
        palm, whole = trust[..., list(PALM)].mean(-1), trust.mean(-1)
        return palm.maximum(whole) if bool((palm - whole > BETTER_SEEN).any()) else None


def repeated(hand: HandParameters, samples: int) -> HandParameters:
    """One sample of a hand, expanded to `samples` equal samples."""
    return hand.map(lambda value: value.expand(samples, *value.shape[1:]))


class Piece(NamedTuple):
    """Some neighbouring windows of a track."""

    windows: slice  # indices among the windows of the track
    frames: slice  # frames of the track that these windows cover
    context: StageContext  # context of these frames, with these windows

    def steps(
        self, observed: Float[Tensor, "1 F 21 3"], joints: Float[Tensor, "1 F 21 3"]
    ) -> TemporalEvidence:
        """Input of TemporalDiff for each window, from the hand `joints` after SpatialDiff and the
        hand `observed` before MotionDiff, both in the frames of the piece."""
        trust = self.context.trust.mean(-1)[None]
        evidence = TemporalEvidence.at(self.context.surface, joints, observed, trust)
        return evidence.map(self.context.windows)


def stage_context(
    surface: MovingSurface, subject: Subject, fps: float, *, generator: torch.Generator
) -> StageContext:
    """The context of a hand with an object."""
    drawn = PartSamples.of(surface_points(surface, subject.joints, generator=generator))
    return StageContext(
        **vars(drawn.to(surface.rotation.device)),
        rotation=surface.rotation,
        translation=surface.translation,
        trust=subject.trust,
        fps=fps,
    )
