"""Hands after their own fits: two of them are taken out of each other, then each is measured."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.fitting.fit import fit_hand
from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.own_skeleton import own_skeleton
from geneoh.fitting.subject import Subject
from geneoh.fitting.terms import HandState
from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.distance import MovingSurface
from geneoh.hand.model import ShapedHand
from geneoh.metrics.contact import depth_between
from geneoh.metrics.report import through_walls
from geneoh.objects.evidence import doubt
from geneoh.pipeline.presets import Preset
from geneoh.pipeline.results import HandResult, clean_track
from geneoh.pipeline.spread import joint_spread
from geneoh.pipeline.stages.alone import measure_hand
from geneoh.pipeline.touch import REACH, finger_contact
from geneoh.sequence.normalisation import NormalisedHand
from geneoh.sequence.windows import blocks, runs, widened, window_starts

FELT = 20  # frames around those with hands inside each other that are fitted anew with them
ROUNDS = 2  # in each, a hand leaves the skin that the other one had before the round


@dataclass(frozen=True)
class FittedHand:
    """What is known of one normalised hand after its stages and its fit."""

    hand: NormalisedHand
    subject: Subject
    given: HandState  # the input as hand parameters, before anything was undone in it
    given_joints: Float[Tensor, "T 21 3"]  # the keypoints of the input
    preset: Preset
    surface: MovingSurface | None
    near: Float[Tensor, " T"]
    """How far the hand deals with the object, 0 to 1; `poses` is how far its poses are right."""
    poses: Float[Tensor, " T"]
    samples: Float[Tensor, "S T 21 3"]
    chosen: int
    target: Float[Tensor, "1 T 21 3"]  # what the hand was fitted to
    state: HandState
    shaped: ShapedHand
    betas: Float[Tensor, " K"]
    seconds: dict[str, float]

    @property
    def evidence(self) -> Float[Tensor, " T"]:
        """Share of each frame that is cleaned against the object."""
        return self.near * self.poses

    def joints(self) -> Float[Tensor, "T 21 3"]:
        """Keypoints of the result, metres, in the frame of the hand: the model's, and where the
        input is keypoints alone those that it has on the hand, but not for the paper's fit."""
        state, shaped, fit = self.state, self.shaped, self.preset.fit
        if self.subject.start is not None or not isinstance(fit, FitConfig):
            return state.joints(shaped)[0]
        free = state
        trust = torch.ones_like(self.target[..., 0])
        if self.surface is not None and self.preset.contact:  # contact is no part of the skeleton
            config = replace(fit, contact_rounds=0)
            free = fit_hand(self.target, trust, shaped, state, config=config)
        return own_skeleton(free, self.target[0], trust[0], shaped).posed(state)[0]

    def skin(self, frames: slice, *, given: bool = False) -> ChangingSurface:
        """The skin of the result in some frames of the world, in which the hand may be a left one;
        or of the input where that was `given`."""
        shaped, state = (self.subject.shaped, self.given) if given else (self.shaped, self.state)
        state = state[frames]
        return self.seen(ChangingSurface(state.verts(shaped)[0], shaped.model.faces))

    def seen(self, skin: ChangingSurface) -> ChangingSurface:
        """A skin of the world as this hand sees it, and back."""
        return skin.mirrored() if self.hand.mirrored else skin

    def leaving(self, other: ChangingSurface, frames: slice, kept: slice) -> "FittedHand":
        """The hand fitted anew in some frames, of which those `kept` change, half the way out of
        another one's skin."""
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

    def result(self) -> HandResult:
        """The hand's track and what is measured of it."""
        fps, state, shaped, subject = self.hand.fps, self.state, self.shaped, self.subject
        joints = self.joints()
        several = len(self.samples) > 1
        spread = joint_spread(self.samples, alone=1 - self.evidence) if several else None
        observed = self.hand.track.observed  # the report compares the same frames before and after
        before, _ = measure_hand(
            self.given, subject.shaped, self.given_joints, self.surface, fps, observed
        )
        after, apart = measure_hand(
            state, shaped, joints, self.surface, fps, observed, within=REACH
        )
        touch = self.near.max() * self.poses
        seen = subject.trust > 0
        return HandResult(
            track=clean_track(state, joints, self.betas, shaped.model.name, spread),
            filled=~observed,
            samples=self.samples,
            chosen=self.chosen,
            before=before,
            after=after,
            moved=float((joints - self.given_joints).norm(dim=-1)[seen].mean()),
            windows=len(window_starts(subject.joints.shape[0])),
            contact=None if apart is None else finger_contact(apart, spread, touch),
            evidence=self.evidence,
            seconds=self.seconds,
            notes=(
                *subject.notes,
                *(doubt(self.hand.frames_to_user(self.evidence)) if self.preset.has_object else ()),
                *through_walls(before, after),
            ),
        )


@torch.no_grad()
def kept_apart(hands: list[FittedHand]) -> tuple[list[FittedHand], tuple[float, float] | None]:
    """Two hands that are not inside each other, which stay as they are where they only touch; and
    `Denoised.hands_in_each_other`."""
    if len(hands) < 2:
        return hands, None
    before, depth = (_depth_between(hands, given=given) for given in (True, False))
    if hands[0].preset.apart and bool((depth > 0).any()):
        hands = _taken_apart(hands, depth > 0)
        depth = _depth_between(hands)
    return hands, (float(before.max()), float(depth.max()))


def _taken_apart(hands: list[FittedHand], inside: Bool[Tensor, " T"]) -> list[FittedHand]:
    """Two hands, fitted anew around the frames in which they are inside each other."""
    near = np.convolve(np.pad(inside.cpu().numpy(), FELT), np.ones(2 * FELT + 1), "valid") > 0
    for run in runs(near):
        wide, kept = widened(run, FELT, len(near))
        for _ in range(ROUNDS):
            skins = [hand.skin(wide) for hand in hands]
            pairs = zip(hands, reversed(skins), strict=True)
            hands = [hand.leaving(other, wide, kept) for hand, other in pairs]
    return hands


def _depth_between(hands: list[FittedHand], *, given: bool = False) -> Float[Tensor, " T"]:
    """`depth_between` two hands in each frame, metres."""
    found = []
    for block in blocks(len(hands[0].near)):
        one, other = (hand.skin(block, given=given) for hand in hands)
        found.append(depth_between(one, other))
    return torch.cat(found)
