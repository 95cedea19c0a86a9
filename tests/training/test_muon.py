import pytest
import torch
from draws import normal
from torch import nn

from geneoh.training.muon import MOMENTUM, UPDATE_RMS, Muon, orthogonal


@pytest.mark.parametrize("shape", [(16, 16), (16, 48), (48, 16), (1, 8)])
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_singular_values_come_near_one_and_directions_stay(shape, scale):
    matrix = normal(*shape)
    u, _, v = torch.linalg.svd(matrix, full_matrices=False)
    inside = u.mT @ orthogonal(scale * matrix) @ v.mT
    values = inside.diagonal()
    assert float(values.min()) > 0.4
    assert float(values.max()) < 1.3
    torch.testing.assert_close(inside, torch.diag(values), atol=2e-3, rtol=0)


def test_nothing_comes_of_a_gradient_of_zero():
    assert not bool(orthogonal(torch.zeros(4, 6)).any())


def test_a_step_is_of_the_stated_size_and_shrinks_the_weights():
    weight = nn.Parameter(torch.ones(12, 30))
    weight.grad = normal(12, 30)
    Muon([weight], lr=0.1, weight_decay=0.5, precision=torch.float32).step()
    moved = weight.detach() - 0.95
    assert float(moved.square().mean().sqrt()) == pytest.approx(0.1 * UPDATE_RMS, rel=0.3)
    assert float((moved * weight.grad).sum()) < 0


def test_steps_remember_the_gradients_before():
    weight = nn.Parameter(torch.zeros(4, 4))
    optimizer = Muon([weight], lr=1.0, weight_decay=0.0, precision=torch.float32)
    first, second = normal(4, 4, seed=1), normal(4, 4, seed=2)
    for gradient in (first, second):
        weight.grad = gradient
        before = weight.detach().clone()
        optimizer.step()
    share = 1 - MOMENTUM
    momentum = MOMENTUM * share * first + share * second
    want = -UPDATE_RMS * 2 * orthogonal(second.lerp(momentum, MOMENTUM))
    torch.testing.assert_close(weight.detach() - before, want, atol=1e-5, rtol=0)


def test_a_matrix_without_a_gradient_stays():
    weight = nn.Parameter(torch.ones(3, 3))
    Muon([weight], lr=1.0, weight_decay=0.5, precision=torch.float32).step()
    assert torch.equal(weight.detach(), torch.ones(3, 3))


@pytest.mark.skipif(not hasattr(torch.optim, "Muon"), reason="this torch has no Muon of its own")
def test_it_moves_weights_as_torch_does():
    ours, theirs = (nn.Parameter(normal(8, 24)) for _ in range(2))
    mine = Muon([ours], lr=0.02, weight_decay=0.1, precision=torch.bfloat16)
    other = torch.optim.Muon([theirs], lr=0.02, weight_decay=0.1, adjust_lr_fn="match_rms_adamw")
    for seed in range(3):
        ours.grad = theirs.grad = normal(8, 24, seed=10 + seed)
        mine.step()
        other.step()
    torch.testing.assert_close(ours, theirs, atol=2e-3, rtol=0)  # bfloat16 has three digits
    assert float((ours.detach() - normal(8, 24)).abs().max()) > 0.02
