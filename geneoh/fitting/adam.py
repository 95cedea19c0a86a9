"""The paper's hand fit by Adam: keypoint and regularisation losses (eq. 11 to 13)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh import progress
from geneoh.fitting.terms import HandState
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.model import HandModel
from geneoh.nn.adam import adam


@dataclass(frozen=True)
class AdamFitConfig:
    """Schedule and weights of the public code, with a third of its steps; the paper states none.

    Both phases use the keypoint weight of the public code's second phase. Norms are squared, as in
    that code; those of eq. (12) are not."""

    rigid_steps: int = 200
    rigid_rate: float = 0.1
    steps: int = 1000
    rate: float = 0.01
    joint_weight: float = 5000.0
    """Weight of the squared keypoint distance, 1/m^2. Eq. (13) has no weight, and without one the
    other terms dominate."""
    regular: float = 0.0005
    """Weight of the mean squared finger pose."""
    shape: float = 0.0002
    """Weight of the mean squared betas."""
    smooth: float = 0.03
    """Weight of the mean squared change of the finger pose between frames."""


def fit_with_adam(
    target: Float[Tensor, "S T 21 3"],
    trust: Float[Tensor, "S T 21"],
    model: HandModel,
    *,
    config: AdamFitConfig,
    on_step: progress.OnStep | None = None,
) -> tuple[HandState, Float[Tensor, "S B"]]:
    """Hand parameters and betas by Adam from a flat hand: first the wrist's rotation and position,
    then all parameters.

    As in the public code, all frames share one set of betas; eq. (12) has one set per frame.
    """
    samples, frames = target.shape[:2]
    orient = target.new_zeros(samples, frames, 1, 3)
    fingers = target.new_zeros(samples, frames, 15, 3)
    betas = target.new_zeros(samples, 1, model.shape_dirs.shape[-1])
    total = config.rigid_steps + config.steps

    def loss(wrist: Tensor, orient: Tensor, fingers: Tensor, betas: Tensor) -> Tensor:
        rotations = axis_angle_to_matrix(torch.cat([orient, fingers], dim=-2))
        joints = model.shaped(betas).joints_from_rotations(rotations, wrist)
        apart = (trust * (joints - target).square().sum(-1)).mean((1, 2))
        each = config.joint_weight * apart + config.regular * fingers.square().mean((1, 2, 3))
        each = each + config.shape * betas.square().mean((1, 2))
        if frames > 1:
            each = each + config.smooth * fingers.diff(dim=1).square().mean((1, 2, 3))
        return each.sum()

    wrist, orient = adam(
        lambda p: loss(p[0], p[1], fingers, betas),
        [target[..., 0, :], orient],
        steps=config.rigid_steps,
        rate=config.rigid_rate,
        on_step=on_step and (lambda done, _: on_step(done, total)),
    )
    wrist, orient, fingers, betas = adam(
        lambda p: loss(*p),
        [wrist, orient, fingers, betas],
        steps=config.steps,
        rate=config.rate,
        on_step=on_step and (lambda done, _: on_step(config.rigid_steps + done, total)),
    )
    rotations = axis_angle_to_matrix(torch.cat([orient, fingers], dim=-2))
    return HandState(rotations, wrist), betas[:, 0]
