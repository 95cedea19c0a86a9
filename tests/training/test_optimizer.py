from dataclasses import replace

import pytest
import torch
from draws import seeded
from torch import nn

from geneoh.nn.blocks import FrameTransformer
from geneoh.training.optimizer import Optimizer
from geneoh.training.stages import build_model


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
