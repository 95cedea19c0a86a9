import pytest
import torch
from draws import seeded

from geneoh.diffusion.posterior import CAUTION, Posterior, along_a_track, importance_posterior

MEAN = torch.tensor([[0.02, -0.01, 0.005], [0.0, 0.03, -0.02]])
ROOT = torch.tensor([[0.006, 0.0, 0.0], [0.002, 0.004, 0.0], [0.0, -0.001, 0.003]])
PRIOR = 0.02 * torch.eye(3).expand(2, 3, 3)


def normal_density(places):
    unit = torch.linalg.solve_triangular(ROOT, (places - MEAN[:, None]).mT, upper=False)
    return 7.0 - 0.5 * unit.square().sum(1)


def found(rounds: int, places: int = 400, seed: int = 0) -> Posterior:
    return importance_posterior(
        normal_density, PRIOR, rounds=rounds, places=places, generator=seeded(seed)
    )


def test_mean_and_width_are_those_of_a_normal_density():
    got = found(5)
    torch.testing.assert_close(got.mean, MEAN, atol=5e-4, rtol=0)
    covariance = got.root @ got.root.mT
    want = (ROOT @ ROOT.T).expand(2, 3, 3)
    torch.testing.assert_close(covariance, want, atol=6e-6, rtol=0)


def test_more_rounds_come_closer():
    def error(rounds: int) -> float:
        apart = [(found(rounds, 200, seed).mean - MEAN).norm(dim=-1) for seed in range(10)]
        return float(torch.stack(apart).mean())

    assert error(4) < 0.3 * error(2) < 0.3 * error(1)


def test_the_prior_is_found_where_the_density_says_nothing_but_the_prior():
    def prior(places):
        return -0.5 * (places / 0.02).square().sum(-1)

    got = importance_posterior(prior, PRIOR, rounds=2, places=2000, generator=seeded())
    torch.testing.assert_close(got.mean, torch.zeros(2, 3), atol=2e-3, rtol=0)
    torch.testing.assert_close(got.root @ got.root.mT, PRIOR @ PRIOR, atol=5e-5, rtol=0)


def test_places_without_density_are_not_taken():
    def half(places):
        return normal_density(places).masked_fill(places[..., 0] < 0.02, -torch.inf)

    got = importance_posterior(half, PRIOR, rounds=3, places=400, generator=seeded())
    assert float(got.mean[0, 0]) > 0.022


@pytest.mark.parametrize("count", [1, 2, 4, 5])
def test_the_mean_of_the_samples_is_exactly_the_mean(count):
    posterior = found(2)
    samples = posterior.samples(count, generator=seeded())
    assert samples.shape == (count, 2, 3)
    torch.testing.assert_close(samples.mean(0), posterior.mean, atol=1e-6, rtol=0)


@pytest.mark.parametrize("count", [2, 4, 5])
def test_a_few_samples_are_as_far_from_the_mean_as_the_density_is_wide(count):
    posterior = found(5)
    apart = posterior.samples(count, generator=seeded()) - posterior.mean
    size = apart.square().sum((0, -1)) / (count - count % 2)
    torch.testing.assert_close(size, posterior.root.square().sum((-1, -2)))


def test_many_samples_have_the_width_of_the_density():
    posterior = found(5)
    samples = posterior.samples(4000, generator=seeded()) - posterior.mean
    covariance = torch.einsum("sbi,sbj->bij", samples, samples) / len(samples)
    torch.testing.assert_close(covariance, posterior.root @ posterior.root.mT, atol=3e-6, rtol=0)


def test_a_seed_fixes_the_answer():
    first, again, other = (found(2, seed=seed) for seed in (0, 0, 1))
    assert torch.equal(first.mean, again.mean)
    assert not torch.equal(first.mean, other.mean)


def one_number(mean: float, deviation: float) -> Posterior:
    return Posterior(torch.tensor([[mean]] * 3), torch.tensor([[[deviation]]] * 3))


def test_windows_that_must_agree_share_what_they_say():
    """Three windows of prior 10 and likelihood 10 mm each, all of one shift: precisions add."""
    each = one_number(0.005, 50**0.5 / 1000)  # prior N(0, 10 mm), likelihood N(10 mm, 10 mm)
    got = along_a_track(each, torch.full((3, 1, 1), 0.01), torch.ones(3, 3), 1.0)
    torch.testing.assert_close(got.mean, torch.full((1, 3), 0.0075), atol=1e-5, rtol=0)
    covariance = got.root[0] @ got.root[0].mT
    torch.testing.assert_close(covariance, torch.full((3, 3), 25e-6), atol=1e-7, rtol=0)


def test_windows_without_agreement_stay_as_they_are():
    each = one_number(0.005, 50**0.5 / 1000)
    got = along_a_track(each, torch.full((3, 1, 1), 0.01), torch.eye(3), 1.0)
    torch.testing.assert_close(got.mean, each.mean.T, atol=1e-5, rtol=0)
    want = each.root[:, 0].T * torch.eye(3)
    torch.testing.assert_close(got.root[0], want, atol=1e-5, rtol=0)


def test_windows_that_say_less_than_the_prior_count_for_nothing():
    each = one_number(0.004, 0.012)
    got = along_a_track(each, torch.full((3, 1, 1), 0.01), torch.ones(3, 3), 1.0)
    torch.testing.assert_close(got.mean, torch.zeros(1, 3), atol=1e-6, rtol=0)
    assert float(got.root[0, 0, 0]) == pytest.approx(0.01, abs=1e-5)


def test_a_mean_within_its_own_width_is_drawn_to_zero():
    mean = torch.tensor([[0.001, 0.0, 0.0, 0.1, 0.0, 0.0]])
    got = Posterior(mean, 0.01 * torch.eye(6)[None]).cautious(3)
    small, large = 0.1**2, 10.0**2
    want = torch.tensor(
        [[0.001 * small / (CAUTION + small), 0, 0, 0.1 * large / (CAUTION + large), 0, 0]]
    )
    torch.testing.assert_close(got.mean, want)
    assert torch.equal(got.root, 0.01 * torch.eye(6)[None])
