"""Hand shape (betas) of a sequence, from the rest skeleton or from bone lengths."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.hand.model import HandModel, ShapedHand
from geneoh.hand.skeleton import KEYPOINT_PARENTS, OPENPOSE_FROM_MANO, bone_lengths

OFFSET_STD = 0.0005  # standard deviation of a rest offset from pose and joints, metres
BONE_STD = 0.002  # standard deviation of a bone length from noisy joints alone, metres
GAUSS_NEWTON_STEPS = 8
SIZE_FRAMES, STEADY_BONE = 10, 0.007
"""Least frames, and largest standard deviation of lengths in metres, that tell a hand's size."""
BONES = [mano - 1 for mano in OPENPOSE_FROM_MANO[1:]]
"""Row of the rest offsets of each of the `bone_lengths`: row m - 1 ends in joint or tip m."""
NORMAL_SPREAD = 1.4826  # standard deviation of a normal distribution / its median absolute value


def _skeleton_basis(model: HandModel) -> tuple[Float[Tensor, "20 3"], Float[Tensor, "20 3 S"]]:
    """Rest offsets at zero betas and their derivative in each beta; they are linear in betas."""
    count = model.shape_dirs.shape[-1]
    mean = model.shaped(model.template.new_zeros(count)).offsets
    each = model.shaped(torch.eye(count).to(model.template)).offsets
    return mean, (each - mean).permute(1, 2, 0)


def betas_from_offsets(
    model: HandModel, offsets: Float[Tensor, "20 3"], known: Bool[Tensor, " 20"] | None = None
) -> Float[Tensor, " S"]:
    """Betas whose rest skeleton is nearest to the given one, under a standard normal prior; of the
    offsets only those `known` count."""
    mean, basis = _skeleton_basis(model)
    if known is not None:
        mean, basis, offsets = mean[known], basis[known], offsets[known]
    rows = basis.flatten(0, 1) / OFFSET_STD
    wanted = (offsets - mean).flatten() / OFFSET_STD
    eye = torch.eye(basis.shape[-1]).to(basis)
    return torch.linalg.solve(rows.T @ rows + eye, rows.T @ wanted)


def betas_from_lengths(model: HandModel, lengths: Float[Tensor, " 20"]) -> Float[Tensor, " S"]:
    """Betas that best reach the given `bone_lengths` (NaN: unknown) under a standard normal prior.

    Gauss-Newton: lengths are almost linear in the betas, so a few steps reach the optimum."""
    mean, basis = _skeleton_basis(model)
    known = lengths.isfinite()
    mean, basis, lengths = mean[BONES][known], basis[BONES][known], lengths[known]
    betas = mean.new_zeros(basis.shape[-1])
    eye = torch.eye(len(betas)).to(basis)
    for _ in range(GAUSS_NEWTON_STEPS):
        bones = mean + basis @ betas
        length = bones.norm(dim=-1)
        rows = torch.einsum("bcs,bc->bs", basis, bones / length[:, None]) / BONE_STD
        miss = (lengths - length) / BONE_STD
        betas = betas + torch.linalg.solve(rows.T @ rows + eye, rows.T @ miss - betas)
    return betas


def size_of(
    joints: Float[Tensor, "T 21 3"], trust: Float[Tensor, "T 21"], shaped: ShapedHand
) -> float:
    """Size of the hand of keypoints relative to a shaped hand, by the median over the bones; 1
    where lengths vary too much, or in too few frames, to tell it."""
    lengths, noise = measured_lengths(joints, trust)
    if len(joints) < SIZE_FRAMES or not bool(noise.nanmedian() < STEADY_BONE):
        return 1.0
    return float((lengths / shaped.offsets[BONES].norm(dim=-1)).nanmedian())


def measured_lengths(
    joints: Float[Tensor, "T 21 3"], trust: Float[Tensor, "T 21"]
) -> tuple[Float[Tensor, " 20"], Float[Tensor, " 20"]]:
    """Median `bone_lengths` over frames in which both ends are trusted, and the standard deviation
    of a measured length, metres; NaN without any.

    The median is corrected for noise: noise of standard deviation s across a bone of length b
    lengthens it by s^2 / b, and s is the standard deviation of the measured length.
    """
    ends = (trust[:, 1:] > 0) & (trust[:, list(KEYPOINT_PARENTS[1:])] > 0)
    lengths = bone_lengths(joints).masked_fill(~ends, torch.nan)
    median = lengths.nanmedian(0).values
    noise = NORMAL_SPREAD * (lengths - median).abs().nanmedian(0).values
    return (median + (median**2 - 4 * noise**2).clamp(min=0).sqrt()) / 2, noise
