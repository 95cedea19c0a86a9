import torch

from geneoh.metrics.accuracy import mpjpe, mpvpe, within_spread
from geneoh.metrics.smoothness import mean_over_frames, valid_differences


def test_a_shift_is_its_own_error():
    truth = torch.randn(4, 21, 3, generator=torch.Generator().manual_seed(0))
    shift = torch.tensor([0.003, 0.0, 0.004])
    torch.testing.assert_close(mpjpe(truth + shift, truth), torch.full((4,), 0.005))
    samples = torch.stack([truth, truth + 2 * shift])
    expected = torch.tensor([0.0, 0.01])[:, None].expand(2, 4)
    torch.testing.assert_close(mpjpe(samples, truth), expected, atol=1e-6, rtol=1e-5)


def test_one_wrong_vertex_of_ten_counts_a_tenth():
    truth = torch.zeros(2, 10, 3)
    moved = truth.clone()
    moved[1, 3, 0] = 0.02
    torch.testing.assert_close(mpvpe(moved, truth), torch.tensor([0.0, 0.002]))


def test_frames_that_were_not_observed_are_left_out():
    values = torch.tensor([1.0, torch.nan, 3.0, 100.0])
    valid = torch.tensor([True, True, True, False])
    assert float(mean_over_frames(values, valid)) == 2.0
    assert bool(mean_over_frames(values[1:2]).isnan())
    assert bool(mean_over_frames(values[:0]).isnan())


def test_a_difference_needs_all_its_frames():
    valid = torch.tensor([True, True, True, False, True, True])
    assert valid_differences(valid, 1).tolist() == [True, True, False, False, True]
    assert valid_differences(valid, 2).tolist() == [True, False, False, False]
    assert valid_differences(valid[:2], 2).tolist() == []


def test_nine_in_ten_lie_in_the_radius_where_the_spread_is_right():
    draws = torch.randn(400, 21, 3, generator=torch.Generator().manual_seed(0))
    spread = torch.full((400, 21), 0.01)
    truth = draws.flip(0)
    error = draws * 0.01 / 3**0.5
    assert abs(float(within_spread(truth + error, truth, spread).mean()) - 0.9) < 0.01
    assert float(within_spread(truth + 3 * error, truth, spread).mean()) < 0.4
    assert float(within_spread(truth, truth, 0 * spread).mean()) == 1
