from dataclasses import replace

import pytest
import torch
from draws import seeded

from geneoh.baselines.networks import RegressionDenoiser
from geneoh.synthesis.draws import Draws
from geneoh.training.batches import draw_batch
from geneoh.training.config import TrainConfig
from geneoh.training.losses import (
    draw_sigma,
    latent_loss,
    motion_loss,
    reconstruction_loss,
    recovered_fraction,
    relation_loss,
    spatial_loss,
    temporal_loss,
    trajectory_loss,
)
from geneoh.training.stages import build_model

LOSSES = [
    ("motion", motion_loss),
    ("spatial", spatial_loss),
    ("relations", relation_loss),
    ("latent", reconstruction_loss),
    ("latent", latent_loss),
    ("temporal", temporal_loss),
    ("trajectory", trajectory_loss),
]
STAGES = ("motion", "spatial", "temporal", "trajectory", "relations", "latent")


@pytest.fixture(scope="module")
def batch(clips, tiny):
    before = build_model("motion", tiny)
    return draw_batch(clips, 2, TrainConfig(), generator=seeded(1), motion_denoiser=before)


@pytest.mark.parametrize(("stage", "loss"), LOSSES)
def test_a_loss_is_one_number_that_the_generator_fixes(batch, tiny, stage, loss):
    model = build_model(stage, tiny)
    with torch.no_grad():
        first, second = (loss(model, batch, Draws(2, seeded(3))) for _ in range(2))
    assert first.shape == ()
    assert torch.equal(first, second)
    assert 0.01 < float(first) < 100


@pytest.mark.parametrize(("stage", "loss"), LOSSES)
def test_a_loss_teaches_the_network(batch, tiny, stage, loss):
    model = build_model(stage, tiny)
    loss(model, batch, Draws(2, seeded())).backward()
    gradients = [p.grad for p in model.parameters() if p.grad is not None]
    assert any(bool(g.any()) for g in gradients)
    assert all(bool(g.isfinite().all()) for g in gradients)


def test_the_autoencoder_is_frozen_while_its_latent_is_learned(batch, tiny):
    model = build_model("latent", tiny)
    latent_loss(model, batch, Draws(2, seeded())).backward()
    assert all(p.grad is None for p in model.autoencoder.parameters())
    assert model.head.weight.grad is not None


def test_the_loss_of_steps_does_not_count_a_shift_of_the_window(batch, tiny):
    model = build_model("temporal", tiny)  # answers that every step is right

    def loss_of(hand: torch.Tensor) -> float:
        with torch.no_grad():
            return float(temporal_loss(model, replace(batch, noisy=hand), Draws(2, seeded())))

    still = batch.evidence.rotation[:, :1].expand_as(batch.evidence.rotation)
    batch = replace(batch, evidence=replace(batch.evidence, rotation=still))
    shifted = batch.clean + torch.tensor([0.02, -0.01, 0.03])
    jitter = 0.003 * torch.randn(batch.clean.shape, generator=seeded(5))
    assert loss_of(shifted) < 1e-3 < 0.5 < loss_of(shifted + jitter)


# what SpatialDiff and TemporalDiff look at depends on numbers, which the meta device has not: see
# test_device.py
@pytest.mark.parametrize(
    ("stage", "loss"), [pair for pair in LOSSES if pair[0] not in ("spatial", "temporal")]
)
def test_losses_follow_the_device_of_the_batch(batch, tiny, stage, loss):
    """The meta device computes nothing and refuses to mix, as a GPU would."""
    device = torch.device("meta")
    model = build_model(stage, tiny).to(device)
    got = loss(model, batch.to(device), Draws(2, seeded()))
    assert got.device.type == "meta"


@pytest.mark.parametrize(
    "stage", [stage for stage in STAGES if stage not in ("spatial", "temporal")]
)
def test_validation_follows_the_device_of_the_batch(batch, tiny, stage):
    device = torch.device("meta")
    model = build_model(stage, tiny).to(device)
    got = recovered_fraction(model, batch.to(device), generator=seeded())
    assert got.device.type == "meta"


def test_noise_levels_are_log_uniform_over_their_range():
    low, high = 0.05, 2.5
    sigma = draw_sigma(Draws(4000, seeded()), (low, high))
    assert low <= float(sigma.min()) < 1.1 * low
    assert 0.9 * high < float(sigma.max()) <= high
    middle = (low * high) ** 0.5
    assert float((sigma < middle).float().mean()) == pytest.approx(0.5, abs=0.035)


def test_noise_levels_can_be_biased_towards_the_high_ones():
    limits = (0.1, 10.0)
    sigma = draw_sigma(Draws(4000, seeded()), limits, 3.0)
    assert limits[0] <= float(sigma.min())
    assert float(sigma.max()) <= limits[1]
    assert float((sigma < 1.0).float().mean()) == pytest.approx(0.5**3, abs=0.02)


class Knowing(RegressionDenoiser):
    """Answers with the keypoints it was built around, whatever it is asked."""

    def __init__(self, tiny, answer):
        super().__init__(tiny.regression)
        self.answer = answer

    def forward(self, observation, relations):
        return self.answer


def test_nothing_is_left_by_the_truth_and_all_by_the_input(batch, tiny):
    truth = Knowing(tiny, batch.clean_canon)
    assert float(recovered_fraction(truth, batch, generator=seeded())) == 0
    unchanged = Knowing(tiny, batch.observation.joints)
    assert float(recovered_fraction(unchanged, batch, generator=seeded())) == pytest.approx(1)


@pytest.mark.parametrize("stage", STAGES)
def test_an_untrained_network_does_not_help(batch, tiny, stage):
    left = recovered_fraction(build_model(stage, tiny), batch, generator=seeded())
    assert float(left) > 0.9
