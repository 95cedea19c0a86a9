"""Hand parameters from keypoints and the object's surface: damped least squares over all frames."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import isfinite

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import concatenated, where
from geneoh.fitting.contact_planes import Nearby, contact_planes, planes_apart
from geneoh.fitting.fit_config import KEYPOINTS_ALONE, FitConfig
from geneoh.fitting.solve import solve_coupled_frames
from geneoh.fitting.terms import (
    UNKNOWNS,
    Equations,
    HandState,
    Planes,
    finger_term,
    keypoint_term,
    moving_keypoints,
    pose_term,
    steadiness,
    surface_term,
)
from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.rotations import axis_angle_to_matrix, kabsch
from geneoh.hand.model import HandModel, ShapedHand
from geneoh.progress import OnStep, counted, part_of
from geneoh.sequence.gaps import observed_around
from geneoh.sequence.keypoints import KNUCKLES
from geneoh.sequence.windows import blocks, widened

OVERLAP = 60
"""Overlap of the blocks of a long track on either side, frames. Terms couple only neighbours, but
rotations that no keypoint determines correlate over some thirty frames."""

RIGID = [0, 1, *KNUCKLES]
"""Keypoints that move rigidly with the palm: wrist, thumb base and the four knuckles."""
LEAST_TRUST = 1e-3
"""Lower bound of the weight of palm keypoints: an orientation exists even if all trust is zero."""
NOISE_FACTOR = 3.0
"""How much looser keypoints are fitted than their noise, so that the pose prior counts."""
IMPOSSIBLE = 0.75
"""A joint this far beyond its limits, in radians, has a pose that no hand can reach."""


def start_from_keypoints(
    joints: Float[Tensor, "S T 21 3"],
    shaped: ShapedHand,
    trust: Float[Tensor, "S T 21"] | None = None,
) -> HandState:
    """Initial pose parameters from keypoints alone: palm rigidly aligned, fingers relaxed.

    The wrist is the wrist keypoint or, where that has zero trust, the wrist of the aligned palm.
    """
    trust = torch.ones_like(joints[..., 0]) if trust is None else trust
    model = shaped.model
    rotations = axis_angle_to_matrix(model.pose_mean.clone()).expand(*joints.shape[:2], 16, 3, 3)
    rest = shaped.rest_keypoints()
    weights, palm = trust[..., RIGID].clamp(min=LEAST_TRUST), joints[..., RIGID, :]
    turn, origin = kabsch(rest[RIGID].expand_as(palm), palm, weights)
    wrist = torch.where(trust[..., :1] > 0, joints[..., 0, :], origin)
    rotations = torch.cat([turn[..., None, :, :], rotations[..., 1:, :, :]], dim=-3)
    return HandState(rotations, wrist)


def possible_start(start: HandState, model: HandModel) -> HandState:
    """The start with each joint rotation far beyond its limits interpolated from other frames.

    The optimiser cannot leave a rotation near 360 degrees, because the opposite sense of rotation
    is as near. A joint that is impossible in all frames of a sample gets the relaxed pose.
    """
    pose = start.pose[..., 1:, :]
    over = torch.maximum(pose - model.pose_high[1:], model.pose_low[1:] - pose).amax(-1)
    possible = over < IMPOSSIBLE
    if bool(possible.all()):
        return start
    rotations = start.rotations.clone()
    for sample, joint in torch.nonzero(~possible.all(1)).tolist():
        turns, right = rotations[sample, :, joint + 1], possible[sample, :, joint]
        if bool(right.any()):
            turns[:] = observed_around(right).rotations(turns[:, None])[:, 0]
        else:
            turns[:] = axis_angle_to_matrix(model.pose_mean[joint + 1])
    return replace(start, rotations=rotations)


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
    """Hand parameters that follow target keypoints (world frame) and stay out of the object.

    Levenberg-Marquardt on all frames at once, which a steadiness term couples: each step solves one
    block tridiagonal system per sample. Long tracks are solved in overlapping blocks. Source: paper
    A.3 for the parameters and the keypoint term; the solver, the temporal, limit and surface terms
    are ours.

    `trust` is the weight of each keypoint, 0 to 1; keypoints of zero trust follow from the other
    terms. `evidence` weights the object's surface term per frame, 0 to 1 (None: 1). `other` is the
    surface of the other hand; this hand corrects half of the penetration.
    """
    frames, found = target.shape[1], []
    start = possible_start(start, shaped.model)
    for index, block in enumerate(parts := blocks(frames)):
        wide, inner = widened(block, OVERLAP, frames)
        obstacles: list[Callable[[HandState, ShapedHand, FitConfig], Planes]] = []
        if surface is not None:
            near = Nearby(surface.at(wide), config.touch)
            share = None if evidence is None else evidence[wide]
            obstacles.append(partial(contact_planes, near=near, evidence=share))
        if other is not None:
            obstacles.append(partial(planes_apart, other=other[wide]))
        inputs = target[:, wide], trust[:, wide], shaped, start[wide], config, obstacles
        found.append(_fit_frames(*inputs, part_of(on_step, index, len(parts)))[inner])
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
    report = counted(on_step, config.iterations + 2 * rounds)
    damping = target.new_full(target.shape[:2] if config.by_frame else (len(target), 1), 1e-2)
    state = start
    for around in range(rounds + 1):
        met = [planes(state, shaped, config) for planes in obstacles] if around else []

        def equations(at: HandState, met: list[Planes] = met) -> Equations:
            keypoints = moving_keypoints(at, shaped)
            found = keypoint_term(keypoints, target, weight)
            found = found + pose_term(at, shaped.model, config.prior, config.limit)
            if isfinite(config.finger_std):
                found = found + finger_term(keypoints, shaped, 1 / config.finger_std)
            for planes in met:
                found = found + surface_term(at, shaped, keypoints, planes)
            return found

        steps = 2 if around else config.iterations
        state, damping = minimise(state, equations, steady, damping, steps=steps, report=report)
    return state


def fit_keypoints(
    target: Float[Tensor, "S T 21 3"],
    trust: Float[Tensor, "S T 21"],
    shaped: ShapedHand,
    start: HandState | None = None,
    *,
    noise: float = 0.0,
    iterations: int = KEYPOINTS_ALONE.iterations,
) -> HandState:
    """Hand parameters of an uncleaned track; `start` is initialised from the keypoints if None.

    `noise` is the standard deviation of the keypoints' coordinates, metres: a hand that follows
    noisy keypoints closely bends and twists as no hand does.
    """
    start = start or start_from_keypoints(target, shaped, trust)
    std = max(KEYPOINTS_ALONE.joint_std, NOISE_FACTOR * noise)
    config = replace(KEYPOINTS_ALONE, iterations=iterations, joint_std=std)
    return fit_hand(target, trust, shaped, start, config=config)


def steadiness_weight(config: FitConfig) -> Float[Tensor, " 51"]:
    """Weight of the change of each of the 51 unknowns between neighbouring frames."""
    weight = torch.zeros(UNKNOWNS)
    weight[:3], weight[3:48] = config.steady_wrist, config.steady_finger
    return weight


def minimise(
    state: HandState,
    equations: Callable[[HandState], Equations],
    weight: Float[Tensor, " 51"],
    damping: Float[Tensor, "S D"],
    *,
    steps: int,
    report: Callable[[], None] = lambda: None,
) -> tuple[HandState, Float[Tensor, "S D"]]:
    """The state after some Levenberg-Marquardt steps on `equations`, and its damping.

    `weight` couples neighbouring frames (see `steadiness`); `report` is called after each step.
    """
    here = equations(state)
    for _ in range(steps):
        state, here, damping = _step(state, here, equations, weight, damping)
        report()
    return state, damping


def _step(
    state: HandState,
    here: Equations,
    equations: Callable[[HandState], Equations],
    weight: Float[Tensor, " 51"],
    damping: Float[Tensor, "S D"],
) -> tuple[HandState, Equations, Float[Tensor, "S D"]]:
    """One Levenberg-Marquardt step. It is accepted, and the damping lowered, where the energy
    falls, otherwise the damping rises: in each frame with D = T, in each sample with D = 1."""
    by_frame = damping.shape[1] == here.energy.shape[1]
    steady, pull = steadiness(state, weight)
    before, diagonal = here.energy + steady, here.matrix.diagonal(dim1=-2, dim2=-1)
    scale = diagonal.mean(-1) if by_frame else diagonal.mean((-1, -2))[:, None]
    before = before if by_frame else before.sum(-1, keepdim=True)
    ridge = (damping * scale)[..., None].expand(*here.gradient.shape)
    step = solve_coupled_frames(
        here.matrix + torch.diag_embed(ridge), -(here.gradient + pull), weight.square()
    )
    moved = state.moved(step)
    there = equations(moved)
    after = there.energy + steadiness(moved, weight)[0]
    better = (after if by_frame else after.sum(-1, keepdim=True)) < before
    damping = torch.where(better, damping / 4, damping * 6).clamp(1e-6, 1e3)
    return where(better, moved, state), where(better, there, here), damping
