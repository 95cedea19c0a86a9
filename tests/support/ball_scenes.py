"""A ball whose parts move, and hands near it, for stages that are asked for known answers."""

from dataclasses import replace

import torch
from draws import normal
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.pipeline.presets import StagePlan
from geneoh.pipeline.stages.context import StageContext
from geneoh.representation.parameters import HandParameters

PLAN = StagePlan(400, 3)
LONG = 90
"""Frames of two windows, which share the frames 30 to 59."""
TURN, SHIFT = axis_angle_to_matrix(torch.tensor([0.3, -0.8, 0.5])), torch.tensor([0.4, 1.0, -0.2])


def smooth(frames: int, *shape: int, seed: int = 0) -> Tensor:
    """Numbers of order one that change slowly over the frames."""
    time = torch.linspace(0, 0.05 * frames, frames).view(-1, *[1] * len(shape))
    return torch.sin(time + 3 * normal(*shape, seed=seed))


def scene(frames: int = 12, parts: int = 2) -> StageContext:
    """A ball of 4 cm whose parts move by themselves."""
    normals = torch.nn.functional.normalize(normal(60, 3, seed=1), dim=-1)
    return StageContext(
        points=0.04 * normals,
        normals=normals,
        part=torch.arange(60) % parts,
        rotation=axis_angle_to_matrix(0.5 * smooth(frames, parts, 3, seed=2)),
        translation=0.1 * smooth(frames, parts, 3, seed=3),
        trust=torch.ones(frames, 21),
        fps=30.0,
    )


def hands_at(context: StageContext, samples: int = 1, seed: int = 4) -> Tensor:
    """Keypoints within a centimetre of the ball, world frame."""
    around = torch.nn.functional.normalize(normal(21, 3, seed=seed), dim=-1)
    local = 0.046 * around + 0.003 * smooth(context.frames, 21, 3, seed=seed + 1)
    world = local @ context.rotation[:, 0].mT + context.translation[:, :1]
    return world.expand(samples, -1, -1, -1)


def parameters_at(context: StageContext, seed: int = 6) -> HandParameters:
    """A hand at the ball as parameters, world frame, one sample."""
    frames = context.frames
    turn = axis_angle_to_matrix(0.5 * smooth(frames, 3, seed=seed + 1))
    return HandParameters(
        (context.translation[:, 0] + 0.05 * smooth(frames, 3, seed=seed))[None],
        turn[None],
        0.3 * smooth(frames, 15, 3, seed=seed + 2)[None],
        load_hand("right").shaped(torch.zeros(1, 10)).offsets,
    )


def moved(context: StageContext) -> StageContext:
    """The same scene elsewhere in the world."""
    return replace(
        context, rotation=TURN @ context.rotation, translation=context.translation @ TURN.T + SHIFT
    )


def canonical(context: StageContext, joints: Tensor, goal: Tensor) -> Tensor:
    """Windows of `goal` in the canonical frames of the windows of `joints`."""
    return context.region(joints).to_canon(context.windows(goal))
