"""The linear algebra of the fit: symmetric block tridiagonal systems with diagonal coupling."""

import numpy as np
import torch
from jaxtyping import Float
from scipy.linalg import solveh_banded
from torch import Tensor


def solve_coupled_frames(
    matrix: Float[Tensor, "S T U U"],
    right: Float[Tensor, "S T U"],
    coupling: Float[Tensor, " U"],
) -> Float[Tensor, "S T U"]:
    """Solve M x = right, where frames are coupled by -diag(coupling) between neighbours.

    `matrix` holds the diagonal blocks; the coupling (>= 0) is added to them once per neighbour, so
    that M is positive definite. No entry of M is farther than U from its diagonal: LAPACK's banded
    Cholesky factor, on the CPU, takes a third of the time of one factor per frame.
    """
    frames, size = right.shape[1:]
    springs = coupling.expand(frames, size).clone()
    springs[1:-1] *= 2
    if frames == 1:
        springs.zero_()
    blocks = (matrix + torch.diag_embed(springs)).cpu().numpy()
    band = np.zeros((len(blocks), size + 1, frames, size), blocks.dtype)
    for column in range(size):  # row d holds the entries d below the diagonal
        band[:, : size - column, :, column] = blocks[..., column:, column].swapaxes(1, 2)
    band[:, size] = -coupling.cpu().numpy()
    sides = right.flatten(1).cpu().numpy()
    solved = [
        solveh_banded(one.reshape(size + 1, -1), side, lower=True, overwrite_ab=True)
        for one, side in zip(band, sides, strict=True)
    ]
    return torch.from_numpy(np.stack(solved)).to(right).unflatten(1, (frames, size))
