"""What holds for every stage, with random networks: symmetries, seeds, and windows in pieces."""

import math
from dataclasses import replace

import networks
import pytest
import torch
from ball_scenes import LONG, PLAN, SHIFT, TURN, hands_at, moved, scene
from draws import seeded
from torch import Tensor, nn

from geneoh.denoisers.latent import LatentConfig, LatentDenoiser
from geneoh.denoisers.relations import RelationConfig, RelationDenoiser
from geneoh.denoisers.temporal import TemporalConfig, TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser
from geneoh.fitting.align import AlignConfig
from geneoh.pipeline.presets import StagePlan
from geneoh.pipeline.stages.context import StageContext
from geneoh.pipeline.stages.denoising import denoise_temporal
from geneoh.pipeline.stages.paper import denoise_latent, denoise_relations, denoise_trajectory

STAGES = ("trajectory", "relations", "temporal", "latent")


def random_networks() -> dict[str, nn.Module]:
    small = {"width": 16, "depth": 1, "heads": 2}
    return {
        "trajectory": networks.awake(TrajectoryDenoiser(TrajectoryConfig(**small))),
        "relations": networks.awake(RelationDenoiser(RelationConfig(**small, point_width=8))),
        "temporal": networks.awake(TemporalDenoiser(TemporalConfig(**small))),
        "latent": networks.awake(LatentDenoiser(LatentConfig(**small, latent=6, point_width=8))),
    }


def run_stage(stage: str, joints: Tensor, context: StageContext, seed: int = 0) -> Tensor:
    model, generator = random_networks()[stage], seeded(seed)
    if stage == "trajectory":
        return denoise_trajectory(model, joints, context, PLAN, generator=generator)
    if stage == "temporal":
        # an input that shook: every other frame has the hand, the ones between have another
        same = torch.arange(context.frames)[:, None, None] % 2 == 0
        observed = torch.where(same, joints[:1], joints[:1].roll(1, dims=2))
        return denoise_temporal(model, observed, joints, context)
    if stage == "latent":
        align = AlignConfig(steps=20)
        return denoise_latent(model, joints, context, PLAN, align=align, generator=generator)
    return denoise_relations(model, joints, context, PLAN, generator=generator)


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_moves_with_a_rigid_motion_of_the_whole_scene(stage):
    context = scene()
    joints = hands_at(context, 2)
    here = run_stage(stage, joints, context)
    there = run_stage(stage, joints @ TURN.T + SHIFT, moved(context))
    assert float((here - joints).norm(dim=-1).mean()) > 1e-4
    torch.testing.assert_close(there, here @ TURN.T + SHIFT, atol=2e-5, rtol=0)


@pytest.mark.parametrize("stage", STAGES)
def test_a_seed_fixes_the_answer_of_a_stage(stage):
    context = scene()
    joints = hands_at(context, 2)
    first, again, other = (run_stage(stage, joints, context, seed) for seed in (0, 0, 1))
    assert torch.equal(first, again)
    assert torch.equal(first, other) == (stage == "temporal")  # which draws nothing
    assert math.isfinite(float(first.sum()))


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_answers_window_by_window_as_on_all_at_once(stage, monkeypatch):
    context = scene(LONG + 40)
    joints = hands_at(context, 2)
    model = random_networks()[stage]
    plan = StagePlan(100, 2)  # its noise is drawn before, or there is none to draw

    def answer() -> Tensor:
        if stage in ("temporal", "latent"):
            return run_stage(stage, joints, context)
        # each chain starts at the input itself, which has the same noise in any order
        direct = replace(plan, sampler="direct")
        if stage == "relations":
            return denoise_relations(model, joints, context, direct, generator=seeded())
        return denoise_trajectory(model, joints, context, direct, generator=seeded())

    whole = answer()
    monkeypatch.setattr("geneoh.pipeline.stages.context.WINDOWS_AT_ONCE", 2)
    assert len(context.pieces(2)) > 2
    torch.testing.assert_close(answer(), whole, atol=1e-6, rtol=0)
