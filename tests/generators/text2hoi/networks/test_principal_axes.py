import torch
from draws import normal, seeded

from geneoh.generators.text2hoi.networks.principal_axes import (
    PrincipalAxes,
    Waves,
    axes_of_most_variance,
    cosine_waves,
)

VALID = torch.tensor([[True, True, True, True, True], [True, True, True, False, False]])
SIGMA = torch.tensor([0.5, 2.0])


def codec(covariance: list[float], numbers: int = 3) -> PrincipalAxes:
    """Axes at random, along all of which the covariance over tokens is the same."""
    axes = PrincipalAxes(numbers, numbers, len(covariance))
    torch.nn.init.orthogonal_(axes.axes, generator=seeded(1))
    axes.covariance.copy_(torch.tensor(covariance)[:, None].expand(-1, numbers))
    return axes


def test_waves_are_orthonormal_over_the_tokens_before_the_end_and_zero_behind():
    basis = Waves.of(VALID, 7).basis
    torch.testing.assert_close(basis[0] @ basis[0].T, torch.eye(5))
    torch.testing.assert_close(basis[1] @ basis[1].T, torch.diag(VALID[1].float()))
    assert not basis[1, :, 3:].any()


def test_what_never_changes_varies_along_the_first_wave_alone():
    _, shares = cosine_waves(5, torch.device("cpu"))
    constant = shares @ torch.full((5,), 4.0)
    torch.testing.assert_close(constant[5], torch.tensor([20.0, 0, 0, 0, 0]))
    white = shares @ torch.tensor([4.0, 0, 0, 0, 0])
    torch.testing.assert_close(white[3], torch.tensor([4.0, 4, 4, 0, 0]))


def test_the_variances_of_waves_are_those_of_a_sequence_with_this_covariance():
    lag = torch.arange(5.0)
    covariance = 0.8**lag
    dense = 0.8 ** (lag - lag[:, None]).abs()
    basis, shares = cosine_waves(5, torch.device("cpu"))
    torch.testing.assert_close(shares[5] @ covariance, (basis[5] @ dense @ basis[5].T).diagonal())


def test_the_linear_answer_to_what_never_changes_is_its_shrunken_mean():
    """Least squares: with noise s and variance v, the mean of n tokens by n v / (n v + s^2)."""
    axes = codec([4.0] * 5)
    value = normal(2, 1, 3)
    noisy = (value + normal(2, 5, 3, seed=2)) * VALID[..., None]
    _, linear = axes.read(noisy, SIGMA, Waves.of(VALID, 5))
    count = VALID.sum(1)[:, None]
    mean = noisy.sum(1) / count @ axes.axes.T
    wanted = mean * (4 * count / (4 * count + SIGMA[:, None].square())) / 2
    torch.testing.assert_close(linear[:, 0], wanted, atol=0.01, rtol=0)
    torch.testing.assert_close(linear[0, 4], linear[0, 0], atol=0.01, rtol=0)
    assert not linear[1, 3:].any()


def test_numbers_are_read_in_units_of_their_deviation_with_their_noise():
    own, _ = codec([4.0, 0.0, 0.0, 0.0, 0.0]).read(normal(2, 5, 3), SIGMA, Waves.of(VALID, 5))
    total = (4 + SIGMA.square())[:, None]
    torch.testing.assert_close(own.norm(dim=-1), normal(2, 5, 3).norm(dim=-1) / total.sqrt())


def test_the_answer_that_is_asked_of_the_network_gives_the_clean_numbers():
    """Karras et al. 2022, for a signal of variance 4 that is not correlated over tokens."""
    axes, waves = codec([4.0, 0.0, 0.0, 0.0, 0.0]), Waves.of(torch.ones_like(VALID), 5)
    clean, noise = normal(2, 5, 3), SIGMA[:, None, None] * normal(2, 5, 3, seed=2)
    total = 4 + SIGMA[:, None, None].square()
    _, linear = axes.read(clean + noise, SIGMA, waves)
    guess = axes.write(linear, 0 * linear, SIGMA, waves)
    torch.testing.assert_close(guess, 4 / total * (clean + noise))
    wanted = (clean - guess) @ axes.axes.T / (SIGMA[:, None, None] * 2 / total.sqrt())
    torch.testing.assert_close(axes.write(linear, wanted, SIGMA, waves), clean)


def test_principal_axes_fall_in_variance_and_are_of_unit_length():
    axes = axes_of_most_variance(normal(20000, 3) * torch.tensor([1.0, 3.0, 2.0]))
    torch.testing.assert_close(axes.abs(), torch.eye(3)[[1, 2, 0]], atol=0.05, rtol=0)
