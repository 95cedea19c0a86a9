import torch

from geneoh.representation.window_scale import WindowScale


def windows() -> torch.Tensor:
    drawn = torch.randn(2, 6, 21, 3, generator=torch.Generator().manual_seed(0))
    return drawn * torch.tensor([0.03, 0.2]).view(2, 1, 1, 1) + torch.tensor([0.5, -1.0, 2.0])


def test_normalised_windows_have_mean_zero_and_one_deviation():
    got = WindowScale.of(windows()).normalised(windows())
    torch.testing.assert_close(got.mean((1, 2)), torch.zeros(2, 3), atol=1e-5, rtol=0)
    torch.testing.assert_close(got.square().mean((1, 2, 3)), torch.ones(2), atol=1e-4, rtol=0)


def test_metres_come_back():
    scale = WindowScale.of(windows())
    torch.testing.assert_close(scale.metres(scale.normalised(windows())), windows())


def test_a_hand_keeps_its_shape():
    """All axes have one unit, so that bones keep the ratios of their lengths."""
    scale = WindowScale.of(windows())
    bones = windows().diff(dim=2).norm(dim=-1)
    got = scale.normalised(windows()).diff(dim=2).norm(dim=-1)
    torch.testing.assert_close(got * scale.deviation[..., 0], bones)


def test_points_that_stand_still_have_a_scale():
    scale = WindowScale.of(torch.ones(1, 3, 21, 3))
    assert bool(scale.normalised(torch.ones(1, 3, 21, 3)).isfinite().all())
