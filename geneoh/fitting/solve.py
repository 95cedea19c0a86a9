"""The linear algebra of the fit: symmetric block tridiagonal systems with diagonal coupling."""

import torch
from jaxtyping import Float
from torch import Tensor


def solve_coupled_frames(
    matrix: Float[Tensor, "S T U U"],
    right: Float[Tensor, "S T U"],
    coupling: Float[Tensor, " U"],
) -> Float[Tensor, "S T U"]:
    """Solve M x = right, where frames are coupled by -diag(coupling) between neighbours.

    Exact block elimination by a Cholesky factor per frame. `matrix` holds the diagonal blocks; the
    coupling (>= 0) is added to them once per neighbour, so that M is positive definite.
    """
    frames = matrix.shape[1]
    neighbours = torch.full((frames,), 2.0).to(matrix)
    neighbours[0] -= 1
    neighbours[-1] -= 1
    diagonal = matrix + torch.diag_embed(neighbours[:, None] * coupling)
    inverse, carried = [], []
    for t in range(frames):
        block, side = diagonal[:, t], right[:, t]
        if t:
            block = block - coupling[:, None] * inverse[-1] * coupling
            side = side + coupling * (inverse[-1] @ carried[-1][..., None])[..., 0]
        inverse.append(torch.cholesky_inverse(torch.linalg.cholesky(block)))
        carried.append(side)
    solution = [(inverse[-1] @ carried[-1][..., None])[..., 0]]
    for t in range(frames - 2, -1, -1):
        side = carried[t] + coupling * solution[-1]
        solution.append((inverse[t] @ side[..., None])[..., 0])
    return torch.stack(solution[::-1], dim=1)
