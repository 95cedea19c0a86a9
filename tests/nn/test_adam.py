import pytest
import torch
from draws import normal
from torch import Tensor

from geneoh.nn.adam import adam


def bumpy(parameters: list[Tensor]) -> Tensor:
    first, second = parameters
    return (
        (first.square() * torch.tensor([1.0, 30.0, 0.01])).sum()
        + second.cos().sum()
        + (first[0] * second[1])
    )


def test_each_step_is_that_of_torchs_adam():
    start = [normal(3), normal(2, seed=1)]
    leaves = [p.clone().requires_grad_(True) for p in start]
    optimizer, rate = torch.optim.Adam(leaves, lr=0.05), 0.05
    for steps in range(1, 12):
        optimizer.zero_grad()
        bumpy(leaves).backward()
        optimizer.step()
        got = adam(bumpy, start, steps=steps, rate=rate)
        for mine, theirs in zip(got, leaves, strict=True):
            torch.testing.assert_close(mine, theirs.detach(), rtol=1e-5, atol=1e-6)


def test_a_quadratic_is_minimised():
    goal = normal(4)
    scale = torch.tensor([1.0, 10.0, 0.1, 3.0])
    (found,) = adam(
        lambda p: (scale * (p[0] - goal).square()).sum(), [torch.zeros(4)], steps=400, rate=0.03
    )
    torch.testing.assert_close(found, goal, atol=1e-3, rtol=0)


def test_what_is_given_is_left_alone_and_the_answer_carries_no_gradient():
    start, heard = [normal(3)], []
    before = start[0].clone()
    with torch.no_grad():  # as the pipeline runs it
        (found,) = adam(
            lambda p: p[0].square().sum(),
            start,
            steps=3,
            rate=0.1,
            on_step=lambda *at: heard.append(at),
        )
    assert torch.equal(start[0], before)
    assert not start[0].requires_grad
    assert not found.requires_grad
    assert heard == [(1, 3), (2, 3), (3, 3)]
    assert torch.equal(adam(lambda p: p[0].sum(), start, steps=0, rate=0.1)[0], before)


def test_steps_settle_and_shrink_with_a_small_gradient():
    """Of a constant gradient each of Adam's steps is one rate long, however small it is."""
    start = [torch.zeros(1)]

    def way(slope: float, **options) -> float:
        options = {"rate": 0.1} | options
        (found,) = adam(lambda p: -slope * p[0].sum(), start, steps=4, **options)
        return float(found)

    assert way(3.0) == pytest.approx(0.4)
    assert way(1e-4) == pytest.approx(0.4, rel=1e-3)
    falling = way(3.0, rate=lambda done: [0.1 * (1 - done / 4)])
    assert falling == pytest.approx(0.1 * (1 + 0.75 + 0.5 + 0.25))
    assert way(1e-4, epsilon=1.0) == pytest.approx(0.4e-4, rel=1e-3)


def test_each_parameter_has_its_rate_and_stays_within_its_limits():
    start = [torch.zeros(1), torch.zeros(1)]
    found = adam(
        lambda p: -p[0].sum() - p[1].sum(),
        start,
        steps=4,
        rate=lambda done: (0.1, 0.3),
        bounded=lambda p: [p[0], p[1].clamp(max=0.5)],
    )
    assert [float(value) for value in found] == pytest.approx([0.4, 0.5], rel=1e-4)
