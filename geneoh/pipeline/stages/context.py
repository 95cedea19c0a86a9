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

from geneoh.denoisers.base import POINTS, SELECT_EVERY
from geneoh.denoisers.drifting import drift
from geneoh.denoisers.holding import HeldPlace, holding
from geneoh.denoisers.motion import ObservedMotion
from geneoh.denoisers.sliding import Sliding
from geneoh.denoisers.spatial import SpatialEvidence, track_cues
from geneoh.denoisers.temporal import TemporalEvidence
from geneoh.fitting.subject import Subject
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.sampling import sample_surface
from geneoh.representation.nearest_surface import nearest_on_parts
from geneoh.representation.parameters import HandParameters, turned
from geneoh.representation.region import ContactRegion, ObjectSurface, contact_region
from geneoh.sequence.windows import WINDOW, fold, unfold, window_starts

SURFACE_POINTS = 1024  # points drawn on the surface of the object, all parts together
WINDOWS_AT_ONCE = 20  # of all samples together: memory does not grow with the track
HELD_FRAMES = 150
"""Frames around a window in which sliding is looked at: a hand keeps its hold for longer than two
seconds, and the more the object turns, the more its sliding tells."""
CARRIED = 10.0
"""Limit of a hand's noise as the world sees it, in multiples of its noise as its object sees it.
SpatialDiff was trained with the second. With the first it finds more of the lasting errors, but
takes a hand that hammers for a noisy one."""


@dataclass(frozen=True)
class StageContext(ObjectSurface):
    """What the stages know besides the hand: the object's surface and motion, and trust."""

    trust: Float[Tensor, "T 21"]
    fps: float
    canonical: bool = True  # False for the ablation whose canonical frame stands still in the world
    ray: Float[Tensor, "T 3"] | None = None  # unit direction from the camera, world; if known
    object_noise: Float[Tensor, " 2"] | None = None
    """Deviation of white noise on the object's rotation (rad) and translation (m) before its track
    was cleaned; None where it was exact."""
    relied: Float[Tensor, " T"] | None = None  # of poses, 0 to 1; None for 1 in all frames
    chosen: tuple[int, ...] | None = None  # first frame of each window; None for evenly apart

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
        """Frames of a window: a short track is one window of its own length."""
        return min(WINDOW, self.frames)

    def cut(self, values: Float[Tensor, "..."], axis: int) -> Float[Tensor, "..."]:
        """Windows of a tensor whose frames lie on `axis`, a window axis W in front of it."""
        moved = values.movedim(axis, 0)
        windows = unfold(moved.flatten(1).movedim(0, -2), self.starts, self.size)
        windows = windows.unflatten(-1, moved.shape[1:])
        return windows.movedim((0, 1), (axis, axis + 1))

    def windows(self, values: Float[Tensor, "S T ..."]) -> Float[Tensor, "B N ..."]:
        """All windows of all samples as one batch, samples outermost."""
        return self.cut(values, 1).flatten(0, 1)

    def blend(self, windows: Float[Tensor, "B N ..."]) -> Float[Tensor, "S T ..."]:
        """Inverse of `windows`: overlapping windows cross smoothly."""
        parted = windows.flatten(2).unflatten(0, (-1, len(self.starts)))
        return fold(parted, self.starts, self.frames).unflatten(-1, windows.shape[2:])

    def pieces(self, samples: int) -> "list[Piece]":
        """All windows of a track, so many at a time that memory does not grow with it."""
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
        """Contact points of each window of each sample, from that sample's own hand."""
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
        """What tells SpatialDiff the place of each window, from the mean of all samples of a hand
        as they come out of MotionDiff; `observed` is the one that went in."""
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
        """How a hand slides over what it holds in each window and around it; `track` tells how
        noisy each window was (`track_cues`)."""
        around, moving = self._around_windows(), self._holding(joints)
        held = HeldPlace.of(*(values[around] for values in moving))
        return Sliding.of(held, track, self.size / around.shape[1])

    def drift(
        self, joints: Float[Tensor, "T 21 3"], track: Float[Tensor, "W 12"]
    ) -> Float[Tensor, "T 3"]:
        """The error of a hand's place that drifts, by what it holds in each window and around it.

        A track shorter than a window shows no usual place from which it could drift: 0. `track` is
        that of `sliding`.
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
        """Frames of each window and around it, `HELD_FRAMES` of them where there are so many."""
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
        """The middle of a hand, the motion of the object's parts, and how surely it holds each."""
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
        """How noisy the hand was as the world sees it, or at most `CARRIED` times as the object
        does."""
        noise = self.points.new_zeros(2) if self.object_noise is None else self.object_noise
        known = self.cut(self.trust, 0).mean(-1), noise.to(self.points).expand(len(change), 2)
        wrist = ((seen.wrist - translation)[..., None, :] @ rotation)[..., 0, :]
        held = replace(seen, wrist=wrist, turn=rotation.mT @ seen.turn)
        world = track_cues(seen, change, *known)
        from_object = track_cues(held, turned(change, rotation), *known)
        return world.minimum(from_object + math.log(CARRIED))

    def hand_windows(self, hand: HandParameters) -> HandParameters:
        """The windows of one sample of a hand."""
        return HandParameters(
            self.windows(hand.wrist),
            self.windows(hand.turn),
            self.windows(hand.fingers),
            hand.offsets.expand(len(self.starts), 20, 3),
        )

    def nearest_surface(
        self, joints: Float[Tensor, "T 21 3"]
    ) -> tuple[Float[Tensor, "T 21 3"], Float[Tensor, "T 21 3"]]:
        """The surface point nearest to each keypoint and its outward normal, world frame."""
        near = nearest_on_parts(joints[None], self.surface)
        return near.points[0], near.normals[0]

    def observed_motion(self, hand: HandParameters, region: ContactRegion) -> ObservedMotion:
        """Windows of a hand of the world (one sample), as MotionDiff is shown them."""
        nearest, outward = self.nearest_surface(hand.joints[0])
        surface = self.cut(nearest, 0), self.cut(outward, 0)
        trust = self.cut(self.trust, 0).mean(-1)
        return ObservedMotion.of(self.hand_windows(hand), trust, *surface, region)


def repeated(hand: HandParameters, samples: int) -> HandParameters:
    """One sample of a hand as so many equal ones."""
    return hand.map(lambda value: value.expand(samples, *value.shape[1:]))


class Piece(NamedTuple):
    """Some neighbouring windows of a track."""

    windows: slice  # which of the windows of the track
    frames: slice  # the frames that they cover
    context: StageContext  # what the stages know of these frames, cut into these windows

    def steps(
        self, observed: Float[Tensor, "1 F 21 3"], joints: Float[Tensor, "1 F 21 3"]
    ) -> TemporalEvidence:
        """How the hand `joints` moves over the surface in each window, as TemporalDiff sees it;
        `observed` is the hand before MotionDiff, in the frames of the piece."""
        trust = self.context.trust.mean(-1)[None]
        evidence = TemporalEvidence.at(self.context.surface, joints, observed, trust)
        return evidence.map(self.context.windows)


def stage_context(
    surface: MovingSurface, subject: Subject, fps: float, *, generator: torch.Generator
) -> StageContext:
    """The object's surface and motion; points are shared among parts by area."""
    fields = surface.fields
    areas = torch.tensor([float(field.mesh.face_vectors().norm(dim=-1).sum()) for field in fields])
    counts = (SURFACE_POINTS * areas / areas.sum()).round().long().clamp(min=16)
    drawn = [
        sample_surface(field.solid, int(count), generator=generator)
        for field, count in zip(fields, counts, strict=True)
    ]
    return StageContext(
        points=torch.cat([part.points for part in drawn]).to(surface.rotation),
        normals=torch.cat([part.normals for part in drawn]).to(surface.rotation),
        part=torch.arange(len(fields)).repeat_interleave(counts).to(surface.rotation.device),
        rotation=surface.rotation,
        translation=surface.translation,
        trust=subject.trust,
        fps=fps,
    )
