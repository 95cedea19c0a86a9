from dataclasses import replace

import pytest
import torch
from draws import normal, seeded
from torch import nn

from geneoh.nn.blocks import FrameTransformer
from geneoh.training.optimizer import MOMENTUM, UPDATE_RMS, Muon, Optimizer, orthogonal
from geneoh.training.stages import build_model


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


def transformer(seed: int = 0) -> FrameTransformer:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return FrameTransformer(16, 2, heads=2)


def test_every_parameter_is_moved_by_one_part_only(tiny):
    for stage in ("motion", "relations", "temporal", "latent", "toch"):
        model = build_model(stage, tiny)
        parts = Optimizer(model, tiny).parts.values()
        moved = [id(p) for part in parts for group in part.param_groups for p in group["params"]]
        assert sorted(moved) == sorted(id(p) for p in model.parameters())


def test_muon_moves_the_matrices_of_blocks_alone(tiny):
    model = build_model("motion", tiny)
    (group,) = Optimizer(model, tiny).parts["muon"].param_groups
    assert all(p.ndim == 2 for p in group["params"])
    assert len(group["params"]) == 4 * len(model.trunk.blocks)
    moved = {id(p) for p in group["params"]}
    named = {name for name, p in model.named_parameters() if id(p) in moved}
    assert all(name.startswith("trunk.blocks.") for name in named)
    assert not any("gain" in name for name in named)


def test_a_model_without_blocks_has_adamw_alone(tiny):
    assert list(Optimizer(nn.Linear(3, 2), tiny).parts) == ["adamw"]


@pytest.mark.parametrize("rate", [1e-3, 1e-2])
def test_each_step_goes_as_far_as_its_rate(tiny, rate):
    """Both parts make updates whose root mean square is a share of the rate."""
    model = build_model("motion", replace(tiny, weight_decay=0.0))
    optimizer = Optimizer(model, replace(tiny, weight_decay=0.0))
    before = {name: p.detach().clone() for name, p in model.named_parameters()}
    generator = seeded()
    for p in model.parameters():
        p.grad = torch.randn(p.shape, generator=generator)
    optimizer.step(rate)
    for name, p in model.named_parameters():
        size = float((p.detach() - before[name]).square().mean().sqrt())
        assert 0.1 * rate < size < 1.1 * rate, name


def test_what_is_remembered_can_be_given_to_another(tiny):
    def made() -> tuple[nn.Module, Optimizer]:
        model = build_model("motion", tiny)
        return model, Optimizer(model, tiny)

    def move(model: nn.Module, optimizer: Optimizer, seed: int) -> None:
        generator = seeded(seed)
        for p in model.parameters():
            p.grad = torch.randn(p.shape, generator=generator)
        optimizer.step(1e-2)

    (first, one), (second, two) = made(), made()
    move(first, one, 1)
    second.load_state_dict(first.state_dict())
    two.restore({name: tensor.clone() for name, tensor in one.tensors().items()})
    for model, optimizer in ((first, one), (second, two)):
        move(model, optimizer, 2)
    for p, q in zip(first.parameters(), second.parameters(), strict=True):
        torch.testing.assert_close(p, q)


def test_what_is_remembered_is_copied_so_that_its_file_can_be_replaced(tiny):
    model = build_model("motion", tiny)
    optimizer = Optimizer(model, tiny)
    for p in model.parameters():
        p.grad = torch.ones_like(p)
    optimizer.step(1e-2)
    loaded = {name: tensor.clone() for name, tensor in optimizer.tensors().items()}
    optimizer.restore(loaded)
    kept = {tensor.data_ptr() for tensor in optimizer.tensors().values()}
    assert not kept & {tensor.data_ptr() for tensor in loaded.values()}
