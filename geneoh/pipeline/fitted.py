"""Hands after the fit: remove penetration between two hands, then measure each hand."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.fitting.fit import fit_hand
from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.jumps import without_jumps
from geneoh.fitting.own_skeleton import own_skeleton
from geneoh.fitting.subject import Subject
from geneoh.fitting.terms import HandState
from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.distance import MovingSurface
from geneoh.hand.model import ShapedHand
from geneoh.metrics.contact import depth_between
from geneoh.metrics.report import through_walls
from geneoh.objects.evidence import doubt
from geneoh.pipeline.contradictions import HandAtObject, contradictions
from geneoh.pipeline.misfit import Misfit
from geneoh.pipeline.presets import Preset
from geneoh.pipeline.results import HandResult, clean_track
from geneoh.pipeline.spread import joint_spread
from geneoh.pipeline.stages.alone import measure_hand
from geneoh.pipeline.touch import EXACT_WITHIN, finger_contact, fingers_apart
from geneoh.sequence.normalisation import NormalisedHand
from geneoh.sequence.windows import blocks, runs, widened, window_starts

FELT = 20  # frames around those with penetration that are fitted again with them
ROUNDS = 2  # in each, both hands move out of the other hand's surface before the round


@dataclass(frozen=True)
class FittedHand:
    """One normalised hand after the stages and the fit, right-handed."""

    hand: NormalisedHand
    subject: Subject
    given: HandState  # pose parameters of the input, before a filter was undone in it
    given_joints: Float[Tensor, "T 21 3"]  # keypoints of the input
    preset: Preset
    surface: MovingSurface | None
    near: Float[Tensor, " T"]
    """Degree to which the hand interacts with the object, 0 to 1."""
    poses: Float[Tensor, " T"]
    """Reliability of the object's poses, 0 to 1."""
    samples: Float[Tensor, "S T 21 3"]
    chosen: int
    target: Float[Tensor, "1 T 21 3"]  # keypoints that the hand was fitted to
    state: HandState
    shaped: ShapedHand
    betas: Float[Tensor, " K"]
    seconds: dict[str, float]
    misfit: Misfit | None = None
    """What did not fit when the hand was cleaned with all the evidence, if that was undone."""

    @property
    def evidence(self) -> Float[Tensor, " T"]:
        """Share of each frame that is cleaned against the object."""
        return self.near * self.poses

    def joints(self) -> Float[Tensor, "T 21 3"]:
        """Keypoints of the result, metres, in the frame of `state`: the hand model's or, if the
        input has keypoints alone, those of the tracker's own skeleton (not for the paper's fit)."""
        state, shaped, fit = self.state, self.shaped, self.preset.fit
        if self.subject.start is not None or not isinstance(fit, FitConfig):
            return state.joints(shaped)[0]
        free = state
        trust = torch.ones_like(self.target[..., 0])
        if self.surface is not None and self.preset.contact:  # contact would bias the skeleton
            config = replace(fit, contact_rounds=0, finger_std=math.inf)
            free = fit_hand(self.target, trust, shaped, state, config=config)
        own = own_skeleton(free, self.target[0], trust[0], shaped)
        return self.subject.with_own_lengths(own).posed(state)[0]

    def fingers_apart(self) -> Float[Tensor, "T 5"]:
        """Signed distance of each finger of the result to the object, metres; see `touch`."""
        assert self.surface is not None, "there is an object"
        parts = [
            fingers_apart(
                self.state[some].verts(self.shaped)[0], self.surface.at(some), self.shaped.model
            )
            for some in blocks(len(self.near))
        ]
        return torch.cat(parts)

    def skin(self, frames: slice, *, given: bool = False) -> ChangingSurface:
        """The hand's surface in some frames, world frame, mirrored back for a left hand: of the
        result or, with `given`, of the input."""
        shaped, state = (self.subject.shaped, self.given) if given else (self.shaped, self.state)
        state = state[frames]
        return self.seen(ChangingSurface(state.verts(shaped)[0], shaped.model.faces))

    def seen(self, skin: ChangingSurface) -> ChangingSurface:
        """A surface, mirrored if this hand is (its own inverse)."""
        return skin.mirrored() if self.hand.mirrored else skin

    def leaving(self, other: ChangingSurface, frames: slice, kept: slice) -> "FittedHand":
        """The hand fitted again in some frames to correct half of its penetration of the other
        hand; only the frames `kept` (relative to `frames`) change."""
        assert isinstance(self.preset.fit, FitConfig), "hands are fitted by least squares"
        target = self.target[:, frames]
        surface = self.surface if self.preset.contact else None
        found = fit_hand(
            target,
            torch.ones_like(target[..., 0]),
            self.shaped,
            self.state[frames],
            config=replace(self.preset.fit, iterations=0, contact_rounds=1),
            surface=None if surface is None else surface.at(frames),
            evidence=self.evidence[frames],
            other=self.seen(other),
        )[kept]
        stop = frames.start + kept.stop
        before, after = self.state[: frames.start + kept.start], self.state[stop:]
        return replace(self, state=concatenated([before, found, after]))

    def calmed_from(self, before: "FittedHand") -> "FittedHand":
        """The hand without jumps in what changed since `before`."""
        assert isinstance(self.preset.fit, FitConfig), "hands are fitted by least squares"
        joints = before.state.joints(self.shaped)
        calm = without_jumps(self.state, joints, self.shaped, self.preset.fit, most=1.0)
        return replace(self, state=calm)

    def result(self) -> HandResult:
        """The hand's track and its measures."""
        fps, state, shaped, subject = self.hand.fps, self.state, self.shaped, self.subject
        joints = self.joints()
        observed = self.hand.track.observed  # the report compares the same frames before and after
        spread = None
        if len(self.samples) > 1:
            spread = joint_spread(
                self.samples, given=subject.joints, alone=1 - self.evidence, observed=observed
            )
        before, apart_before = measure_hand(
            self.given, subject.shaped, self.given_joints, self.surface, fps, observed
        )
        after, apart = measure_hand(
            state, shaped, joints, self.surface, fps, observed, within=EXACT_WITHIN
        )
        touch = self.near.max() * self.poses
        seen = subject.trust > 0
        apart_from_given = (joints - self.given_joints).norm(dim=-1)
        of_frames = (apart_from_given * seen).sum(-1) / seen.sum(-1).clamp(min=1)
        doubts: Iterable[str] = ()
        weight = () if self.misfit is None else self.misfit.note()
        if self.misfit is None and self.preset.has_object:
            weight = doubt(self.hand.frames_to_user(self.evidence))
        if apart is not None and apart_before is not None and self.preset.has_object:
            given = HandAtObject(self.given_joints, apart_before)
            doubts = contradictions(given, HandAtObject(joints, apart), observed, self.evidence)
        return HandResult(
            track=clean_track(state, joints, self.betas, shaped.model.name, spread),
            filled=~observed,
            samples=self.samples,
            chosen=self.chosen,
            before=before,
            after=after,
            moved=float(apart_from_given[seen].mean()),
            moved_most=float(of_frames.max()),
            windows=len(window_starts(subject.joints.shape[0])),
            contact=None if apart is None else finger_contact(apart, spread, touch),
            evidence=self.evidence,
            seconds=self.seconds,
            notes=(
                *subject.notes,
                *subject.never_seen(),
                *weight,
                *doubts,
                *through_walls(before, after),
            ),
        )


@torch.no_grad()
def kept_apart(hands: list[FittedHand]) -> tuple[list[FittedHand], tuple[float, float] | None]:
    """The hands without penetration between two of them, unchanged where they only touch; and
    `Denoised.hands_in_each_other`."""
    if len(hands) < 2:
        return hands, None
    before, depth = (_depth_between(hands, given=given) for given in (True, False))
    if hands[0].preset.apart and bool((depth > 0).any()):
        hands = _taken_apart(hands, depth > 0)
        depth = _depth_between(hands)
    return hands, (float(before.max()), float(depth.max()))


def _taken_apart(given: list[FittedHand], inside: Bool[Tensor, " T"]) -> list[FittedHand]:
    """Two hands, fitted again around the frames with penetration, without jumps where the side by
    which one leaves the other changes."""
    hands = given
    near = np.convolve(np.pad(inside.cpu().numpy(), FELT), np.ones(2 * FELT + 1), "valid") > 0
    for run in runs(near):
        wide, kept = widened(run, FELT, len(near))
        for _ in range(ROUNDS):
            skins = [hand.skin(wide) for hand in hands]
            pairs = zip(hands, reversed(skins), strict=True)
            hands = [hand.leaving(other, wide, kept) for hand, other in pairs]
    return [hand.calmed_from(free) for hand, free in zip(hands, given, strict=True)]


def _depth_between(hands: list[FittedHand], *, given: bool = False) -> Float[Tensor, " T"]:
    """Penetration depth between two hands in each frame, metres; see `depth_between`."""
    found = []
    for block in blocks(len(hands[0].near)):
        one, other = (hand.skin(block, given=given) for hand in hands)
        found.append(depth_between(one, other))
    return torch.cat(found)
