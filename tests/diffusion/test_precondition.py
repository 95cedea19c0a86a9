import torch
from draws import seeded
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from geneoh.diffusion.precondition import Scaling, loss_weight, preconditioned

levels = st.floats(1e-3, 10.0)
scales = st.floats(1e-2, 2.0)


def sample() -> tuple[Tensor, Tensor]:
    return tuple(torch.randn(2, 4, 3, generator=seeded()))


def at(value: float) -> Tensor:
    return torch.tensor([[value]], dtype=torch.float32)


@given(scales)
def test_an_almost_clean_input_comes_back_whatever_the_network_says(scale):
    x, anchor = sample()
    got = preconditioned(lambda s, _: 50 * torch.ones_like(s), x, anchor, at(1e-6), at(scale))
    torch.testing.assert_close(got, x, atol=1e-4, rtol=0)


@given(levels, scales)
def test_without_a_network_it_is_the_mean_of_anchor_and_input_weighted_by_precision(sigma, scale):
    (x, anchor), seen = sample(), []

    def network(scaled: Tensor, level: Tensor) -> Tensor:
        seen.append((scaled, level))
        return torch.zeros_like(scaled)

    got = preconditioned(network, x, anchor, at(sigma), at(scale))
    here, there = sigma**-2, scale**-2
    torch.testing.assert_close(got, (here * x + there * anchor) / (here + there))
    scaling = Scaling.of(at(sigma), at(scale))
    torch.testing.assert_close(seen[0], (scaling.inp * (x - anchor), scaling.level))


@given(levels, scales)
def test_the_network_sees_and_predicts_numbers_of_unit_variance(sigma, scale):
    # clean = anchor + scale a, x = clean + sigma b with unit normal a, b: variances add
    s = Scaling.of(at(sigma), at(scale))
    torch.testing.assert_close(s.inp**2 * (at(sigma) ** 2 + at(scale) ** 2), at(1.0))
    left = (1 - s.skip) ** 2 * at(scale) ** 2 + s.skip**2 * at(sigma) ** 2
    torch.testing.assert_close(left / s.out**2, at(1.0), rtol=1e-3, atol=0)


@given(levels)
def test_the_weighted_error_without_a_network_is_between_a_half_and_one(sigma):
    s = Scaling.of(at(sigma), at(1.0))
    error = float(loss_weight(at(sigma)) * s.out**2)
    assert 0.4999 <= error <= 1.0001


def test_the_level_depends_on_the_ratio_of_noise_to_scale_and_grows_with_it():
    sigma = torch.tensor([0.0, 0.01, 0.1, 1.0])
    scale = torch.full((4,), 0.1)
    level = Scaling.of(sigma, scale).level
    assert bool(level.isfinite().all())
    assert bool((level.diff() > 0).all())
    torch.testing.assert_close(Scaling.of(7 * sigma[1:], 7 * scale[1:]).level, level[1:])


def test_each_item_is_scaled_by_its_own_level():
    x, anchor = sample()
    sigma, scale = torch.tensor([[0.1], [0.5], [2.0], [0.01]]), torch.full((4, 1), 0.3)

    def network(scaled: Tensor, level: Tensor) -> Tensor:
        return torch.tanh(scaled) * level

    whole = preconditioned(network, x, anchor, sigma, scale)
    for i in range(4):
        alone = preconditioned(
            network, x[i : i + 1], anchor[i : i + 1], sigma[i : i + 1], scale[:1]
        )
        torch.testing.assert_close(whole[i : i + 1], alone)
