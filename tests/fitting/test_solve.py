import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from pretended_device import PretendedDevice

from geneoh.fitting import solve
from geneoh.fitting.solve import solve_by_halves, solve_chains, solve_coupled_frames


def system(samples: int, frames: int, size: int, seed: int):
    generator = torch.Generator().manual_seed(seed)
    root = torch.randn(samples, frames, size, size, generator=generator, dtype=torch.float64)
    matrix = root @ root.mT + 0.1 * torch.eye(size, dtype=torch.float64)
    right = torch.randn(samples, frames, size, generator=generator, dtype=torch.float64)
    coupling = 5 * torch.rand(size, generator=generator, dtype=torch.float64)
    return matrix, right, coupling


def solve_densely(matrix, right, coupling):
    """One matrix over all frames: blocks on the diagonal, and springs between neighbours."""
    samples, frames, size = right.shape
    whole = torch.zeros(samples, frames, size, frames, size, dtype=right.dtype)
    spring = torch.diag(coupling)
    for t in range(frames):
        whole[:, t, :, t] += matrix[:, t]
    for t in range(frames - 1):
        for a, b, sign in ((t, t, 1), (t + 1, t + 1, 1), (t, t + 1, -1), (t + 1, t, -1)):
            whole[:, a, :, b] += sign * spring
    whole = whole.reshape(samples, frames * size, frames * size)
    return torch.linalg.solve(whole, right.flatten(1)).unflatten(1, (frames, size))


@settings(max_examples=12)
@given(st.integers(1, 3), st.integers(1, 6), st.integers(2, 4), st.integers(0, 99))
def test_the_solution_is_that_of_the_whole_matrix(samples, frames, size, seed):
    matrix, right, coupling = system(samples, frames, size, seed)
    got = solve_coupled_frames(matrix, right, coupling)
    want = solve_densely(matrix, right, coupling)
    torch.testing.assert_close(got, want, rtol=1e-8, atol=1e-8)


def with_blocks_beside(matrix, coupling):
    """The blocks on the diagonal, and those beside it."""
    kept = {}

    def noted(diagonal, coupling, right):
        kept["diagonal"] = diagonal
        return right

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solve, "solve_as_band", noted)
        solve_coupled_frames(matrix, matrix[..., 0], coupling)
    samples, frames, size = matrix.shape[:3]
    return kept["diagonal"], -torch.diag(coupling).expand(samples, frames - 1, size, size)


@pytest.mark.parametrize("frames", [*range(1, 10), 60])
def test_halves_give_the_solution_of_the_band(frames):
    matrix, right, coupling = system(2, frames, 7, frames)
    want = solve_coupled_frames(matrix, right, coupling)
    with PretendedDevice() as device:  # nothing of it is on the CPU
        given = [x.to(device) for x in (*with_blocks_beside(matrix, coupling), right)]
        got = solve_by_halves(*given)
        assert got.device == device
        got = got.to("cpu")
    assert float((got - want).abs().max() / want.abs().max()) < 1e-9


@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_halves_are_as_exact_in_float32_as_the_band(scale):
    matrix, right, coupling = system(4, 60, 51, 3)
    matrix = matrix + torch.eye(51, dtype=torch.float64)
    matrix, coupling = scale * matrix, scale * coupling
    want = solve_coupled_frames(matrix, right, coupling)
    got = solve_by_halves(*with_blocks_beside(matrix.float(), coupling.float()), right.float())
    assert float((got - want).norm() / want.norm()) < 1e-5


@pytest.mark.gpu
def test_frames_on_a_gpu_are_solved_there():
    if not torch.cuda.is_available():
        pytest.skip("needs a CUDA device")
    matrix, right, coupling = system(3, 61, 51, 5)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solve, "solve_as_band", None)
        got = solve_coupled_frames(matrix.cuda(), right.cuda(), coupling.cuda())
    torch.testing.assert_close(got.cpu(), solve_coupled_frames(matrix, right, coupling))


def test_without_coupling_frames_are_solved_one_by_one():
    matrix, right, coupling = system(2, 4, 3, 0)
    got = solve_coupled_frames(matrix, right, 0 * coupling)
    torch.testing.assert_close(got, torch.linalg.solve(matrix, right))


def test_a_frame_without_evidence_follows_its_neighbours():
    matrix = torch.eye(2).repeat(1, 3, 1, 1)
    matrix[:, 1] = 0
    right = torch.tensor([[[1.0, 2], [0, 0], [3, 4]]])
    got = solve_coupled_frames(matrix, right, torch.tensor([1e-3, 1e-3]))
    torch.testing.assert_close(got[:, 1], (got[:, 0] + got[:, 2]) / 2)
    torch.testing.assert_close(got[:, 0], right[:, 0], atol=0.01, rtol=0)


def test_stiff_coupling_makes_all_frames_the_same():
    matrix, right, _ = system(1, 5, 3, 1)
    got = solve_coupled_frames(matrix, right, torch.full((3,), 1e4, dtype=torch.float64))
    rigid = torch.linalg.solve(matrix.sum(1), right.sum(1))
    torch.testing.assert_close(got, rigid[:, None].expand_as(got), rtol=0, atol=0.02)


@pytest.mark.parametrize("frames", [1, 2, 3, 8, 61])
def test_chains_are_solved_as_whole_matrices(frames):
    generator = torch.Generator().manual_seed(frames)
    beside = -torch.rand(5, frames - 1, generator=generator, dtype=torch.float64)
    diagonal = 2.2 + torch.rand(5, frames, generator=generator, dtype=torch.float64)
    right = torch.randn(5, frames, 3, generator=generator, dtype=torch.float64)
    whole = torch.diag_embed(diagonal)
    if frames > 1:
        whole = whole + torch.diag_embed(beside, 1) + torch.diag_embed(beside, -1)
    torch.testing.assert_close(
        solve_chains(diagonal, beside, right), torch.linalg.solve(whole, right), atol=1e-12, rtol=0
    )
