"""The Gaussian over the frames of generated clips."""

import torch

from geneoh.generators.sampling import smoothed_clips


def clip(*values):
    return torch.tensor(values)[None, :, None]


def test_a_spike_is_spread_and_a_line_stays():
    spike = smoothed_clips(clip(*[0.0] * 10, 1.0, *[0.0] * 10), 2.0)[0, :, 0]
    torch.testing.assert_close(spike.sum(), torch.tensor(1.0))
    assert spike.argmax() == 10
    torch.testing.assert_close(spike[8] / spike[10], torch.tensor(-0.5).exp())
    line = torch.arange(40.0)[None, :, None]
    torch.testing.assert_close(smoothed_clips(line, 2.0)[:, 10:-10], line[:, 10:-10])


def test_frames_after_the_end_do_not_count():
    found = smoothed_clips(clip(1.0, 1.0, 1.0, 50.0, -50.0), 1.5, torch.tensor([3]))
    torch.testing.assert_close(found, torch.ones(1, 5, 1))


def test_no_deviation_changes_nothing():
    values = clip(0.0, 3.0, -1.0)
    assert smoothed_clips(values, 0.0) is values
