"""The paper's hand fit: Adam on keypoint and regularisation losses (eq. 11 to 13)."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.fitting.terms import HandState
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.model import HandModel


@dataclass(frozen=True)
class AdamFitConfig:
    """The public code's schedule; the paper gives none."""

    rigid_steps: int = 200
    rigid_rate: float = 0.1
    steps: int = 1000
    rate: float = 0.01
    joint_weight: float = 5000.0
    """Weight of the squared keypoint distance in 1/m^2: eq. (13) adds metres to radians unweighted,
    which ignores the keypoints."""
    regular: float = 0.0005
    """Weight of the mean squared finger pose."""
    shape: float = 0.0002
    """Weight of the mean squared betas."""
    smooth: float = 0.03
    """Weight of the squared pose change between frames."""


def fit_with_adam(
    target: Float[Tensor, "S T 21 3"],
    trust: Float[Tensor, "S T 21"],
    model: HandModel,
    *,
    config: AdamFitConfig,
    on_step: Callable[[int, int], None] | None = None,
) -> tuple[HandState, Float[Tensor, "S B"]]:
    """Hand parameters and betas by Adam from a flat hand at the wrist keypoint, in two phases.

    First orientation and position only, then everything. Nothing is taken from the input's own
    parameters. As in the public code one set of betas serves all frames; eq. (12) has one per frame,
    which no body keeps.
    """
    betas = target.new_zeros(len(target), 1, model.shape_dirs.shape[-1]).requires_grad_(True)
    orient = torch.zeros(*target.shape[:2], 1, 3).to(target).requires_grad_(True)
    fingers = torch.zeros(*target.shape[:2], 15, 3).to(target).requires_grad_(True)
    wrist = target[..., 0, :].clone().requires_grad_(True)
    total = config.rigid_steps + config.steps
    done = 0
    for parameters, steps, rate in (
        ([orient, wrist], config.rigid_steps, config.rigid_rate),
        ([orient, wrist, fingers, betas], config.steps, config.rate),
    ):
        optimizer = torch.optim.Adam(parameters, lr=rate)
        for _ in range(steps):
            rotations = axis_angle_to_matrix(torch.cat([orient, fingers], dim=-2))
            joints = model.shaped(betas).joints_from_rotations(rotations, wrist)
            off = (trust * (joints - target).square().sum(-1)).mean((1, 2))
            regular = fingers.square().mean((1, 2, 3))
            smooth = fingers.diff(dim=1).square().sum((-1, -2)).mean(1) if len(fingers[0]) > 1 else 0
            loss = config.joint_weight * off + config.regular * regular + config.smooth * smooth
            loss = loss + config.shape * betas.square().mean((1, 2))
            optimizer.zero_grad()
            loss.sum().backward()
            optimizer.step()
            done += 1
            if on_step is not None:
                on_step(done, total)
    with torch.no_grad():
        rotations = axis_angle_to_matrix(torch.cat([orient, fingers], dim=-2))
    return HandState(rotations, wrist.detach()), betas.detach()[:, 0]
