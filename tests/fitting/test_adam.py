from dataclasses import replace

import pytest
import torch
from draws import normal

from geneoh.fitting.adam import AdamFitConfig, fit_with_adam

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
