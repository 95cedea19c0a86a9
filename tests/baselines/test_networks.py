"""The baselines that answer at once: a TOCH-style autoencoder and a plain regression."""

import pytest
import torch

from geneoh.baselines.library import load_baseline
from geneoh.baselines.regression import RegressionConfig, RegressionDenoiser
from geneoh.baselines.toch import TochAutoencoder, TochConfig
from geneoh.errors import CheckpointError
from geneoh.geometry.rotations import axis_angle_to_matrix

REGRESSION = RegressionConfig(width=16, depth=1, heads=2, point_width=8)
TOCH = TochConfig(point_width=8, hidden=8, latent=6)
NETWORKS = (RegressionDenoiser(REGRESSION), TochAutoencoder(TOCH))


@pytest.fixture
def surroundings(draw):
    """Contact points around the origin with unit normals."""
    points = 0.03 * draw(2, 4, 5, 3, seed=1)
    return points, torch.nn.functional.normalize(draw(2, 4, 5, 3, seed=2), dim=-1)


def test_a_fresh_regression_changes_nothing(make_observation, surroundings):
    observation = make_observation()
    with torch.no_grad():
        got = RegressionDenoiser(REGRESSION)(observation, *surroundings)
    torch.testing.assert_close(got, observation.joints, atol=1e-6, rtol=0)


@pytest.mark.parametrize("network", NETWORKS, ids=lambda n: type(n).__name__)
def test_answers_turn_with_the_scene(network, wake, make_observation, surroundings):
    network, observation = wake(network), make_observation()
    points, normals = surroundings
    turn = axis_angle_to_matrix(torch.tensor([0.4, -1.1, 0.7]))
    got = network(observation, points, normals)
    turned = network(
        observation.turned(turn.expand(2, 3, 3)),
        points @ turn,
        normals @ turn,
    )
    assert (got - observation.joints).abs().max() > 1e-3
    torch.testing.assert_close(turned, got @ turn, atol=1e-4, rtol=0)


def test_the_autoencoder_knows_nothing_of_trust(wake, make_observation, surroundings):
    network, observation = wake(TochAutoencoder(TOCH)), make_observation()
    points, normals = surroundings
    doubtful = type(observation)(observation.joints, 0 * observation.trust, observation.given)
    got = network(observation, points, normals)
    assert torch.equal(network(doubtful, points, normals), got)


@pytest.mark.parametrize("name", ["toch", "regression"])
def test_a_baseline_without_weights_is_told(tmp_path, name):
    with pytest.raises(CheckpointError, match=rf"{name}\.safetensors: expected weights there"):
        load_baseline(name, tmp_path)
