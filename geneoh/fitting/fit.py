"""Hand parameters from keypoints and the object's surface: damped least squares over all frames."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.fitting.solve import solve_coupled_frames
from geneoh.fitting.terms import (
    UNKNOWNS,
    Equations,
    HandState,
    Planes,
    keypoint_term,
    pose_term,
    steadiness,
    surface_term,
)
from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.distance import MovingSurface, SurfaceQuery
from geneoh.geometry.rotations import axis_angle_to_matrix, kabsch
from geneoh.hand.model import ShapedHand
from geneoh.hand.skeleton import TIP_PARENTS
from geneoh.progress import OnStep, part_of
from geneoh.sequence.windows import blocks, widened

OVERLAP = 60
"""Frames that a block of a long track is solved beyond its own on either side. Terms couple only
neighbours, but turns that no keypoint shows are felt over some thirty frames."""
LONGEST_EXIT = 0.02
"""Longest way out of the object for a vertex, metres; no phalanx is thicker."""
PALM = (0, 1, 5, 9, 13, 17)
"""Keypoints that are rigid when the fingers bend: wrist, thumb base and the four knuckles."""
LEAST_TRUST = 1e-3
"""Weight of palm keypoints without trust, so that some orientation is found without any."""


@dataclass(frozen=True)
class FitConfig:
    """Numbers of steps, and the deviations and weights of the energy terms."""

    iterations: int = 4
    """Steps on keypoints alone."""
    contact_rounds: int = 4
    """Rounds of two steps with the surface; each round queries the distances anew."""
    joint_std: float = 0.003
    """Deviation of fitted keypoints from trusted targets, metres."""
    prior: float = 0.1
    """Weight of the relaxed pose, relative to one deviation of a keypoint."""
    limit: float = 20.0
    """Weight of overshooting a joint limit, 1/rad."""
    steady_finger: float = 16.0
    """Weight of a finger joint's change between frames, 1/rad."""
    steady_wrist: float = 4.0
    """Weight of the wrist's rotation between frames, 1/rad; its position has no such weight."""
    depth_std: float = 0.0015
    """Penetration that counts as much as a keypoint error of `joint_std`, metres: flesh is soft,
    and recorded hands penetrate by millimetres."""
    apart_std: float = 0.0005
    """The same for depth in the other hand, of which each hand sees its half."""
    touch: float = 0.003
    """Fingertips closer than this to the surface are attracted to it, metres."""
    touch_std: float = 0.002
    surface_verts: int = 96
    """Vertices per frame, nearest to or deepest in the object, that are considered."""


KEYPOINTS_ALONE = FitConfig(iterations=8, steady_finger=0.2, steady_wrist=0.0)
"""Settings for the mesh of an uncleaned track: close to its keypoints, jitter included."""


def start_from_keypoints(
    joints: Float[Tensor, "S T 21 3"],
    shaped: ShapedHand,
    trust: Float[Tensor, "S T 21"] | None = None,
) -> HandState:
    """Initial parameters where none are known: palm aligned to its keypoints, fingers relaxed.

    The wrist is given, or that of the aligned palm where it has no trust.
    """
    trust = torch.ones_like(joints[..., 0]) if trust is None else trust
    model = shaped.model
    rotations = axis_angle_to_matrix(model.pose_mean.clone()).expand(*joints.shape[:2], 16, 3, 3)
    rest = shaped.joints_from_rotations(
        torch.eye(3).to(joints).expand(16, 3, 3), joints.new_zeros(3)
    )
    palm = list(PALM)
    weights = trust[..., palm].clamp(min=LEAST_TRUST)
    turn, origin = kabsch(rest[palm].expand_as(joints[..., palm, :]), joints[..., palm, :], weights)
    wrist = torch.where(trust[..., :1] > 0, joints[..., 0, :], origin)
    rotations = torch.cat([turn[..., None, :, :], rotations[..., 1:, :, :]], dim=-3)
    return HandState(rotations, wrist)


def fit_hand(
    target: Float[Tensor, "S T 21 3"],
    trust: Float[Tensor, "S T 21"],
    shaped: ShapedHand,
    start: HandState,
    *,
    config: FitConfig,
    surface: MovingSurface | None = None,
    evidence: Float[Tensor, " T"] | None = None,
    other: ChangingSurface | None = None,
    on_step: OnStep | None = None,
) -> HandState:
    """Hand parameters that follow target keypoints of the world and stay out of the object.

    Levenberg-Marquardt on all frames at once, which a steadiness term couples: each step solves one
    block tridiagonal system per sample. Long tracks are solved in overlapping blocks. Source: paper
    A.3 for what is fitted; the solver, the temporal, limit and surface terms are ours.

    `trust` is the weight of each keypoint, 0 to 1; one without is determined by the other terms.
    `evidence` is how much the object counts in each frame, 0 to 1; fully without it. `other` is the
    skin of the other hand, out of which this one goes half the way.
    """
    frames, found = target.shape[1], []
    for index, block in enumerate(parts := blocks(frames)):
        wide, inner = widened(block, OVERLAP, frames)
        obstacles: list[Callable[[HandState, ShapedHand, FitConfig], Planes]] = []
        if surface is not None:
            near = Nearby(surface.at(wide), config.touch)
            share = None if evidence is None else evidence[wide]
            obstacles.append(partial(contact_planes, near=near, evidence=share))
        if other is not None:
            obstacles.append(partial(planes_apart, other=other[wide]))
        given = target[:, wide], trust[:, wide], shaped, start[wide], config, obstacles
        found.append(_fit_frames(*given, part_of(on_step, index, len(parts)))[inner])
    return concatenated(found)


def _fit_frames(
    target: Float[Tensor, "S T 21 3"],
    trust: Float[Tensor, "S T 21"],
    shaped: ShapedHand,
    start: HandState,
    config: FitConfig,
    obstacles: list[Callable[[HandState, ShapedHand, FitConfig], Planes]],
    on_step: OnStep | None,
) -> HandState:
    """`fit_hand` on all frames at once."""
    weight = trust.sqrt() / config.joint_std
    steady = steadiness_weight(config).to(target)
    rounds = config.contact_rounds if obstacles else 0
    total = config.iterations + 2 * rounds
    damping = target.new_full((len(target), 1), 1e-2)
    state, done = start, 0
    for around in range(rounds + 1):
        met = [planes(state, shaped, config) for planes in obstacles] if around else []

        def equations(at: HandState, met: list[Planes] = met) -> Equations:
            found = keypoint_term(at, shaped, target, weight)
            found = found + pose_term(at, shaped.model, config.prior, config.limit)
            for planes in met:
                found = found + surface_term(at, shaped, planes)
            return found

        here = equations(state)
        for _ in range(2 if around else config.iterations):
            state, here, damping = _step(state, here, equations, steady, damping)
            done += 1
            if on_step is not None:
                on_step(done, total)
    return state


def fit_keypoints(
    target: Float[Tensor, "S T 21 3"],
    trust: Float[Tensor, "S T 21"],
    shaped: ShapedHand,
    start: HandState | None = None,
) -> HandState:
    """The hand of an uncleaned track, from its own parameters or none; see `fit_hand`."""
    start = start or start_from_keypoints(target, shaped, trust)
    return fit_hand(target, trust, shaped, start, config=KEYPOINTS_ALONE)


def steadiness_weight(config: FitConfig) -> Float[Tensor, " 51"]:
    """Weight of each unknown's change between neighbouring frames."""
    weight = torch.zeros(UNKNOWNS)
    weight[:3], weight[3:48] = config.steady_wrist, config.steady_finger
    return weight


def _step(
    state: HandState,
    here: Equations,
    equations: Callable[[HandState], Equations],
    weight: Float[Tensor, " 51"],
    damping: Float[Tensor, "S 1"],
) -> tuple[HandState, Equations, Float[Tensor, "S 1"]]:
    """One damped step per sample, kept where it lowers the energy; then the damping falls."""
    steady, pull = steadiness(state, weight)
    before = (here.energy + steady).sum(-1, keepdim=True)
    scale = here.matrix.diagonal(dim1=-2, dim2=-1).mean((-1, -2))[:, None, None]
    ridge = (damping[..., None] * scale).expand(*here.gradient.shape)
    step = solve_coupled_frames(
        here.matrix + torch.diag_embed(ridge), -(here.gradient + pull), weight.square()
    )
    moved = state.moved(step)
    there = equations(moved)
    after = (there.energy + steadiness(moved, weight)[0]).sum(-1, keepdim=True)
    better = after < before
    damping = torch.where(better, damping / 4, damping * 6).clamp(1e-6, 1e3)
    return _pick(better[:, 0], moved, state), _pick(better[:, 0], there, here), damping


Found = TypeVar("Found", HandState, Equations)


def _pick(better: Bool[Tensor, " S"], new: Found, old: Found) -> Found:
    """`new` for the samples that got better, `old` for the others."""

    def picked(new: Tensor, old: Tensor) -> Tensor:
        return torch.where(better.view(-1, *[1] * (new.ndim - 1)), new, old)

    return type(new)(*map(picked, vars(new).values(), vars(old).values()))


class Nearby:
    """The surface around a hand that moves little from query to query.

    Vertices that cannot have come nearer than `reach` since they were last asked for, metres, are
    not asked for again: they stay where they were in all that is answered. Nor are those asked for
    exactly that are easily seen to be farther.
    """

    def __init__(self, surface: MovingSurface, reach: float) -> None:
        """No vertex is known yet."""
        self.surface, self.reach = replace(surface, within=reach), reach
        self._known: tuple[Tensor, SurfaceQuery] | None = None

    def query(self, verts: Float[Tensor, "S T V 3"]) -> SurfaceQuery:
        """Distance, closest point and normal of each vertex; those out of reach are older."""
        if self._known is None:
            found = self.surface.query(verts)
        else:
            before, found = self._known
            least = found.distance - (verts - before).norm(dim=-1)
            asked = least <= self.reach
            # a point that is not finite is not looked for
            new = self.surface.query(verts.masked_fill(~asked[..., None], torch.nan))
            found = SurfaceQuery(
                torch.where(asked, new.distance, found.distance),
                torch.where(asked[..., None], new.closest, found.closest),
                torch.where(asked[..., None], new.normal, found.normal),
            )
            verts = torch.where(asked[..., None], verts, before)
        self._known = verts, found
        return found


def contact_planes(
    state: HandState,
    shaped: ShapedHand,
    config: FitConfig,
    *,
    near: Nearby,
    evidence: Float[Tensor, " T"] | None = None,
) -> Planes:
    """Planes that push vertices out of the object and attract fingertips that nearly touch it.

    Other vertices near the object have no weight. `evidence` is that of `fit_hand`.
    """
    verts = shaped.verts_from_rotations(state.rotations, state.wrist).verts
    bone = shaped.model.skin_weights.argmax(-1)
    found = way_out(verts, bone, near.surface, near.query(verts))
    distance, index = found.distance.topk(config.surface_verts, dim=-1, largest=False)
    inside = (distance < 0).to(distance) / config.depth_std
    touching = torch.zeros_like(distance)
    for joint in TIP_PARENTS:
        apart = torch.where(bone[index] == joint, distance, torch.inf)
        value, at = apart.min(-1, keepdim=True)
        close = ((value > 0) & (value < config.touch)).to(distance)
        touching.scatter_add_(-1, at, close / config.touch_std)
    planes = _planes(found, index, inside + touching)
    if evidence is None:
        return planes
    return replace(planes, weight=planes.weight * evidence[:, None])


def planes_apart(
    state: HandState, shaped: ShapedHand, config: FitConfig, *, other: ChangingSurface
) -> Planes:
    """Planes that push vertices half the way out of the other hand, which goes the other half."""
    verts = shaped.verts_from_rotations(state.rotations, state.wrist).verts
    bone = shaped.model.skin_weights.argmax(-1)
    # by the nearest ways hands that mirror each other would go on together
    found = way_out(verts, bone, other, other.query(verts), agreement=1.0)
    found = replace(found, closest=(found.closest + verts) / 2)
    distance, index = found.distance.topk(config.surface_verts, dim=-1, largest=False)
    return _planes(found, index, (distance < 0).to(distance) / config.apart_std)


def _planes(
    found: SurfaceQuery, index: Int[Tensor, "S T K"], weight: Float[Tensor, "S T K"]
) -> Planes:
    """Planes at some vertices; those without a weight are left out, as far as all frames are."""
    weight, order = weight.sort(dim=-1, descending=True, stable=True)
    used = slice(max(1, int((weight > 0).sum(-1).max())))
    index = index.gather(-1, order[..., used])
    points = index[..., None].expand(*index.shape, 3)
    closest, normal = found.closest.gather(-2, points), found.normal.gather(-2, points)
    return Planes(index, closest, normal, weight[..., used])


def way_out(
    verts: Float[Tensor, "S T V 3"],
    bone: Int[Tensor, " V"],
    surface: MovingSurface | ChangingSurface,
    found: SurfaceQuery,
    agreement: float = 0.0,
) -> SurfaceQuery:
    """Distance to the object, with one direction out of it for each phalanx.

    The nearest side of a thin part may be the wrong one for deep vertices: those get the closest
    point and normal in the direction of their phalanx's outside part instead, where the cosine
    between both ways is less than `agreement`.
    """
    parts = torch.nn.functional.one_hot(bone).to(verts).T
    counted = torch.cat([verts, torch.ones_like(verts[..., :1])], dim=-1)
    inside = (found.distance < 0).to(verts)
    within = parts @ (inside[..., None] * counted)  # sums over the vertices of each phalanx
    outside = parts @ counted - within
    middles = [sums[..., :3] / sums[..., 3:] for sums in (within, outside)]
    ahead = torch.nn.functional.normalize(middles[1] - middles[0], dim=-1)[..., bone, :]
    # the direction of a phalanx that is wholly inside or outside is nan, which is never below 0
    wrong = (inside > 0) & ((found.normal * ahead).sum(-1) < agreement)
    if not wrong.any():
        return found
    sample, frame, vert = torch.nonzero(wrong, as_tuple=True)
    start, ahead = verts[sample, frame, vert], ahead[sample, frame, vert]
    reach, normal = surface.exits(frame, start, ahead)
    ok = reach < LONGEST_EXIT
    at = (sample[ok], frame[ok], vert[ok])
    closest, normals = found.closest.clone(), found.normal.clone()
    closest[at] = start[ok] + reach[ok, None] * ahead[ok]
    normals[at] = normal[ok]
    return SurfaceQuery(found.distance, closest, normals)
