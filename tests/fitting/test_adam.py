from dataclasses import replace

import pytest
import torch
from torch import Tensor

from geneoh.fitting.adam import AdamFitConfig, adam, fit_with_adam


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


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
        (found,) = adam(lambda p: -slope * p[0].sum(), start, steps=4, rate=0.1, **options)
        return float(found)

    assert way(3.0) == pytest.approx(0.4)
    assert way(1e-4) == pytest.approx(0.4, rel=1e-3)
    assert way(3.0, settle=True) == pytest.approx(0.1 * (1 + 0.75 + 0.5 + 0.25))
    assert way(1e-4, epsilon=1.0) == pytest.approx(0.4e-4, rel=1e-3)


QUICK = AdamFitConfig(rigid_steps=30, steps=50, rate=0.04)


@pytest.fixture(scope="module")
def case(hand, make_state):
    betas = 0.7 * normal(10, seed=3)
    state = make_state(samples=2, frames=2)
    return hand.shaped(betas).joints_from_rotations(state.rotations, state.wrist)


def test_the_papers_fit_comes_near_its_keypoints(hand, case):
    heard: list[tuple[int, int]] = []
    trust = torch.ones_like(case[..., 0])
    state, betas = fit_with_adam(
        case, trust, hand, config=QUICK, on_step=lambda *at: heard.append(at)
    )
    fitted = hand.shaped(betas[:, None]).joints_from_rotations(state.rotations, state.wrist)
    flat = hand.shaped(torch.zeros(10)).joints_from_rotations(
        torch.eye(3).expand(2, 2, 16, 3, 3), case[..., 0, :]
    )
    before, after = ((x - case).norm(dim=-1).mean() for x in (flat, fitted))
    assert float(after) < 0.2 * float(before)
    assert heard == [(i, 80) for i in range(1, 81)]
    assert betas.shape == (2, 10)


def test_the_papers_fit_goes_on_where_a_keypoint_is_not_trusted(hand, case):
    short = replace(QUICK, rigid_steps=3, steps=3)
    wild, trust = case[:1].clone(), torch.ones(1, 2, 21)
    wild[..., 8, :], trust[..., 8] = 5.0, 0.0
    answers = [
        fit_with_adam(target, trust, hand, config=short)[0].wrist for target in (wild, case[:1])
    ]
    torch.testing.assert_close(*answers)


def test_the_papers_fit_takes_a_single_frame(hand, case):
    short = replace(QUICK, rigid_steps=2, steps=2)
    state, _ = fit_with_adam(case[:, :1], torch.ones(2, 1, 21), hand, config=short)
    assert state.rotations.shape == (2, 1, 16, 3, 3)
    assert bool(state.rotations.isfinite().all())
