"""MotionDiff and its form of the paper with stand-in networks, whose right answers are known."""

from dataclasses import replace

import networks
import pytest
import torch
from ball_scenes import LONG, PLAN, canonical, hands_at, parameters_at, scene
from draws import seeded
from torch import Tensor

from geneoh.denoisers.motion import MotionConfig, MotionDenoiser
from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser
from geneoh.pipeline.presets import StagePlan
from geneoh.pipeline.stages.denoising import denoise_motion
from geneoh.pipeline.stages.paper import denoise_trajectory
from geneoh.representation.parameters import HandParameters
from geneoh.representation.window_scale import WindowScale


class KnownChange(MotionDenoiser):
    """Answers with the change that leads from the observed windows to those of `goal`."""

    def __init__(self, goal: HandParameters) -> None:
        super().__init__(MotionConfig(width=16, depth=1, heads=2))
        self.goal = goal

    def forward(self, x, sigma, observed):
        return observed.hand.change_to(self.goal).repeat(len(x) // len(observed.trust), 1, 1)


class KnownWindows(TrajectoryDenoiser):
    """Answers with the windows of hands, in units of those of the input, whatever it is asked."""

    def __init__(self, context, joints: Tensor, goal: Tensor) -> None:
        super().__init__(TrajectoryConfig(width=16, depth=1, heads=2))
        scale = WindowScale.of(canonical(context, joints, joints))
        self.windows = torch.cat([scale.normalised(one) for one in goal.split(len(scale.mean))])

    def forward(self, x, sigma, deviation):
        return self.windows


def test_motion_gives_the_hand_that_the_network_answers():
    context = scene(LONG)
    hand, goal = parameters_at(context), parameters_at(context, seed=20)
    region = context.region(hand.joints)
    windows = HandParameters(
        *(context.windows(getattr(goal, name)) for name in ("wrist", "turn", "fingers")),
        goal.offsets.expand(len(region.center), 20, 3),
    )
    model = KnownChange(windows.to_canon(region))
    got = denoise_motion(model, hand, context, PLAN, samples=3, generator=seeded())
    assert got.wrist.shape == (3, LONG, 3)
    torch.testing.assert_close(got.wrist, goal.wrist.expand(3, -1, -1), atol=1e-5, rtol=0)
    torch.testing.assert_close(got.joints, goal.joints.expand(3, -1, -1, -1), atol=1e-4, rtol=0)


def test_motion_without_a_change_leaves_the_hand():
    context = scene(LONG)
    hand = parameters_at(context)
    model = MotionDenoiser(MotionConfig(width=16, depth=1, heads=2))
    model.forward = lambda x, sigma, observed: torch.zeros_like(x)
    got = denoise_motion(model, hand, context, PLAN, samples=1, generator=seeded())
    torch.testing.assert_close(got.joints, hand.joints, atol=1e-6, rtol=0)


def test_motion_answers_window_by_window_as_on_all_at_once(monkeypatch):
    context, heard = scene(LONG + 40), []
    model = networks.awake(MotionDenoiser(MotionConfig(width=16, depth=1, heads=2)))
    given = (model, parameters_at(context), context, PLAN)
    whole = denoise_motion(*given, samples=2, generator=seeded())
    monkeypatch.setattr("geneoh.pipeline.stages.context.WINDOWS_AT_ONCE", 2)
    parts = denoise_motion(
        *given, samples=2, generator=seeded(), on_step=lambda *at: heard.append(at)
    )
    torch.testing.assert_close(parts.joints, whole.joints, atol=1e-5, rtol=0)
    total = PLAN.steps * len(context.starts)
    assert heard == [(done, total) for done in range(1, total + 1)]


def test_trajectory_gives_the_hand_that_the_network_answers():
    context = scene(LONG)
    joints, goal = hands_at(context), hands_at(context, seed=20)
    model = KnownWindows(context, joints, canonical(context, joints, goal))
    got = denoise_trajectory(model, joints, context, PLAN, generator=seeded())
    torch.testing.assert_close(got, goal, atol=1e-6, rtol=0)


@pytest.mark.parametrize("sampler", ["ddim", "ancestral", "direct"])
def test_a_network_that_answers_the_input_changes_nothing(sampler):
    context = scene(LONG)
    joints = hands_at(context)
    model = KnownWindows(context, joints, canonical(context, joints, joints))
    plan = StagePlan(400, 3, sampler)
    got = denoise_trajectory(model, joints, context, plan, generator=seeded())
    torch.testing.assert_close(got, joints, atol=1e-6, rtol=0)


def test_windows_that_disagree_are_blended_where_they_overlap():
    context = scene(LONG)
    joints, aside = hands_at(context), torch.tensor([0.01, 0.0, 0.0])
    region = context.region(joints)
    other = context.windows(joints).clone()
    other[1] += aside
    model = KnownWindows(context, joints, region.to_canon(other))
    got = denoise_trajectory(model, joints, context, PLAN, generator=seeded())
    step = (got - joints)[0, :, 0, 0] / aside[0]
    torch.testing.assert_close(step[:30], torch.zeros(30), atol=1e-4, rtol=0)
    torch.testing.assert_close(step[60:], torch.ones(30), atol=1e-4, rtol=0)
    assert bool((step[29:61].diff() > -1e-4).all())
    assert 0.4 < float(step[44:46].mean()) < 0.6


@pytest.mark.parametrize(("samples", "means"), [(1, [1.5]), (2, [0.5, 2.5])])
def test_the_mean_of_the_chains_of_each_window_is_kept(samples, means):
    context = scene(LONG)
    joints = hands_at(context)
    region, windows = context.region(joints), context.windows(joints)
    moved = [windows + 0.01 * away * torch.eye(3)[0] for away in range(4)]
    model = KnownWindows(context, joints, torch.cat([region.to_canon(one) for one in moved]))
    plan = replace(PLAN, chains=4, kept="mean")
    got = denoise_trajectory(
        model, joints.expand(samples, -1, -1, -1), context, plan, generator=seeded()
    )
    apart = (got - joints)[..., 0].mean(-1)
    wanted = 0.01 * torch.tensor(means)[:, None].expand(-1, LONG)
    torch.testing.assert_close(apart, wanted, atol=1e-5, rtol=0)


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_of_the_chains_of_each_window_those_closest_to_the_input_are_kept(samples):
    context = scene(LONG)
    joints = hands_at(context)
    region, windows = context.region(joints), context.windows(joints)
    away = torch.tensor([[3.0, 1.0], [1.0, 2.0], [2.0, 3.0]])  # cm, of two windows in three chains
    moved = [windows + 0.01 * one[:, None, None, None] * torch.eye(3)[0] for one in away]
    model = KnownWindows(context, joints, torch.cat([region.to_canon(one) for one in moved]))
    plan = replace(PLAN, chains=3)
    got = denoise_trajectory(
        model, joints.expand(samples, -1, -1, -1), context, plan, generator=seeded()
    )
    apart = (got - joints)[..., 0].mean(-1)
    wanted = 0.01 * torch.arange(1.0, 1 + samples)[:, None].expand(-1, LONG)
    torch.testing.assert_close(apart, wanted, atol=1e-5, rtol=0)
