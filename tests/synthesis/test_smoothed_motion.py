import torch

from geneoh.synthesis.draws import smoothed_motion


def test_what_changes_evenly_stays_and_ends_are_held():
    line = torch.arange(40.0)[None, :, None].expand(2, 40, 3)
    found = smoothed_motion(line, 2.0)
    torch.testing.assert_close(found[:, 6:-6], line[:, 6:-6])
    assert 0 < float(found[0, 0, 0]) < 1.5
    torch.testing.assert_close(smoothed_motion(torch.ones(1, 1, 2), 5.0), torch.ones(1, 1, 2))


def test_a_spike_becomes_a_gaussian_in_its_own_channel():
    spike = torch.zeros(1, 31, 2)
    spike[0, 15, 1] = 1.0
    found = smoothed_motion(spike, 2.0)[0]
    assert not found[:, 0].any()
    torch.testing.assert_close(found[:, 1], found[:, 1].flip(0))
    torch.testing.assert_close(found.sum(), torch.tensor(1.0))
    expected = torch.exp(torch.tensor(-0.5))  # one deviation from the middle
    torch.testing.assert_close(found[13, 1] / found[15, 1], expected)
