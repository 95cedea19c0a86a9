"""Grasps by batched gradient descent of a sphere-covered hand against an object's signed distance.

Each attempt is of one of `GRASP_TYPES`. The hand starts over a random surface point and minimises
`grasp_energy`; grasps that pass `GraspChecks` are kept. Frames: the right hand's rest frame
(fingers -x, palm -y, thumb +z) and the object's frame; metres and radians.
"""

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.config import Limited, Limits
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.skeleton import forward_kinematics
from geneoh.hand.spheres import hand_scale, hand_spheres
from geneoh.nn.adam import adam
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.contact_pads import PAD_DIGITS, Obstacles, contact_pads
from geneoh.synthesis.grasping.grasp_energy import (
    GraspAttempt,
    GraspChecks,
    GraspEnergy,
    Hands,
    grasp_energy,
    passes,
)
from geneoh.synthesis.grasping.grasp_types import (
    FINGER_HIGH,
    FINGER_LOW,
    FINGER_STD,
    GRASP_TYPES,
    curled,
    of_type,
)
from geneoh.synthesis.shapes.solids import Solids


@dataclass(frozen=True)
class GraspConfig(Limited):
    """Settings of the search for grasps."""

    LIMITS: ClassVar[Limits] = {"grips": (0, Limited.LARGEST)}

    steps: int = 140  # descent steps of Adam with a cosine rate
    wrist_rate: float = 0.004  # first learning rate of the wrist's position, metres
    angle_rate: float = 0.03  # first learning rate of orientation and finger joints, radians
    last_rate: float = 1e-4  # last learning rate of all of them
    stop: float = 2.15  # joint limits, `FINGER_STD` beyond the prior's range; < `checks.deviations`
    curl_std: float = 0.3  # standard deviation of the log of the curl between digits
    habit_std: float = 0.6  # standard deviation of the liked pose of a hand, in `FINGER_STD`
    start_habit: float = 0.5  # share of that offset from the prior that the start pose has
    tilt_std: float = 0.25
    """Standard deviation of the start's tilt off the surface normal, radians on each axis."""
    start_reach: tuple[float, float] = (0.75, 1.25)
    """Range of a factor on how far along the palm the surface point lies at the start."""
    grips: int = 2  # number of other poses in which a hand holds the same place, per grasp
    grip_steps: float = 0.25  # descent steps for each, as a share of `steps`
    grip_turn_std: float = 0.12
    """Standard deviation of a grip's start rotation about touching pads, radians on each axis."""
    grip_shift_std: float = 0.004  # standard deviation of its start translation, metres
    grip_habit_std: float = 0.25  # standard deviation of its finger pose, in `FINGER_STD`
    energy: GraspEnergy = field(default_factory=GraspEnergy)
    checks: GraspChecks = field(default_factory=GraspChecks)


@dataclass(frozen=True)
class Grasps(Bundle):
    """Hands of B right-hand skeletons on B objects, in the objects' frames."""

    pose: Float[Tensor, "B 16 3"]
    wrist: Float[Tensor, "B 3"]
    offsets: Float[Tensor, "B 20 3"]
    kept: Bool[Tensor, " B"]  # whether the grasp passes the checks
    types: Int[Tensor, " B"]  # index of the attempted type in GRASP_TYPES

    def posed(self) -> tuple[Float[Tensor, "B 21 3"], Float[Tensor, "B 16 3 3"]]:
        """Keypoints and the joints' global rotations."""
        return forward_kinematics(axis_angle_to_matrix(self.pose), self.wrist, self.offsets)


@dataclass(frozen=True)
class Grips(Bundle):
    """Other poses of B hands in which they hold the same place of their object, K of each."""

    pose: Float[Tensor, "B K 16 3"]
    wrist: Float[Tensor, "B K 3"]


def _between(limits: Float[Tensor, "B C 2"], draws: Draws) -> Float[Tensor, "B C"]:
    """Random numbers between limits: one share per hand interpolates all its C limits."""
    low, high = limits.unbind(-1)
    return low + (high - low) * draws.share(1)


def random_attempts(
    offsets: Float[Tensor, "B 20 3"], config: GraspConfig, draws: Draws
) -> tuple[GraspAttempt, Float[Tensor, "B 15 3"]]:
    """Random attempts, and the finger poses with which they start."""
    shares = torch.tensor([each.share for each in GRASP_TYPES])
    types = torch.multinomial(shares, draws.batch, replacement=True, generator=draws.generator)
    curls = [of_type("finger_curls", types)] * 4 + [of_type("thumb_curls", types)]
    curl = _between(torch.stack(curls, dim=1), draws)
    curl = curl * (config.curl_std * draws.normal(5)).exp()
    habit = config.habit_std * FINGER_STD * draws.normal(15, 3)
    opposed = torch.ones(draws.batch, 15, 1)
    opposed[:, 12, 0] = of_type("opposition", types)
    opened = _between(of_type("opened", types)[:, None], draws)
    start = opposed * curled(curl * opened) + config.start_habit * habit
    joins = draws.share(6) < of_type("digits", types)
    touches = draws.share(len(PAD_DIGITS)) < of_type("pads", types)
    wanted = joins[:, list(PAD_DIGITS)] & touches
    return GraspAttempt(types, offsets, opposed * curled(curl) + habit, wanted), start


def _approach(
    solids: Solids,
    attempt: GraspAttempt,
    fingers: Float[Tensor, "B 15 3"],
    config: GraspConfig,
    draws: Draws,
) -> Hands:
    """Start poses: each hand turns the side `GraspType.faces` to a random surface point.

    The rotation about the surface normal is random.
    """
    surface, normals = solids.surface_points(1, generator=draws.generator, to_grasp=True)
    point, normal = surface[:, 0], normals[:, 0]
    across = torch.linalg.cross(normal, draws.normal(3))
    across = torch.nn.functional.normalize(across, dim=-1)
    there = torch.stack([across, -normal, torch.linalg.cross(across, -normal)], dim=-1)
    faces = of_type("faces", attempt.types)
    ahead = faces.new_tensor([-1.0, 0.0, 0.0]).expand_as(faces)
    here = torch.stack([ahead, faces, torch.linalg.cross(ahead, faces)], dim=-1)
    rotation = there @ here.mT @ axis_angle_to_matrix(config.tilt_std * draws.normal(3))
    along, aside, below = of_type("over", attempt.types)[..., None].unbind(1)
    reach = draws.uniform(config.start_reach, 1)
    palm = -along * reach * attempt.offsets[:, 3]
    palm = palm + torch.cat([torch.zeros_like(below), -below, aside], dim=-1)
    wrist = point - (rotation @ palm[..., None])[..., 0]
    return Hands(wrist, matrix_to_axis_angle(rotation), fingers)


def _starts(
    solids: Solids,
    attempt: GraspAttempt,
    fingers: Float[Tensor, "B 15 3"],
    toward: Float[Tensor, "B 3"],
    config: GraspConfig,
    draws: Draws,
) -> Hands:
    """Start poses: the one of least energy among the `GraspType.approaches` that are drawn."""
    start = _approach(solids, attempt, fingers, config, draws)
    counts = of_type("approaches", attempt.types).long()
    (several,) = torch.nonzero(counts > 1, as_tuple=True)
    if len(several) == 0:
        return start
    which = several.repeat_interleave(counts[several])
    group = torch.arange(len(several)).repeat_interleave(counts[several])
    objects, tried = solids.take(which, "B"), attempt.take(which, "B")
    again = Draws(len(which), draws.generator)
    hands = _approach(objects, tried, fingers[which], config, again)
    energy = grasp_energy(objects, tried, hands, config.energy)
    behind = (hands.wrist * toward[which]).sum(-1).clamp(max=0)
    energy = energy + config.energy.wrong_side * behind.square()
    mine = group == torch.arange(len(several))[:, None]
    best = torch.where(mine, energy, torch.inf).argmin(dim=1)
    start.wrist[several], start.orient[several] = hands.wrist[best], hands.orient[best]
    return start


def _descend(solids: Solids, attempt: GraspAttempt, start: Hands, config: GraspConfig) -> Hands:
    """The hands that minimise the energy."""
    low = FINGER_LOW - config.stop * FINGER_STD
    high = FINGER_HIGH + config.stop * FINGER_STD

    def rates(done: int) -> list[float]:
        fall = 0.5 + 0.5 * math.cos(math.pi * done / config.steps)
        firsts = (config.wrist_rate, config.angle_rate, config.angle_rate)
        return [config.last_rate + fall * (first - config.last_rate) for first in firsts]

    found = adam(
        lambda now: grasp_energy(solids, attempt, Hands(*now), config.energy).sum(),
        [start.wrist, start.orient, start.fingers],
        steps=config.steps,
        rate=rates,
        bounded=lambda now: [*now[:2], now[2].clamp(low, high)],
    )
    return Hands(*found)


def synthesize_grasps(
    solids: Solids,
    offsets: Float[Tensor, "B 20 3"],
    config: GraspConfig | None = None,
    *,
    generator: torch.Generator,
    toward: Float[Tensor, "B 3"] | None = None,
    beside: Obstacles | None = None,
) -> Grasps:
    """One grasp attempt per pair of an object and a hand; `kept` marks those that pass the checks.

    The wrist starts on the side of the object that `toward` points to, or on any side where that is
    zero. Hands stay out of what is `beside` the object.
    """
    config, draws = config or GraspConfig(), Draws(len(offsets), generator)
    attempt, fingers = random_attempts(offsets, config, draws)
    attempt = replace(attempt, beside=beside)
    toward = torch.zeros(len(offsets), 3) if toward is None else toward
    start = _starts(solids, attempt, fingers, toward, config, draws)
    hands = _descend(solids, attempt, start, config)
    kept = passes(solids, attempt, hands, config.checks)
    return Grasps(hands.pose, hands.wrist, offsets, kept, attempt.types)


def shifted_grips(
    solids: Solids, grasps: Grasps, config: GraspConfig, *, generator: torch.Generator
) -> Grips:
    """Other poses near each grasp with the same touching pads, between which a hand can move.

    A grip that fails the checks is replaced by the grasp itself.
    """
    shape = len(grasps.pose), config.grips
    each = torch.arange(shape[0]).repeat_interleave(config.grips)
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
    start = Hands(wrist, matrix_to_axis_angle(turn @ turns[:, 0]), liked)
    attempt = GraspAttempt(grasps.types, grasps.offsets, liked, touching)
    config = replace(config, steps=max(1, round(config.grip_steps * config.steps)))
    hands = _descend(solids, attempt, start, config)
    kept = passes(solids, attempt, hands, config.checks)[:, None]
    pose = torch.where(kept[..., None], hands.pose, grasps.pose)
    wrist = torch.where(kept, hands.wrist, grasps.wrist)
    return Grips(*(value.unflatten(0, shape) for value in (pose, wrist)))


def settled_grasps(
    solids: Solids, grasps: Grasps, config: GraspConfig, *, reach: float, beside: Obstacles
) -> Grasps:
    """Passed grasps after a descent that removes penetration and brings near pads into contact.

    Pads within `reach` (metres) of the surface are pulled to it; if there is none, the nearest pads
    are. `kept` marks grasps that penetrate their object less than the checks allow.
    """
    scale = hand_scale(grasps.offsets)
    joints, turns = grasps.posed()
    gap = solids.signed_distance(contact_pads(joints, turns, scale)[0])
    wanted = gap < (gap.amin(1, keepdim=True) + reach / 2).clamp(min=reach)
    fingers = grasps.pose[:, 1:]
    attempt = GraspAttempt(grasps.types, grasps.offsets, fingers, wanted, beside)
    hands = _descend(solids, attempt, Hands(grasps.wrist, grasps.pose[:, 0], fingers), config)
    centers, radii = hand_spheres(hands.posed(attempt)[0], scale)
    depth = (radii - solids.signed_distance(centers)).amax(1)
    return replace(grasps, pose=hands.pose, wrist=hands.wrist, kept=depth < config.checks.depth)
