"""The camera's direction on its way through the pipeline."""

import importlib
from dataclasses import replace

import pytest
import quick_presets
import torch

from geneoh.geometry.mirror import mirror_points
from geneoh.metrics.accuracy import mpjpe
from geneoh.pipeline.options import Options
from geneoh.pipeline.stages import run as stage_run
from geneoh.pipeline.stages.run import StageRun
from geneoh.seeds import seeded_generator
from geneoh.sequence.camera import seen_from
from geneoh.sequence.noise import corrupt_sequence

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


@pytest.mark.slow
def test_a_hand_above_an_object_at_rest_is_not_moved_onto_it_along_the_ray(clean):
    reach = slice(0, 18)  # the hand is 2 to 3 cm above the object, and touches it at the end
    seen = corrupt_sequence(clean[reach], "camera", generator=seeded_generator("reach"))

    def error(**settings) -> float:
        joints = pipeline.denoise(seen, FAST, **settings).sequence.hands[0].joints
        return float(mpjpe(joints, clean.hands[0].joints[reach]).mean())

    assert error() < 1.1 * error(without=("mesh",))


@pytest.mark.parametrize(
    ("frames", "known"), [(slice(0, 18), [True, False]), (slice(60, 78), [True])]
)
def test_contact_is_judged_without_the_ray_too_where_the_object_rests(
    monkeypatch, clean, frames, known
):
    quick_presets.use(monkeypatch)
    rays, spatial = [], stage_run.denoise_spatial

    def noted(*args, context, **settings):
        rays.append(context.ray is not None)
        return spatial(*args, context=context, **settings)

    monkeypatch.setattr(stage_run, "denoise_spatial", noted)
    part = seen_from(clean[frames], torch.tensor([[0.5, 0.4, 2.0]]), "here")
    pipeline.denoise(part, FAST)
    assert rays == known
    rays.clear()
    pipeline.denoise(part, FAST, trust_object=True)
    assert rays == [True]
