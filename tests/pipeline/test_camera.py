"""The camera's direction on its way through the pipeline."""

import importlib
from dataclasses import replace

import pytest
import quick_presets
import torch

from geneoh.geometry.mirror import mirror_points
from geneoh.pipeline.options import Options
from geneoh.pipeline.stages.run import StageRun
from geneoh.sequence.camera import seen_from

pipeline = importlib.import_module("geneoh.pipeline.denoise")
FAST = Options(preset="fast")


@pytest.fixture
def contexts(monkeypatch) -> list:
    """What the stages of each run knew."""
    quick_presets.use(monkeypatch)
    known, run = [], StageRun.samples

    def noted(stages, context, preset):
        known.append(context)
        return run(stages, context, preset)

    monkeypatch.setattr(StageRun, "samples", noted)
    return known


@pytest.fixture
def seen(noisy):
    """The left hand of the recording, seen from a place beside it."""
    return seen_from(noisy[20:41], torch.tensor([[0.5, 0.4, 2.0]]), "here")


def test_the_stages_know_the_mirrored_ray_at_their_own_rate(contexts, seen):
    pipeline.denoise(replace(seen, fps=60.0), FAST)
    ray = mirror_points(seen.hands[0].camera_ray)[::2]
    torch.testing.assert_close(contexts[0].ray, ray, atol=0.01, rtol=0)  # frames are means


def test_a_sequence_without_a_camera_has_no_ray(contexts, noisy):
    pipeline.denoise(noisy[20:30], FAST)
    assert contexts[0].ray is None


def test_the_ablation_withholds_the_ray_and_the_result_keeps_it(contexts, seen):
    result = pipeline.denoise(seen, replace(FAST, without=("camera",)))
    assert contexts[0].ray is None
    assert result.sequence.hands[0].camera_ray.equal(seen.hands[0].camera_ray)
