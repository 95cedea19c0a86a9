import torch

from geneoh.pipeline.spread import SCALE, joint_spread


def test_samples_that_agree_leave_no_doubt():
    assert float(joint_spread(torch.ones(2, 4, 21, 3)).max()) == 0


def test_the_spread_is_the_scaled_deviation_over_samples():
    samples = 0.004 * torch.randn(2000, 3, 21, 3, generator=torch.Generator().manual_seed(0))
    samples[:, :, 4] *= 2
    expected = torch.full((3, 21), SCALE * 0.004 * 3**0.5)
    expected[:, 4] *= 2
    torch.testing.assert_close(joint_spread(samples), expected, atol=0, rtol=0.05)
