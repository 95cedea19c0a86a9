import pytest
import torch

from geneoh.evaluation.protocols.synthetic import draw_clip
from tools.calibrate_spread import (
    CHANGES,
    LEAST,
    SpreadErrors,
    calibrated,
    clips_to_calibrate,
    lost_row,
    measured,
    while_lost,
)


def errors_of(ratio: float, seed: int, sizes: tuple[float, ...] = ()) -> SpreadErrors:
    """Errors that are off by exactly so many deviations; the spread has the given sizes for the
    first of `CHANGES` and size 1 for the others."""
    generator = torch.Generator().manual_seed(seed)
    sampled = 0.01 * torch.rand(20000, generator=generator)
    error = (torch.randn(20000, 3, generator=generator) / 3**0.5).norm(dim=-1) * ratio * sampled
    of_changes = torch.tensor([*sizes, *[1.0] * (len(CHANGES) - len(sizes))])
    return SpreadErrors(of_changes[:, None] * sampled, error)


def test_the_right_ratio_holds_nine_in_ten():
    assert abs(errors_of(2.0, 0).inside(2.0, 0) - 0.9) < 0.01


def test_the_least_ratio_that_holds_enough_under_every_noise_is_found():
    errors = [errors_of(1.0, 0), errors_of(2.0, 1)]
    ratio, change = calibrated(errors)
    assert all(each.inside(ratio, change) >= LEAST for each in errors)
    assert errors[1].inside(ratio - 0.1, change) < LEAST


def test_a_change_that_tells_smaller_errors_where_they_are_small_is_found():
    errors = [errors_of(0.2, 0, (0.9, 0.8, 0.2)), errors_of(2.0, 1)]
    assert calibrated(errors) == (calibrated(errors[1:])[0], 2)


def test_clips_of_families_and_scans_are_calibrated_on():
    clips = clips_to_calibrate(count=2, frames=5)
    assert [clip.frames for clip in clips] == [5] * 4
    assert len({clip.object.meshes for clip in clips}) == 4


@pytest.mark.slow
def test_every_keypoint_of_every_clip_is_measured():
    found = measured("gauss", [draw_clip("mug", 0, 8)])
    assert found.error.shape == (8 * 21,)
    assert found.sampled.shape == (len(CHANGES), 8 * 21)
    assert 0.001 < float(found.error.mean()) < 0.05
    assert bool((found.sampled.diff(dim=0) <= 0).all())
    assert float(found.sampled[-1].mean()) > 0.001


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
