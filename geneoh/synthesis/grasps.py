"""Grasps by batched gradient descent of a sphere-covered skeleton against analytic objects.

Each attempt is of one of `GRASP_TYPES`. The hand starts over a random point of the surface and
descends an energy of penetration, contact of the wanted pads, finger clearance and distance to a
likely pose. What passes `GraspChecks` is kept. Frames: the right hand's rest frame (fingers -x,
palm -y, thumb +z) and the object's frame; metres and radians.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.skeleton import forward_kinematics
from geneoh.nn.adam import adam
from geneoh.synthesis.contact_pads import (
    PAD_DIGITS,
    OtherHands,
    contact_pads,
    finger_clearance,
    hand_scale,
    hand_spheres,
)
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasp_types import GRASP_TYPES
from geneoh.synthesis.holding import unheld
from geneoh.synthesis.pose_prior import FINGER_HIGH, FINGER_LOW, FINGER_STD, beyond_range, curled
from geneoh.synthesis.solids import Solids
from geneoh.synthesis.table import Table

SOFT = 0.004
"""How deep a hand reaches into the table without cost, metres: fingers that reach under what lies
on it give way."""


@dataclass(frozen=True)
class GraspChecks:
    """What a kept grasp must pass."""

    depth: float = 0.003  # no sphere of the hand is deeper in the object, metres
    contact: float = 0.004
    """A pad that the type of grasp may want touches where it is nearer to the surface, metres."""
    fingers: int = 0
    """Digits that touch beyond those that the type needs; negative: contacts are not checked."""
    clearance: float = -0.004
    """Gap between spheres of different fingers, metres; less than zero because skin gives way."""
    deviations: float = 2.2
    """How far a component of a joint rotation may be outside of the range of the pose prior, in
    deviations of that prior (`FINGER_STD`), as below."""
    opposing: float = -0.2
    """Grips: the least cosine between the surface normals at two touching pads is below this."""
    bearing: float = 0.5
    """Hook and support: the cosine between the surface normal and the direction that bears on the
    hand is above this at one touching pad, which can lift, and nowhere below its negative."""
    unheld: float = 0.35
    """Grips: largest share of a push on the object that friction at touching pads does not bear."""
    skin: float = 0.0035
    """How much deeper than `depth` the skin may be, metres: spheres leave out the palm's flesh."""


@dataclass(frozen=True)
class GraspEnergy:
    """Weights of the terms of the energy that the descent minimises."""

    depth: float = 4e4  # of squared penetration of the hand's spheres, 1/m^2
    contact: float = 60.0  # of the distance of wanted pads to the surface, 1/m
    far_contact: float = 30.0
    """Of its square over the distance itself, 1/m: pads far from the surface are drawn faster."""
    facing: float = 0.25  # of 1 plus the cosine between a wanted pad's direction and the normal
    opposition: float = 3.0  # of what wanted pads of thumb and fingers lack to `opposed`, in grips
    opposed: float = 1.0
    """Agreement (up to 2) of two pads on either side of an object beyond which no more is asked."""
    clearance: float = 2e4  # of squared overlap of different fingers, 1/m^2
    liked: float = 0.12  # of the squared distance to the pose drawn for this hand, in deviations
    range: float = 2.0  # deviations outside of the range from which squares count in full
    wrong_side: float = 1e5  # of starting on the other side of an object than is asked for, 1/m^2


@dataclass(frozen=True)
class GraspConfig:
    """How grasps are looked for."""

    steps: int = 140  # descent steps of Adam with a cosine rate
    wrist_rate: float = 0.004  # first learning rate of the wrist's position, metres
    angle_rate: float = 0.03  # first learning rate of orientation and finger joints, radians
    last_rate: float = 1e-4  # last learning rate of all of them
    stop: float = 2.15  # deviations out of the range at which joints stop; < `checks.deviations`
    curl_std: float = 0.3  # deviation of the logarithm of the curl from digit to digit
    habit_std: float = 0.6  # deviation of the pose drawn for a hand, in deviations of each joint
    start_habit: float = 0.5  # share of that deviation with which the hand starts
    tilt_std: float = 0.25
    """Deviation of the hand's first orientation from facing the surface, radians on each axis."""
    start_reach: tuple[float, float] = (0.75, 1.25)
    """Range of a factor on how far along the palm the surface point lies at the start."""
    grips: int = 2  # other poses that are looked for in which a hand holds the same place
    grip_steps: float = 0.25  # descent steps for each, as a share of `steps`
    grip_turn_std: float = 0.12
    """Deviation of a grip's turn about the pads that touch, radians on each axis, at its start."""
    grip_shift_std: float = 0.004  # deviation of its shift, metres
    grip_habit_std: float = 0.25  # deviation of its fingers, in deviations of each joint
    energy: GraspEnergy = field(default_factory=GraspEnergy)
    checks: GraspChecks = field(default_factory=GraspChecks)


@dataclass(frozen=True)
class Grasps(Bundle):
    """Hands of B right-hand skeletons on B objects, in the objects' frames."""

    pose: Float[Tensor, "B 16 3"]
    wrist: Float[Tensor, "B 3"]
    offsets: Float[Tensor, "B 20 3"]
    kept: Bool[Tensor, " B"]  # whether the grasp passes the checks
    types: Int[Tensor, " B"]  # index into GRASP_TYPES of what was tried

    def posed(self) -> tuple[Float[Tensor, "B 21 3"], Float[Tensor, "B 16 3 3"]]:
        """Keypoints and the joints' global rotations."""
        return forward_kinematics(axis_angle_to_matrix(self.pose), self.wrist, self.offsets)


@dataclass(frozen=True)
class Grips(Bundle):
    """Other poses of B hands in which they hold the same place of their object, K of each."""

    pose: Float[Tensor, "B K 16 3"]
    wrist: Float[Tensor, "B K 3"]


@dataclass(frozen=True)
class _Attempt(Bundle):
    """What B hands try: one type of grasp each, on one object each."""

    types: Int[Tensor, " B"]
    offsets: Float[Tensor, "B 20 3"]
    liked: Float[Tensor, "B 15 3"]  # the finger pose that this hand likes, this time
    wanted: Bool[Tensor, "B 19"]  # pads that should touch
    table: Table | None = None
    other: OtherHands | None = None

    @cached_property
    def scale(self) -> Float[Tensor, "B 1"]:
        """Size of the hand, 1 for a mean adult."""
        return hand_scale(self.offsets)

    def depths_beside_object(
        self, centers: Float[Tensor, "B K 3"], radii: Float[Tensor, "B K"]
    ) -> list[Float[Tensor, "B K"]]:
        """How deep spheres of the hand are under the table and in the other hand, where there is
        one, metres; negative outside.
        """
        depths = [] if self.table is None else [self.table.depth(centers, radii) - SOFT]
        return depths if self.other is None else [*depths, self.other.depth(centers, radii)]


@dataclass(frozen=True)
class _Hands(Bundle):
    """Where B hands are on their way to a grasp, in the object's frame."""

    wrist: Float[Tensor, "B 3"]
    orient: Float[Tensor, "B 3"]
    fingers: Float[Tensor, "B 15 3"]

    @property
    def pose(self) -> Float[Tensor, "B 16 3"]:
        """Axis-angle of the global rotation and the finger joints."""
        return torch.cat([self.orient[:, None], self.fingers], dim=1)

    def posed(self, attempt: _Attempt) -> tuple[Tensor, Tensor]:
        """Keypoints and the joints' global rotations."""
        return forward_kinematics(axis_angle_to_matrix(self.pose), self.wrist, attempt.offsets)


def _of_type(name: str, types: Int[Tensor, " B"]) -> Float[Tensor, "B ..."]:
    """A field of `GraspType` for each hand."""
    return torch.tensor([getattr(each, name) for each in GRASP_TYPES], dtype=torch.float32)[types]


def _between(limits: Float[Tensor, "B C 2"], draws: Draws) -> Float[Tensor, "B C"]:
    """Numbers between limits, all of a hand at the same share of the way."""
    low, high = limits.unbind(-1)
    return low + (high - low) * draws.share(1)


def _draw_attempts(
    offsets: Float[Tensor, "B 20 3"], config: GraspConfig, draws: Draws
) -> tuple[_Attempt, Float[Tensor, "B 15 3"]]:
    """Random attempts, and the fingers with which they start."""
    shares = torch.tensor([each.share for each in GRASP_TYPES])
    types = torch.multinomial(shares, draws.batch, replacement=True, generator=draws.generator)
    curls = [_of_type("finger_curls", types)] * 4 + [_of_type("thumb_curls", types)]
    curl = _between(torch.stack(curls, dim=1), draws)
    curl = curl * (config.curl_std * draws.normal(5)).exp()
    habit = config.habit_std * FINGER_STD * draws.normal(15, 3)
    opposed = torch.ones(draws.batch, 15, 1)
    opposed[:, 12, 0] = _of_type("opposition", types)
    opened = _between(_of_type("opened", types)[:, None], draws)
    start = opposed * curled(curl * opened) + config.start_habit * habit
    joins = draws.share(6) < _of_type("digits", types)
    touches = draws.share(len(PAD_DIGITS)) < _of_type("pads", types)
    wanted = joins[:, list(PAD_DIGITS)] & touches
    return _Attempt(types, offsets, opposed * curled(curl) + habit, wanted), start


def _approach(
    solids: Solids,
    attempt: _Attempt,
    fingers: Float[Tensor, "B 15 3"],
    config: GraspConfig,
    draws: Draws,
) -> _Hands:
    """Hands over a random surface point each, which the side that their type names faces.

    They are turned at random about the surface normal.
    """
    surface, normals = solids.surface_points(1, generator=draws.generator, to_grasp=True)
    point, normal = surface[:, 0], normals[:, 0]
    across = torch.linalg.cross(normal, draws.normal(3))
    across = torch.nn.functional.normalize(across, dim=-1)
    there = torch.stack([across, -normal, torch.linalg.cross(across, -normal)], dim=-1)
    faces = _of_type("faces", attempt.types)
    ahead = faces.new_tensor([-1.0, 0.0, 0.0]).expand_as(faces)
    here = torch.stack([ahead, faces, torch.linalg.cross(ahead, faces)], dim=-1)
    rotation = there @ here.mT @ axis_angle_to_matrix(config.tilt_std * draws.normal(3))
    along, aside, below = _of_type("over", attempt.types)[..., None].unbind(1)
    reach = draws.uniform(config.start_reach, 1)
    palm = -along * reach * attempt.offsets[:, 3]
    palm = palm + torch.cat([torch.zeros_like(below), -below, aside], dim=-1)
    wrist = point - (rotation @ palm[..., None])[..., 0]
    return _Hands(wrist, matrix_to_axis_angle(rotation), fingers)


def _energy(
    solids: Solids, attempt: _Attempt, hands: _Hands, weight: GraspEnergy
) -> Float[Tensor, " B"]:
    """What the descent minimises."""
    joints, turns = hands.posed(attempt)
    centers, radii = hand_spheres(joints, attempt.scale)
    pads, facing = contact_pads(joints, turns, attempt.scale)
    points = torch.cat([centers, pads], 1)
    there, slope = solids.distance_and_normal(points.detach())
    # the same distance, whose gradient is the normal: one evaluation serves both
    distance = there + ((points - points.detach()) * slope).sum(-1)
    depth = (radii - distance[:, : centers.shape[1]]).clamp(min=0)
    for other in attempt.depths_beside_object(centers, radii):
        depth = depth + other.clamp(min=0)
    gap, normal = distance[:, centers.shape[1] :], slope[:, centers.shape[1] :]
    alignment = (1 + (facing * normal).sum(-1)) * attempt.wanted
    overlap = (-finger_clearance(centers, radii)).clamp(min=0)
    unlike = (hands.fingers - attempt.liked) / FINGER_STD
    beyond = (beyond_range(hands.fingers) - weight.range).clamp(min=0)
    missing = gap.abs() + weight.far_contact * gap.square()
    return (
        weight.depth * depth.square().sum(-1)
        + weight.contact * (attempt.wanted * missing).sum(-1)
        + weight.facing * alignment.sum(-1)
        + weight.opposition * _unopposed(attempt, facing, normal, weight.opposed)
        + weight.clearance * overlap.square().sum(-1)
        + (weight.liked * unlike.square() + beyond.square()).sum((-1, -2))
    )


def _unopposed(
    attempt: _Attempt,
    facing: Float[Tensor, "B 19 3"],
    normal: Float[Tensor, "B 19 3"],
    opposed: float,
) -> Float[Tensor, " B"]:
    """How far thumb and fingers of a grip are from facing each other across the object."""
    thumb = torch.tensor(PAD_DIGITS) == 4
    grips = torch.tensor([each.bears is None for each in GRASP_TYPES])[attempt.types]
    pairs = (attempt.wanted & thumb)[:, :, None] & (attempt.wanted & ~thumb)[:, None]
    pairs = pairs & grips[:, None, None]
    # the direction that one pad faces and the normal where the other one is should agree
    agree = facing @ normal.mT + normal @ facing.mT
    return (opposed - agree).clamp(min=0).mul(pairs).sum((1, 2)) / pairs.sum((1, 2)).clamp(min=1)


def _starts(
    solids: Solids,
    attempt: _Attempt,
    fingers: Float[Tensor, "B 15 3"],
    toward: Float[Tensor, "B 3"],
    config: GraspConfig,
    draws: Draws,
) -> _Hands:
    """Hands to start from: the best of as many approaches as the type draws."""
    start = _approach(solids, attempt, fingers, config, draws)
    counts = _of_type("approaches", attempt.types).long()
    (several,) = torch.nonzero(counts > 1, as_tuple=True)
    if len(several) == 0:
        return start
    which = several.repeat_interleave(counts[several])
    group = torch.arange(len(several)).repeat_interleave(counts[several])
    objects, tried = solids.take(which, "B"), attempt.take(which, "B")
    again = Draws(len(which), draws.generator)
    hands = _approach(objects, tried, fingers[which], config, again)
    energy = _energy(objects, tried, hands, config.energy)
    behind = (hands.wrist * toward[which]).sum(-1).clamp(max=0)
    energy = energy + config.energy.wrong_side * behind.square()
    mine = group == torch.arange(len(several))[:, None]
    best = torch.where(mine, energy, torch.inf).argmin(dim=1)
    start.wrist[several], start.orient[several] = hands.wrist[best], hands.orient[best]
    return start


def _descend(solids: Solids, attempt: _Attempt, start: _Hands, config: GraspConfig) -> _Hands:
    """The hands that minimise the energy."""
    low = FINGER_LOW - config.stop * FINGER_STD
    high = FINGER_HIGH + config.stop * FINGER_STD

    def rates(done: int) -> list[float]:
        fall = 0.5 + 0.5 * math.cos(math.pi * done / config.steps)
        firsts = (config.wrist_rate, config.angle_rate, config.angle_rate)
        return [config.last_rate + fall * (first - config.last_rate) for first in firsts]

    found = adam(
        lambda now: _energy(solids, attempt, _Hands(*now), config.energy).sum(),
        [start.wrist, start.orient, start.fingers],
        steps=config.steps,
        rate=rates,
        bounded=lambda now: [*now[:2], now[2].clamp(low, high)],
    )
    return _Hands(*found)


def _kept(
    solids: Solids, attempt: _Attempt, hands: _Hands, checks: GraspChecks
) -> Bool[Tensor, " B"]:
    """Grasps that pass every check."""
    joints, turns = hands.posed(attempt)
    centers, radii = hand_spheres(joints, attempt.scale)
    deep = (radii - solids.signed_distance(centers)).amax(-1)
    for other in attempt.depths_beside_object(centers, radii):
        deep = torch.maximum(deep, other.amax(-1))
    kept = (
        (deep < checks.depth)
        & (finger_clearance(centers, radii).amin(-1) > checks.clearance)
        & (beyond_range(hands.fingers).amax((-1, -2)) < checks.deviations)
    )
    if checks.fingers < 0:
        return kept
    pads, _ = contact_pads(joints, turns, attempt.scale)
    return kept & _holds(solids, attempt.types, pads, turns[:, 0], checks)


def _holds(
    solids: Solids,
    types: Int[Tensor, " B"],
    pads: Float[Tensor, "B 19 3"],
    turn: Float[Tensor, "B 3 3"],
    checks: GraspChecks,
) -> Bool[Tensor, " B"]:
    """Whether enough digits touch, on opposing surfaces or under a weight, as the type asks."""
    gap, normal = solids.distance_and_normal(pads)
    likely = _of_type("digits", types)[:, list(PAD_DIGITS)] * _of_type("pads", types)
    touching = (gap.abs() < checks.contact) & (likely > 0)
    digit = torch.nn.functional.one_hot(torch.tensor(PAD_DIGITS)).bool()
    touches = (touching[..., None] & digit).any(1).sum(-1)
    both = touching[:, :, None] & touching[:, None]
    opposed = torch.where(both, normal @ normal.mT, 1.0).amin((-1, -2)) < checks.opposing
    bears = torch.tensor([each.bears or (0.0, 0.0, 0.0) for each in GRASP_TYPES])[types]
    load = (normal @ (turn @ bears[..., None]))[..., 0]
    lifts = (torch.where(touching, load, -1.0).amax(-1) > checks.bearing) & (
        torch.where(touching, load, 1.0).amin(-1) > -checks.bearing
    )
    firm = opposed & (unheld(pads, normal, touching) < checks.unheld)
    held = torch.where(bears.any(-1), lifts, firm)
    return held & (touches >= _of_type("needed", types) + checks.fingers)


def synthesize_grasps(
    solids: Solids,
    offsets: Float[Tensor, "B 20 3"],
    config: GraspConfig | None = None,
    *,
    generator: torch.Generator,
    toward: Float[Tensor, "B 3"] | None = None,
    table: Table | None = None,
    other: OtherHands | None = None,
) -> Grasps:
    """One grasp attempt per object and hand; `kept` tells which ones pass the checks.

    The wrist starts on the side of the object that `toward` points to; zero is for any. Hands stay
    over the table and out of other hands, if there are any.
    """
    config, draws = config or GraspConfig(), Draws(len(offsets), generator)
    attempt, fingers = _draw_attempts(offsets, config, draws)
    attempt = replace(attempt, table=table, other=other)
    toward = torch.zeros(len(offsets), 3) if toward is None else toward
    start = _starts(solids, attempt, fingers, toward, config, draws)
    hands = _descend(solids, attempt, start, config)
    kept = _kept(solids, attempt, hands, config.checks)
    return Grasps(hands.pose, hands.wrist, offsets, kept, attempt.types)


def shifted_grips(
    solids: Solids, grasps: Grasps, config: GraspConfig, *, generator: torch.Generator
) -> Grips:
    """Grips near each grasp with the same pads: what hands shift and roll their object between.

    A grip that loses a pad or sinks into the object is replaced by the grasp itself.
    """
    each = torch.arange(len(grasps.pose)).repeat_interleave(config.grips)
    solids, grasps = solids.take(each, "B"), grasps.take(each, "B")
    draws = Draws(len(each), generator)
    joints, turns = grasps.posed()
    pads, _ = contact_pads(joints, turns, hand_scale(grasps.offsets))
    touching = solids.signed_distance(pads).abs() < config.checks.contact
    weight = touching.float()[..., None]
    pivot = (pads * weight).sum(1) / weight.sum(1).clamp(min=1)
    turn = axis_angle_to_matrix(config.grip_turn_std * draws.normal(3))
    wrist = pivot + (turn @ (grasps.wrist - pivot)[..., None])[..., 0]
    wrist = wrist + config.grip_shift_std * draws.normal(3)
    liked = grasps.pose[:, 1:] + config.grip_habit_std * FINGER_STD * draws.normal(15, 3)
    start = _Hands(wrist, matrix_to_axis_angle(turn @ turns[:, 0]), liked)
    attempt = _Attempt(grasps.types, grasps.offsets, liked, touching)
    config = replace(config, steps=max(1, round(config.grip_steps * config.steps)))
    hands = _descend(solids, attempt, start, config)
    kept = _kept(solids, attempt, hands, config.checks)[:, None]
    pose = torch.where(kept[..., None], hands.pose, grasps.pose)
    wrist = torch.where(kept, hands.wrist, grasps.wrist)
    return Grips(*(value.unflatten(0, (-1, config.grips)) for value in (pose, wrist)))


def settled_grasps(
    solids: Solids,
    grasps: Grasps,
    config: GraspConfig,
    *,
    reach: float,
    table: Table,
    other: OtherHands | None,
) -> Grasps:
    """The grasps next to given ones in which nothing sinks in and what is near touches.

    Pads within `reach` (metres) of the surface are drawn to it, or those that are next to it where
    none is. `kept` tells which grasps are no deeper in their object than the checks allow.
    """
    scale = hand_scale(grasps.offsets)
    joints, turns = grasps.posed()
    gap = solids.signed_distance(contact_pads(joints, turns, scale)[0])
    wanted = gap < (gap.amin(1, keepdim=True) + reach / 2).clamp(min=reach)
    fingers = grasps.pose[:, 1:]
    attempt = _Attempt(grasps.types, grasps.offsets, fingers, wanted, table, other)
    hands = _descend(solids, attempt, _Hands(grasps.wrist, grasps.pose[:, 0], fingers), config)
    centers, radii = hand_spheres(hands.posed(attempt)[0], scale)
    depth = (radii - solids.signed_distance(centers)).amax(1)
    return replace(grasps, pose=hands.pose, wrist=hands.wrist, kept=depth < config.checks.depth)
