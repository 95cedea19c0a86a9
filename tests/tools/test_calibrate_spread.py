import pytest
import torch

from geneoh.evaluation.protocols.synthetic import draw_clip
from tools.calibrate_spread import AIM, SpreadErrors, calibrated, lost_row, measured, while_lost


def errors_of(scale: float, seed: int) -> SpreadErrors:
    """Errors that are off by exactly so many deviations."""
    generator = torch.Generator().manual_seed(seed)
    sampled = 0.01 * torch.rand(20000, generator=generator)
    error = (torch.randn(20000, 3, generator=generator) / 3**0.5).norm(dim=-1) * scale * sampled
    return SpreadErrors(sampled, error)


def test_the_right_scale_holds_nine_in_ten():
    assert abs(errors_of(2.0, 0).inside(2.0) - AIM) < 0.01


def test_the_scale_that_made_the_errors_is_found():
    assert calibrated([errors_of(2.0, seed) for seed in range(3)]) == 2.0


def test_noises_that_differ_are_met_in_between():
    assert 1.5 <= calibrated([errors_of(1.0, 0), errors_of(3.0, 1)]) <= 3.0


@pytest.mark.slow
def test_every_keypoint_of_every_clip_is_measured():
    found = measured("gauss", clips=1, frames=8)
    assert found.error.shape == found.sampled.shape == (8 * 21,)
    assert 0.001 < float(found.error.mean()) < 0.05
    assert float(found.sampled.mean()) > 0.001


@pytest.mark.slow
def test_keypoints_are_measured_while_the_hand_is_lost():
    clip = draw_clip("mug", 0, 12)
    error, sampled, told = while_lost(clip, 4, 0)
    assert error.shape == (4 * 21,)
    assert 0.0005 < float(error.mean()) < 0.05
    assert bool((told > sampled).all())
    inside = [float(cell) for cell in lost_row([clip], 4).split(" | ")]
    assert inside[0] == pytest.approx(1000 * float(error.square().mean().sqrt()), abs=0.5)
    assert inside[2] >= inside[1] > 0
