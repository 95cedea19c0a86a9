"""The roles of both hands in a clip, and their motion."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import SIDES
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points, mirror_rotations
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.gestures.clips import REST
from geneoh.synthesis.gestures.hands import HandMotion, perform, resting_hand, stroke
from geneoh.synthesis.gestures.one_handed import MIRRORED, ONE_HANDED
from geneoh.synthesis.gestures.repertoire import (
    REST_SAYS,
    RESTS,
    Gesture,
    GestureShares,
    PairGesture,
)
from geneoh.synthesis.gestures.sentences import Doing
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


@dataclass(frozen=True)
class TwoHands(Bundle):
    """Both hands of a clip, relative to their shoulders in the body's axes; left, then right."""

    place: Float[Tensor, "*B T 2 3"]  # metres, for the arm length of the embedded skeleton
    turn: Float[Tensor, "*B T 2 3 3"]
    fingers: Float[Tensor, "*B T 2 15 3"]
    active: Float[Tensor, "*B T 2"]  # 0 at rest, 1 in the gesture
    stroke: Float[Tensor, "*B T 2"]  # 0 at the start of a stroke, 1 at its other end
    swivel: Float[Tensor, "*B T 2"]  # of the elbow, radians


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
) -> TwoHands:
    """The hands' motion; `swing` is how far forward each hand swings while walking, metres."""
    frames = len(swing)
    rest = _rest_name(roles, seated, draws)
    shared = Variation.drawn(draws, settings, 0.5)
    still = torch.zeros(frames)
    timing = GestureTiming(still, still)
    hands: list[tuple[HandMotion, Tensor, Tensor, Tensor]] = []
    for index, role in enumerate((roles.left, roles.right)):
        at_rest = resting_hand(RESTS[rest[index]], frames, swing[:, index], settings, draws)
        if role.gesture is None:
            hands.append((at_rest, still, still, still))
            continue
        own = shared if roles.together else Variation.drawn(draws, settings, 0.5)
        variation = variation_of(role.name, role.variant, settings).combined_with(own)
        if roles.pair is not None and roles.pair.touches:
            variation = variation.with_palms_together()
        if index == 0 or not roles.together:
            timing = draw_timing(role.gesture, variation.tempo, frames, settings, draws)
        later = roles.pair.apart if roles.pair is not None and index == 0 else 0.0
        own_time = replace(timing, phase=timing.phase + later)
        hand = perform(role.gesture, variation, own_time, at_rest, settings, draws)
        course = stroke(role.gesture.course, own_time.phase) * timing.active
        hands.append((hand, timing.active, course, role.gesture.swivel * timing.active))
    return _both(roles.pair, hands, draws)


def _rest_name(roles: Roles, seated: bool, draws: Draws) -> tuple[str, str]:
    """The names in `RESTS` of the left and the right hand; the same if they act together."""
    if seated:
        return "lap", "lap"
    places = ["side"] * 5 + ["belly", "hip"]
    one, other = (places[int(draws.integers(0, len(places)))] for _ in SIDES)
    return (one, one) if roles.together else (one, other)


def _both(
    pair: PairGesture | None, hands: list[tuple[HandMotion, Tensor, Tensor, Tensor]], draws: Draws
) -> TwoHands:
    """One clip from two right hands with activity, stroke and swivel; the first is mirrored."""
    (left, right), *courses = zip(*hands, strict=True)
    active, course, swivel = (torch.stack(each, 1) for each in courses)
    place = mirror_points(left.place)
    if pair is not None and pair.cross:
        nearer = torch.tensor([0.0, -pair.cross, -0.5 * pair.cross])
        place = place + active[:, :1] * nearer
    return TwoHands(
        torch.stack([place, right.place], 1),
        torch.stack([mirror_rotations(left.turn), right.turn], 1),
        torch.stack([mirror_axis_angle(left.fingers), right.fingers], 1),
        active,
        course,
        0.08 * draws.smooth(len(place), 2, 25.0)[0] + swivel,
    )
