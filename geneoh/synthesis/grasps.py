"""Grasps by batched gradient descent of a sphere-covered skeleton against analytic objects.

Each attempt is of one of `KINDS`, which says what of the hand should touch and how closed it likes
to be. The hand starts over a random point of the surface and slides down an energy of penetration,
contact of the wanted pads, finger clearance and distance to a natural pose. What passes the checks
of `Checks` is kept. Frames: the right hand's rest frame (fingers -x, palm -y, thumb +z) and the
object's frame; metres and radians.
"""

from dataclasses import dataclass, fields

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.skeleton import forward_kinematics
from geneoh.synthesis.contact_pads import (
    MEAN_SPAN,
    PAD_DIGITS,
    finger_clearance,
    hand_spheres,
    skin_pads,
)
from geneoh.synthesis.grasp_types import KINDS
from geneoh.synthesis.pose_prior import HIGH, LOW, NATURAL_STD, curled, overshoot
from geneoh.synthesis.solids import Solids

OPPOSED = 1.0
"""Agreement of two pads on either side of an object beyond which the search asks no more."""
STOP = 2.15
"""Deviations outside their natural range at which the search stops the joints."""
ASTRAY = 1e5
"""Energy of starting on the wrong side of an object, 1/m^2."""


@dataclass(frozen=True)
class Checks:
    """What a kept grasp must pass."""

    depth: float = 0.003
    """No sphere of the hand is deeper in the object, metres."""
    contact: float = 0.004
    """A pad touches whose distance to the surface is less, metres. Only pads that the kind of
    grasp may want count, here and below."""
    fingers: int = 0
    """Digits that touch beyond those that the kind needs; if negative, contacts are not checked."""
    clearance: float = -0.004
    """Gap between spheres of different fingers, metres; less than zero because skin gives way."""
    deviations: float = 2.2
    """How far each component of each joint's rotation may be outside its natural range, from half
    closed to three quarters closed, in natural deviations."""
    opposing: float = -0.2
    """Grips: the least cosine between the surface normals at two touching pads is below this."""
    bearing: float = 0.5
    """Hook and support, where weight takes the place of opposing contacts: at one touching pad the
    cosine between the surface normal and the direction that bears on the hand is above this, and
    nowhere below its negative. So the hand can lift, and no pad pushes straight down."""


@dataclass(frozen=True)
class Grasps:
    """Hands of B right-hand skeletons on B objects, in the objects' frames."""

    pose: Float[Tensor, "B 16 3"]
    wrist: Float[Tensor, "B 3"]
    offsets: Float[Tensor, "B 20 3"]
    kept: Bool[Tensor, " B"]
    kind: Int[Tensor, " B"]
    """Index into KINDS of what was tried."""

    def chosen(self, which: Bool[Tensor, " B"] | Int[Tensor, " C"]) -> "Grasps":
        """Some of the grasps."""
        return Grasps(*(getattr(self, field.name)[which] for field in fields(self)))


@dataclass(frozen=True)
class _Attempt:
    """What B hands try: one kind of grasp each, on one object each."""

    kind: Int[Tensor, " B"]
    offsets: Float[Tensor, "B 20 3"]
    scale: Float[Tensor, "B 1"]
    liked: Float[Tensor, "B 15 3"]
    """The natural pose of this hand, this time."""
    wanted: Bool[Tensor, "B 19"]
    """Pads that should touch."""

    def chosen(self, which: Int[Tensor, " C"]) -> "_Attempt":
        """Some of the attempts."""
        return _Attempt(*(getattr(self, field.name)[which] for field in fields(self)))


def _of_kind(name: str, kind: Int[Tensor, " B"]) -> Float[Tensor, "B ..."]:
    """A field of `Kind` for each hand."""
    return torch.tensor([getattr(each, name) for each in KINDS], dtype=torch.float32)[kind]


def _draw_attempts(
    offsets: Float[Tensor, "B 20 3"], *, generator: torch.Generator
) -> tuple[_Attempt, Float[Tensor, "B 15 3"]]:
    """Random attempts, and the fingers with which they start."""
    batch = len(offsets)
    shares = torch.tensor([kind.share for kind in KINDS])
    kind = torch.multinomial(shares, batch, replacement=True, generator=generator)
    low, high = torch.stack(
        [_of_kind("finger_curls", kind)] * 4 + [_of_kind("thumb_curls", kind)], dim=1
    ).unbind(-1)
    curl = low + (high - low) * torch.rand(batch, 1, generator=generator)
    curl = curl * (0.3 * torch.randn(batch, 5, generator=generator)).exp()
    habit = 0.6 * NATURAL_STD * torch.randn(batch, 15, 3, generator=generator)
    turned = torch.ones(batch, 15, 1)
    turned[:, 12, 0] = _of_kind("opposition", kind)
    low, high = _of_kind("opened", kind)[..., None].unbind(1)
    opened = low + (high - low) * torch.rand(batch, 1, generator=generator)
    fingers = turned * curled(curl * opened) + 0.5 * habit
    joins = torch.rand(batch, 6, generator=generator) < _of_kind("digits", kind)
    touch = torch.rand(batch, len(PAD_DIGITS), generator=generator) < _of_kind("pads", kind)
    span = offsets[:, [3, 4, 5, 16]].norm(dim=-1).sum(-1, keepdim=True)
    wanted = joins[:, list(PAD_DIGITS)] & touch
    liked = turned * curled(curl) + habit
    return _Attempt(kind, offsets, span / MEAN_SPAN, liked, wanted), fingers


def _approach(
    solids: Solids, attempt: _Attempt, *, generator: torch.Generator
) -> tuple[Float[Tensor, "B 3"], Float[Tensor, "B 3"]]:
    """Wrists and their orientations (axis-angle) over a random surface point each.

    The side of the hand that its kind names looks onto the surface, turned at random about the
    surface normal.
    """
    surface, normals = solids.surface_points(1, generator=generator)
    point, normal = surface[:, 0], normals[:, 0]
    random = torch.randn(point.shape, generator=generator)
    across = torch.nn.functional.normalize(torch.linalg.cross(normal, random), dim=-1)
    there = torch.stack([across, -normal, torch.linalg.cross(across, -normal)], dim=-1)
    faces = _of_kind("faces", attempt.kind)
    fingers = faces.new_tensor([-1.0, 0.0, 0.0]).expand_as(faces)
    here = torch.stack([fingers, faces, torch.linalg.cross(fingers, faces)], dim=-1)
    tilt = 0.25 * torch.randn(point.shape, generator=generator)
    rotation = there @ here.mT @ axis_angle_to_matrix(tilt)
    along, aside, below = _of_kind("over", attempt.kind)[..., None].unbind(1)
    reach = torch.rand(len(point), 1, generator=generator) * 0.5 + 0.75
    palm = -along * reach * attempt.offsets[:, 3]
    palm = palm + torch.cat([torch.zeros_like(below), -below, aside], dim=-1)
    wrist = point - (rotation @ palm[..., None])[..., 0]
    return wrist, matrix_to_axis_angle(rotation)


def _energy(
    solids: Solids,
    attempt: _Attempt,
    wrist: Float[Tensor, "B 3"],
    orient: Float[Tensor, "B 3"],
    fingers: Float[Tensor, "B 15 3"],
) -> Float[Tensor, " B"]:
    """What the descent makes small."""
    pose = torch.cat([orient[:, None], fingers], dim=1)
    joints, glob = forward_kinematics(axis_angle_to_matrix(pose), wrist, attempt.offsets)
    centers, radii = hand_spheres(joints, attempt.scale)
    pads, facing = skin_pads(joints, glob, attempt.scale)
    distance = solids.signed_distance(torch.cat([centers, pads], 1))
    depth = (radii - distance[:, : centers.shape[1]]).clamp(min=0)
    gap = distance[:, centers.shape[1] :]
    _, normal = solids.distance_and_normal(pads.detach())
    alignment = (1 + (facing * normal).sum(-1)) * attempt.wanted
    crowded = (-finger_clearance(centers, radii)).clamp(min=0)
    apart = (fingers - attempt.liked) / NATURAL_STD
    beyond = (overshoot(fingers) - 2.0).clamp(min=0)
    return (
        4e4 * depth.square().sum(-1)
        + 60.0 * (attempt.wanted * (gap.abs() + 30 * gap.square())).sum(-1)
        + 0.25 * alignment.sum(-1)
        + 3.0 * _unopposed(attempt, facing, normal)
        + 2e4 * crowded.square().sum(-1)
        + (0.12 * apart.square() + beyond.square()).sum((-1, -2))
    )


def _unopposed(
    attempt: _Attempt, facing: Float[Tensor, "B 19 3"], normal: Float[Tensor, "B 19 3"]
) -> Float[Tensor, " B"]:
    """How far thumb and fingers of a grip are from facing each other across the object."""
    thumb = torch.tensor(PAD_DIGITS) == 4
    grips = torch.tensor([kind.bears is None for kind in KINDS])[attempt.kind]
    pairs = (attempt.wanted & thumb)[:, :, None] & (attempt.wanted & ~thumb)[:, None]
    pairs = pairs & grips[:, None, None]
    # the direction in which one pad looks and the normal where the other one is should agree
    agree = facing @ normal.mT + normal @ facing.mT
    return (OPPOSED - agree).clamp(min=0).mul(pairs).sum((1, 2)) / pairs.sum((1, 2)).clamp(min=1)


def _starts(
    solids: Solids,
    attempt: _Attempt,
    fingers: Float[Tensor, "B 15 3"],
    toward: Float[Tensor, "B 3"],
    *,
    generator: torch.Generator,
) -> tuple[Float[Tensor, "B 3"], Float[Tensor, "B 3"]]:
    """Wrists and orientations to start from: the best approach of as many as the kind draws."""
    wrist, orient = _approach(solids, attempt, generator=generator)
    draws = _of_kind("approaches", attempt.kind).long()
    (choosy,) = torch.nonzero(draws > 1, as_tuple=True)
    if len(choosy) == 0:
        return wrist, orient
    which = choosy.repeat_interleave(draws[choosy])
    group = torch.arange(len(choosy)).repeat_interleave(draws[choosy])
    tried, objects = attempt.chosen(which), solids.chosen(which)
    wrists, orients = _approach(objects, tried, generator=generator)
    energy = _energy(objects, tried, wrists, orients, fingers[which])
    energy = energy + ASTRAY * (wrists * toward[which]).sum(-1).clamp(max=0).square()
    mine = group == torch.arange(len(choosy))[:, None]
    best = torch.where(mine, energy, torch.inf).argmin(dim=1)
    wrist[choosy], orient[choosy] = wrists[best], orients[best]
    return wrist, orient


def _kept(
    solids: Solids,
    attempt: _Attempt,
    wrist: Float[Tensor, "B 3"],
    pose: Float[Tensor, "B 16 3"],
    checks: Checks,
) -> Bool[Tensor, " B"]:
    """Grasps that pass every check."""
    joints, glob = forward_kinematics(axis_angle_to_matrix(pose), wrist, attempt.offsets)
    centers, radii = hand_spheres(joints, attempt.scale)
    pads, _ = skin_pads(joints, glob, attempt.scale)
    deep = (radii - solids.signed_distance(centers)).amax(-1)
    kept = (
        (deep < checks.depth)
        & (finger_clearance(centers, radii).amin(-1) > checks.clearance)
        & (overshoot(pose[:, 1:]).amax((-1, -2)) < checks.deviations)
    )
    if checks.fingers < 0:
        return kept
    kind = attempt.kind
    gap, normal = solids.distance_and_normal(pads)
    likely = _of_kind("digits", kind)[:, list(PAD_DIGITS)] * _of_kind("pads", kind)
    touching = (gap.abs() < checks.contact) & (likely > 0)
    digit = torch.nn.functional.one_hot(torch.tensor(PAD_DIGITS)).bool()
    touches = (touching[..., None] & digit).any(1).sum(-1)
    both = touching[:, :, None] & touching[:, None]
    opposed = torch.where(both, normal @ normal.mT, 1.0).amin((-1, -2)) < checks.opposing
    bears = torch.tensor([each.bears or (0.0, 0.0, 0.0) for each in KINDS])[kind]
    load = (normal @ (glob[:, 0] @ bears[..., None]))[..., 0]
    lifts = (torch.where(touching, load, -1.0).amax(-1) > checks.bearing) & (
        torch.where(touching, load, 1.0).amin(-1) > -checks.bearing
    )
    held = torch.where(bears.any(-1), lifts, opposed)
    enough = touches >= _of_kind("needed", kind) + checks.fingers
    return kept & enough & held


def synthesize_grasps(
    solids: Solids,
    offsets: Float[Tensor, "B 20 3"],
    *,
    generator: torch.Generator,
    steps: int = 140,
    checks: Checks | None = None,
    toward: Float[Tensor, "B 3"] | None = None,
) -> Grasps:
    """One grasp attempt per object; `kept` tells which ones pass the checks.

    Args:
        solids: the objects.
        offsets: the hands' rest offsets (see `geneoh.hand.skeleton`).
        generator: source of every random choice.
        steps: descent steps of Adam with a cosine rate.
        checks: what a grasp must pass to be kept.
        toward: direction in the object's frame on whose side the wrist starts; zero for any.
    """
    attempt, fingers = _draw_attempts(offsets, generator=generator)
    toward = torch.zeros(len(offsets), 3) if toward is None else toward
    wrist, orient = _starts(solids, attempt, fingers, toward, generator=generator)
    for parameter in (wrist, orient, fingers):
        parameter.requires_grad_(True)
    optimizer = torch.optim.Adam(
        [
            {"params": wrist, "lr": 0.004},
            {"params": orient, "lr": 0.03},
            {"params": fingers, "lr": 0.03},
        ]
    )
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps, eta_min=1e-4)
    for _ in range(steps):
        optimizer.zero_grad()
        _energy(solids, attempt, wrist, orient, fingers).sum().backward()
        optimizer.step()
        schedule.step()
        with torch.no_grad():
            fingers.clamp_(LOW - STOP * NATURAL_STD, HIGH + STOP * NATURAL_STD)

    with torch.no_grad():
        pose = torch.cat([orient[:, None], fingers], dim=1)
        kept = _kept(solids, attempt, wrist, pose, checks or Checks())
        return Grasps(pose, wrist.detach(), offsets, kept, attempt.kind)
