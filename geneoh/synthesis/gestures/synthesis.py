"""Synthesis of clips: the roles of both hands, and bodies whose arms reach for the hands' motion.

Hands make gestures, or hold the object of an action.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.body.arms import reach
from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import JOINT_NAMES, Skeleton, embedded_skeleton
from geneoh.choices import SIDES, Side
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points, mirror_rotations
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.synthesis.actions.action import VERBS, Actions
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.gestures.clips import NAMES, REST, Gestures
from geneoh.synthesis.gestures.hands import HandMotion, perform, resting_hand
from geneoh.synthesis.gestures.manipulation import IN_REACH, MOST_BEND, doings, manipulating
from geneoh.synthesis.gestures.one_handed import MIRRORED, ONE_HANDED
from geneoh.synthesis.gestures.repertoire import (
    REST_SAYS,
    RESTS,
    Gesture,
    GestureShares,
    PairGesture,
)
from geneoh.synthesis.gestures.sentences import Doing, hand_sentence, joined_sentences
from geneoh.synthesis.gestures.stance import (
    StanceConfig,
    body_offsets,
    draw_gait,
    standing_bodies,
)
from geneoh.synthesis.gestures.two_handed import TWO_HANDED
from geneoh.synthesis.gestures.variation import (
    GestureTiming,
    HandSettings,
    Variation,
    draw_timing,
    variation_of,
)


@dataclass(frozen=True)
class Role:
    """What one hand does: a variant of a gesture, or rest."""

    name: str
    variant: int = -1
    gesture: Gesture | None = None  # None for rest

    @property
    def doing(self) -> Doing:
        """Phrases that describe it."""
        if self.gesture is None:
            return Doing(REST_SAYS, rests=True)
        return Doing(self.gesture.says)


@dataclass(frozen=True)
class Roles:
    """What the left and the right hand do; a pair when they do it together."""

    left: Role
    right: Role
    pair: PairGesture | None = None
    mirrored: bool = False

    @property
    def together(self) -> bool:
        """Whether both hands keep one time."""
        return self.pair is not None or self.mirrored

    @property
    def doings(self) -> tuple[Doing, Doing]:
        """Phrases for the left and for the right hand; equal where they make one gesture."""
        if self.pair is not None:
            return Doing(self.pair.says), Doing(self.pair.says)
        return self.left.doing, self.right.doing


def draw_roles(variants: Sequence[tuple[str, int]], shares: GestureShares, draws: Draws) -> Roles:
    """Random roles of two hands; `variants` are pairs of a gesture's name and a variant."""

    def drawn(names: Collection[str]) -> Role:
        own = [each for each in variants if each[0] in names]
        name, variant = own[int(draws.integers(0, len(own)))]
        return Role(name, variant, ONE_HANDED.get(name))

    kind, known = draws.share().item(), {name for name, _ in variants}
    no_pair, no_mirrored = known.isdisjoint(TWO_HANDED), known.isdisjoint(MIRRORED)
    if known.isdisjoint(ONE_HANDED) or (kind < shares.together and not no_pair):
        role = drawn(TWO_HANDED)
        pair = TWO_HANDED[role.name]
        left = replace(role, gesture=pair.left or pair)
        return Roles(left, replace(role, gesture=pair), pair)
    if shares.together <= kind < shares.together + shares.mirrored and not no_mirrored:
        role = drawn(MIRRORED)
        return Roles(role, role, mirrored=True)
    if bool(draws.chance(shares.idle)):
        return Roles(Role(REST), Role(REST))
    one = drawn(ONE_HANDED)
    other = drawn(ONE_HANDED) if bool(draws.chance(shares.both)) else Role(REST)
    if one.name == other.name:  # no sentence describes one gesture at two different times
        other = Role(REST)
    return Roles(one, other) if bool(draws.chance(0.5)) else Roles(other, one)


def gesture_motions(
    roles: Roles, seated: bool, swing: Float[Tensor, "T 2"], settings: HandSettings, draws: Draws
) -> HandMotion:
    """The motion of both hands; `swing` is how far forward each swings while walking, metres."""
    frames = len(swing)
    rest = _rest_name(roles, seated, draws)
    shared = Variation.drawn(draws, settings, 0.5)
    timing: GestureTiming | None = None
    hands: list[HandMotion] = []
    for index, role in enumerate((roles.left, roles.right)):
        hand = resting_hand(RESTS[rest[index]], frames, swing[:, index], settings, draws)
        if role.gesture is not None:
            own = shared if roles.together else Variation.drawn(draws, settings, 0.5)
            variation = variation_of(role.name, role.variant, settings).combined_with(own)
            if roles.pair is not None and roles.pair.touches:
                variation = variation.with_palms_together()
            if timing is None or not roles.together:
                timing = draw_timing(role.gesture, variation.tempo, frames, settings, draws)
            later = roles.pair.apart if roles.pair is not None and index == 0 else 0.0
            own_time = replace(timing, phase=timing.phase + later)
            hand = perform(role.gesture, variation, own_time, hand, settings, draws)
        hands.append(hand)
    left, right = hands
    return _both(roles.pair, left, right, draws)


def _rest_name(roles: Roles, seated: bool, draws: Draws) -> tuple[str, str]:
    """The names in `RESTS` of the left and the right hand; the same if they act together."""
    if seated:
        return "lap", "lap"
    places = ["side"] * 5 + ["belly", "hip"]
    one, other = (places[int(draws.integers(0, len(places)))] for _ in SIDES)
    return (one, one) if roles.together else (one, other)


def _both(
    pair: PairGesture | None, left: HandMotion, right: HandMotion, draws: Draws
) -> HandMotion:
    """Both hands of a clip from two right hands, of which the first is mirrored."""
    place = mirror_points(left.place)
    if pair is not None and pair.cross:
        nearer = torch.tensor([0.0, -pair.cross, -0.5 * pair.cross])
        place = place + left.active[:, None] * nearer
    turn, fingers = mirror_rotations(left.turn), mirror_axis_angle(left.fingers)
    left = replace(left, place=place, turn=turn, fingers=fingers)
    both = HandMotion.stacked((left, right), 1)
    return replace(both, swivel=0.08 * draws.smooth(len(place), 2, 25.0)[0] + both.swivel)


@dataclass(frozen=True)
class BodyConfig:
    """Settings of what bodies and hands do and how they move."""

    shares: GestureShares = field(default_factory=GestureShares)
    hands: HandSettings = field(default_factory=HandSettings)
    stance: StanceConfig = field(default_factory=StanceConfig)


def gesturing(
    variants: list[tuple[str, int]],
    bodies: list[int],
    frames: int,
    config: BodyConfig,
    *,
    generator: torch.Generator,
) -> Gestures:
    """A clip of random gestures for each of the bodies."""
    one = Draws(1, generator)
    roles = [draw_roles(variants, config.shares, one) for _ in bodies]
    skeleton, motion = bodies_with_hands(roles, bodies, frames, config, generator)
    acts = [role.doings for role in roles]
    names = [[NAMES.index(r.left.name), NAMES.index(r.right.name)] for r in roles]
    made = [[r.left.variant, r.right.variant] for r in roles]
    labels = torch.tensor(names), torch.tensor(made), torch.tensor(bodies)
    length = torch.full((len(bodies),), frames)
    return with_sentences(motion, skeleton, labels, length, acts, generator)


def handling(
    actions: Actions,
    names: list[str],
    bodies: list[int],
    frames: int,
    config: BodyConfig,
    *,
    generator: torch.Generator,
) -> Gestures:
    """Bodies that perform actions; clips with wrists out of reach or bent too far are left out."""
    idle = [Roles(Role(REST), Role(REST))] * len(bodies)
    standing = replace(config, shares=replace(config.shares, walking=0.0))
    last = actions.length[:, None].clamp(max=frames) - 1
    actions = replace(actions.at_frames(torch.arange(frames).minimum(last)), length=last[:, 0] + 1)
    skeleton, body = bodies_with_hands(idle, bodies, frames, standing, generator)
    motion, missed, bent = manipulating(skeleton, body, actions, generator=generator)
    verb = torch.where(actions.hands, actions.verb[:, None] + NAMES.index(VERBS[0]), 0)
    labels = verb, torch.full_like(verb, -1), torch.tensor(bodies)
    acts = doings(actions, names, Doing(REST_SAYS, rests=True))
    made = with_sentences(motion, skeleton, labels, actions.length, acts, generator)
    return made.take((missed < IN_REACH) & (bent < MOST_BEND), "B")


def bodies_with_hands(
    roles: list[Roles],
    bodies: list[int],
    frames: int,
    config: BodyConfig,
    generator: torch.Generator,
) -> tuple[Skeleton, BodyMotion]:
    """Skeletons and motions of bodies whose hands play the passed roles."""
    one, draws = Draws(1, generator), Draws(len(bodies), generator)
    shares = (config.shares if each.pair is None else each.pair for each in roles)
    seated = torch.tensor([bool(one.chance(share.seated)) for share in shares])
    gait = draw_gait(seated, draws.chance(config.shares.walking), frames, config.stance, draws)
    swing = config.stance.arm_swing * torch.stack([-gait.swing, gait.swing], -1)
    each = [
        gesture_motions(role, bool(sits), moved, config.hands, one)
        for role, sits, moved in zip(roles, seated, swing, strict=True)
    ]
    hands = HandMotion.stacked(each, 0)
    skeleton = Skeleton(torch.stack([body_offsets(n, config.stance) for n in bodies]))
    fingers = axis_angle_to_matrix(hands.fingers.flatten(2, 3))
    body = standing_bodies(
        skeleton, gait, hands.active, hands.stroke, fingers, config.stance, draws
    )
    return skeleton, reach(skeleton, body, *in_world(skeleton, body, hands), hands.swivel)


def in_world(
    skeleton: Skeleton, body: BodyMotion, hands: HandMotion
) -> tuple[Float[Tensor, "B T 2 3"], Float[Tensor, "B T 2 3 3"]]:
    """World positions and rotations of the wrists, from those relative to the shoulders."""
    posed, chest = pose(skeleton, body), JOINT_NAMES.index("spine3")
    from_chest = []
    for index, side in enumerate(SIDES):
        shoulder, arm = shoulder_and_arm(skeleton, side)
        usual, usual_arm = shoulder_and_arm(embedded_skeleton(), side)
        scaled = (arm / usual_arm)[:, None, None] * hands.place[:, :, index]
        # inward offsets scale with the shoulders' width, so that hands meet in any body's middle
        sideways, out = shoulder[:, None, 0], hands.place[:, :, index, 0] / usual[0]
        inward = sideways * (1 + out)
        scaled[..., 0] = torch.where(out < 0, inward - sideways, scaled[..., 0])
        from_chest.append(shoulder[:, None] + scaled)
    turn = posed.rotations[:, :, chest, None]
    places = (turn @ torch.stack(from_chest, 2)[..., None])[..., 0]
    return posed.positions[:, :, chest, None] + places, turn @ hands.turn


def shoulder_and_arm(
    skeleton: Skeleton, side: Side
) -> tuple[Float[Tensor, "*B 3"], Float[Tensor, "*B"]]:
    """The place of a shoulder from the chest, and the length from there to the wrist, metres."""
    collar, shoulder, elbow, wrist = (
        skeleton.offsets[..., JOINT_NAMES.index(f"{side}_{name}"), :]
        for name in ("collar", "shoulder", "elbow", "wrist")
    )
    return collar + shoulder, elbow.norm(dim=-1) + wrist.norm(dim=-1)


def with_sentences(
    motion: BodyMotion,
    skeleton: Skeleton,
    labels: tuple[Int[Tensor, "B 2"], Int[Tensor, "B 2"], Int[Tensor, " B"]],
    length: Int[Tensor, " B"],
    acts: list[tuple[Doing, Doing]],
    generator: torch.Generator,
) -> Gestures:
    """Clips with labels (gestures, variants, bodies) and sentences that describe the hands."""
    frames = torch.arange(motion.root.shape[1]).minimum(length[:, None] - 1)
    rows = torch.arange(len(length))[:, None]
    one = {
        side: np.array([hand_sentence(side, each[n], generator=generator) for each in acts])
        for n, side in enumerate(SIDES)
    }
    return Gestures(
        *labels,
        length,
        motion.root[rows, frames],
        matrix_to_axis_angle(motion.rotations[rows, frames]),
        skeleton.offsets,
        **one,
        joined=np.array([joined_sentences(*each, generator=generator) for each in acts]),
    )
