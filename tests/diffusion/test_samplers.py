"""Samplers on Gaussian data, whose best denoiser is known: the posterior mean."""

import pytest
import torch
from draws import seeded
from torch import Tensor

from geneoh.diffusion.samplers import (
    ancestral,
    antithetic_noise,
    ddim,
    denoise_via_diffusion,
    multistep,
    normal_like,
    reverse_process,
)
from geneoh.diffusion.schedule import (
    PAPER_STEPS,
    cosine_sigmas,
    descending_sigmas,
    linear_sigmas,
    logarithmic_sigmas,
)

SAMPLERS = {
    "ancestral": lambda: ancestral(seeded()),
    "ddim": lambda: ddim,
    "multistep": multistep,
}
MEAN = 1.5


def posterior_mean(x: Tensor, sigma: float) -> Tensor:
    """The clean sample to expect behind x = clean + sigma * noise, clean from N(MEAN, 1)."""
    return MEAN + (x - MEAN) / (1 + sigma**2)


def diffused(count: int, sigma: float, seed: int = 0) -> Tensor:
    generator = seeded(seed)
    clean = MEAN + torch.randn(count, generator=generator)
    return clean + sigma * torch.randn(count, generator=generator)


@pytest.mark.parametrize("steps", [4, 100])
def test_ancestral_sampling_returns_the_mean_and_variance_of_the_data(steps):
    sigmas = descending_sigmas(400, steps)
    x = diffused(20_000, float(sigmas[0]))
    got = reverse_process(posterior_mean, x, sigmas, ancestral(seeded(1)))
    # four standard errors of 20,000 samples; the last step adds no noise of its own
    assert float(got.mean()) == pytest.approx(MEAN, abs=4 / 20_000**0.5)
    lost = 1 - 1 / (1 + float(sigmas[-2]) ** 2)
    assert float(got.var()) == pytest.approx(1 - lost, abs=4 * (2 / 20_000) ** 0.5)


def test_ddim_with_many_steps_maps_diffused_samples_to_the_data():
    sigmas = descending_sigmas(400, 400)
    spread = (1 + float(sigmas[0]) ** 2) ** 0.5
    x = MEAN + spread * torch.linspace(-2, 2, 9)
    got = reverse_process(posterior_mean, x, sigmas, ddim)
    torch.testing.assert_close(got, MEAN + torch.linspace(-2, 2, 9), atol=0.02, rtol=0)


def test_few_multistep_steps_map_noise_to_the_data_and_as_few_of_ddim_do_not():
    sigmas = logarithmic_sigmas(12, cosine_sigmas())
    data = MEAN + torch.linspace(-2, 2, 9)
    x = MEAN + sigmas[0] * torch.linspace(-2, 2, 9)
    got = reverse_process(posterior_mean, x, sigmas, multistep())
    torch.testing.assert_close(got, data, atol=0.055, rtol=0)
    lost = reverse_process(posterior_mean, x, sigmas, ddim)
    assert float((lost - data).abs().max()) > 0.3


def test_each_multistep_step_goes_on_from_the_change_of_the_answer():
    """Answers that change by the logarithm of the noise are met exactly (Lu et al. 2022)."""
    sigmas = torch.tensor([8.0, 4.0, 1.0])
    first, second = 3.0, 5.0
    answers = iter([first, second])
    got = reverse_process(
        lambda x, _: torch.full_like(x, next(answers)), torch.zeros(1), sigmas, multistep()
    )
    after_one = first + 0.5 * (0.0 - first)
    ahead = second + (second - first) * 2 / 2  # the step is twice as wide as the one before
    assert float(got) == pytest.approx(ahead + 0.25 * (after_one - ahead))


def test_logarithmic_levels_go_from_the_most_noise_to_none():
    levels = logarithmic_sigmas(5, 10 * cosine_sigmas())
    assert levels[[0, -2, -1]].tolist() == pytest.approx([800, 0.2, 0], rel=0.02)
    ratios = levels[1:-1] / levels[:-2]
    torch.testing.assert_close(ratios, ratios[:1].expand(4))
    assert logarithmic_sigmas(1, cosine_sigmas()).tolist() == pytest.approx([80, 0], rel=0.02)


@pytest.mark.parametrize("name", SAMPLERS)
def test_data_of_one_point_comes_back_exactly(name):
    point = torch.tensor([0.3, -2.0])
    x = point + 2 * torch.randn(5, 2, generator=seeded())
    sigmas, step = descending_sigmas(200, 7), SAMPLERS[name]()
    got = reverse_process(lambda x, _: point.expand_as(x), x, sigmas, step)
    assert torch.equal(got, point.expand(5, 2))


def test_one_ancestral_step_is_equation_5_of_the_paper():
    level = 137
    betas = torch.linspace(1e-4, 0.02, PAPER_STEPS, dtype=torch.float64)
    beta, signal = float(betas[level - 1]), (1 - betas).cumprod(0)
    above, below = float(signal[level - 1]), float(signal[level - 2])
    unscaled = torch.randn(6, dtype=torch.float64, generator=seeded())
    eps = torch.randn(6, dtype=torch.float64, generator=seeded(1))
    noise = torch.randn(6, generator=seeded(2)).double()
    mean = (unscaled - beta / (1 - above) ** 0.5 * eps) / (1 - beta) ** 0.5
    paper = mean + beta**0.5 * noise

    sigmas = linear_sigmas()[[level, level - 1]]
    # what eps says of the clean sample: x_n = sqrt(abar) x_0 + sqrt(1 - abar) eps
    clean = (unscaled - (1 - above) ** 0.5 * eps) / above**0.5
    scaled = reverse_process(lambda *_: clean, unscaled / above**0.5, sigmas, ancestral(seeded(2)))
    torch.testing.assert_close(scaled * below**0.5, paper, rtol=1e-9, atol=1e-9)


def test_one_ddim_step_keeps_the_noise_that_the_denoiser_sees():
    clean, eps = torch.randn(2, 6, generator=seeded())
    sigmas = torch.tensor([0.8, 0.5])
    got = reverse_process(lambda *_: clean, clean + 0.8 * eps, sigmas, ddim)
    torch.testing.assert_close(got, clean + 0.5 * eps)


@pytest.mark.parametrize("name", SAMPLERS)
def test_the_denoiser_is_called_at_every_level_but_the_last(name):
    sigmas, seen, heard = descending_sigmas(200, 5), [], []

    def model(x: Tensor, sigma: float) -> Tensor:
        seen.append(sigma)
        return 0.5 * x

    step = SAMPLERS[name]()
    reverse_process(model, torch.zeros(1), sigmas, step, on_step=lambda *at: heard.append(at))
    assert seen == sigmas[:-1].double().tolist()
    assert heard == [(i, 5) for i in range(1, 6)]


@pytest.mark.parametrize("name", ["ancestral", "ddim"])
def test_denoising_via_diffusion_depends_on_the_generator_alone(name):
    x, sigmas = torch.randn(3, 4, generator=seeded()), descending_sigmas(200, 5)

    def run(seed: int) -> Tensor:
        return denoise_via_diffusion(
            posterior_mean, x, sigmas, sampler=name, samples=3, generator=seeded(seed)
        )

    assert torch.equal(run(3), run(3))
    assert not torch.equal(run(3), run(4))


@pytest.mark.parametrize("name", ["ancestral", "ddim"])
def test_denoising_via_diffusion_starts_from_the_noised_input(name):
    x, sigmas = torch.randn(4000, generator=seeded()), descending_sigmas(200, 1)
    seen = []

    def model(noised: Tensor, _: float) -> Tensor:
        seen.append(noised)
        return noised

    denoise_via_diffusion(model, x, sigmas, sampler=name, samples=1, generator=seeded(1))
    noise = (seen[0] - x) / sigmas[0]
    assert float(noise.mean()) == pytest.approx(0, abs=0.07)
    assert float(noise.std()) == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("count", [1, 4, 5])
def test_samples_start_from_opposite_noise(count):
    noise = antithetic_noise(torch.zeros(count, 5000), samples=count, generator=seeded())
    torch.testing.assert_close(noise.std(1), torch.ones(count), atol=0.05, rtol=0)
    pairs, half = count // 2, (count + 1) // 2
    assert torch.equal(noise[half:], -noise[:pairs])
    assert not torch.equal(noise[0], noise[pairs - 1]) or count < 4, "pairs differ"


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_the_windows_of_a_sample_have_noise_of_their_own(samples):
    windows = 4
    noise = antithetic_noise(
        torch.zeros(samples * windows, 5000), samples=samples, generator=seeded()
    )
    first, *others = noise.unflatten(0, (samples, windows))
    assert float(torch.corrcoef(first).fill_diagonal_(0).abs().max()) < 0.06
    if others:
        assert torch.equal(others[-1], -first)


def test_what_is_linear_in_the_noise_cancels_in_the_mean_of_samples():
    x, sigmas = torch.zeros(4, 1000), descending_sigmas(400, 8)
    found = denoise_via_diffusion(
        posterior_mean, x, sigmas, sampler="ddim", samples=4, generator=seeded()
    )
    assert float(found.std(0).mean()) > 0.3, "samples differ"
    assert float(found.mean(0).std()) < 1e-5


def test_noise_follows_shape_and_type():
    for x in (torch.zeros(2, 3, dtype=torch.float64), torch.zeros(4)):
        noise = normal_like(x, generator=seeded())
        assert (noise.shape, noise.dtype) == (x.shape, x.dtype)


@pytest.mark.parametrize(("sigma", "after"), [(2.0, 1.3), (1.3, 0.4), (0.4, 0.02)])
def test_an_ancestral_step_of_any_length_is_the_posterior_of_unit_gaussian_data(sigma, after):
    """x' given x is N((1 + s'^2) / (1 + s^2) x, (s^2 - s'^2) (1 + s'^2) / (1 + s^2))."""
    x = torch.tensor([0.0, 1.0, -3.0])
    noise = torch.randn(3, generator=seeded(5))
    sigmas, step = torch.tensor([sigma, after]), ancestral(seeded(5))
    got = reverse_process(lambda x, s: x / (1 + s**2), x, sigmas, step)
    share = (1 + after**2) / (1 + sigma**2)
    want = share * x + (share * (sigma**2 - after**2)) ** 0.5 * noise
    torch.testing.assert_close(got, want)


def test_a_direct_answer_is_one_call_on_the_input_and_draws_nothing():
    x, sigmas, generator = torch.randn(8, generator=seeded(2)), descending_sigmas(100, 5), seeded()
    before, heard = generator.get_state(), []
    got = denoise_via_diffusion(
        posterior_mean,
        x,
        sigmas,
        sampler="direct",
        samples=1,
        generator=generator,
        on_step=lambda *now: heard.append(now),
    )
    assert torch.equal(got, posterior_mean(x, float(sigmas[0])))
    assert torch.equal(generator.get_state(), before)
    assert heard == [(1, 1)]
