"""Solvers for the fits: symmetric block tridiagonal systems that couple neighbouring frames."""

import numpy as np
import torch
from jaxtyping import Float
from scipy.linalg import solveh_banded
from torch import Tensor


def solve_coupled_frames(
    matrix: Float[Tensor, "S T U U"], right: Float[Tensor, "S T U"], coupling: Float[Tensor, " U"]
) -> Float[Tensor, "S T U"]:
    """Solve M x = right for positive definite, block tridiagonal M.

    The diagonal blocks of M are `matrix` plus diag(coupling) once per neighbouring frame; the
    blocks beside them are -diag(coupling), with `coupling` >= 0."""
    frames, size = right.shape[1:]
    springs = coupling.expand(frames, size).clone()
    springs[1:-1] *= 2
    if frames == 1:
        springs.zero_()
    blocks = matrix + torch.diag_embed(springs)
    if right.is_cuda:
        beside = -torch.diag(coupling).expand(len(right), frames - 1, size, size)
        return solve_by_halves(blocks, beside, right)
    return solve_as_band(blocks, coupling, right)


def solve_as_band(
    diagonal: Float[Tensor, "S T U U"], coupling: Float[Tensor, " U"], right: Float[Tensor, "S T U"]
) -> Float[Tensor, "S T U"]:
    """Solve M x = right on the CPU, where M has the blocks -diag(coupling) beside its diagonal.

    LAPACK's banded Cholesky solver takes a third of the time of one factorisation per frame."""
    frames, size = right.shape[1:]
    blocks = diagonal.cpu().numpy()
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


def solve_by_halves(
    diagonal: Float[Tensor, "S T U U"],
    beside: Float[Tensor, "S T-1 U U"],
    right: Float[Tensor, "S T U"],
) -> Float[Tensor, "S T U"]:
    """Solve M x = right on the device of the tensors; fast on a GPU, which eliminates many frames
    at once.

    M is positive definite and block tridiagonal; `beside[t]` is the block in row t+1, column t.
    Every second frame is eliminated, which leaves a system of the same form (cyclic reduction;
    Golub and Van Loan, Matrix Computations, 3rd edition, 4.5.4).
    """
    odd, size = right.shape[1] // 2, right.shape[2]
    factor = torch.linalg.cholesky_ex(diagonal[:, 1::2] if odd else diagonal)[0]
    if not odd:
        return torch.cholesky_solve(right[..., None], factor)[..., 0]
    left, ahead = beside[:, ::2], beside[:, 1::2]  # coupling of odd frames to frames t-1 and t+1
    inner = ahead.shape[1]  # number of odd frames with a following frame
    behind = torch.nn.functional.pad(ahead.mT, (0, 0, 0, 0, 0, odd - inner))
    columns = torch.cat([left, behind, right[:, 1::2, :, None]], dim=-1)
    to_left, to_ahead, alone = torch.cholesky_solve(columns, factor).split((size, size, 1), dim=-1)
    kept, sides = diagonal[:, ::2].clone(), right[:, ::2, :, None].clone()
    kept[:, :odd] -= left.mT @ to_left
    sides[:, :odd] -= left.mT @ alone
    kept[:, 1:] -= ahead @ to_ahead[:, :inner]
    sides[:, 1:] -= ahead @ alone[:, :inner]
    even = solve_by_halves(kept, -ahead @ to_left[:, :inner], sides[..., 0])
    after = torch.nn.functional.pad(even[:, 1:], (0, 0, 0, odd - inner))
    moved = to_left @ even[:, :odd, :, None] + to_ahead @ after[..., None]
    found = torch.empty_like(right)
    found[:, ::2], found[:, 1::2] = even, (alone - moved)[..., 0]
    return found


def solve_chains(
    diagonal: Float[Tensor, "*B T"], beside: Float[Tensor, "*B T-1"], right: Float[Tensor, "*B T D"]
) -> Float[Tensor, "*B T D"]:
    """Solve M x = right for symmetric, diagonally dominant tridiagonal M, on any device.

    `beside` is the off-diagonal. All rows eliminate their neighbours at distance 1, then 2, 4, ...
    (parallel cyclic reduction; Hockney and Jesshope, Parallel Computers 2, 5.4.2). Differentiable.
    """

    def at(values: Tensor, step: int, filled: float) -> Tensor:
        """Values shifted by `step` frames; `filled` beyond the ends."""
        step = max(-frames, min(frames, step))
        kept = values[..., step:] if step > 0 else values[..., : frames + step]
        ends = (0, step) if step > 0 else (-step, 0)
        return torch.nn.functional.pad(kept, ends, value=filled)

    frames, step = diagonal.shape[-1], 1
    middle, sides = diagonal, right.movedim(-1, 0)
    before = torch.nn.functional.pad(beside, (1, 0))
    after = torch.nn.functional.pad(beside, (0, 1))
    while step < frames:
        back = -before / at(middle, -step, 1.0)
        on = -after / at(middle, step, 1.0)
        sides = sides + back * at(sides, -step, 0.0) + on * at(sides, step, 0.0)
        middle = middle + back * at(after, -step, 0.0) + on * at(before, step, 0.0)
        before, after = back * at(before, -step, 0.0), on * at(after, step, 0.0)
        step *= 2
    return (sides / middle).movedim(0, -1)
