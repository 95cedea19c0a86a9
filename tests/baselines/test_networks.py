"""The baselines that answer at once: a TOCH-style autoencoder and a plain regression."""

import pytest
import torch

from geneoh.baselines.library import load_baseline
from geneoh.baselines.regression import RegressionConfig, RegressionDenoiser
from geneoh.baselines.toch import TochAutoencoder, TochConfig
from geneoh.errors import CheckpointError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation.spatial import SpatialRelations

REGRESSION = RegressionConfig(width=16, depth=1, heads=2, point_width=8)
TOCH = TochConfig(point_width=8, hidden=8, latent=6)
NETWORKS = (RegressionDenoiser(REGRESSION), TochAutoencoder(TOCH))


@pytest.fixture
def relate(draw):
    """Relations of a hand to contact points around the origin."""
    points = 0.03 * draw(2, 4, 5, 3, seed=1)
    normals = torch.nn.functional.normalize(draw(2, 4, 5, 3, seed=2), dim=-1)
    place = SpatialRelations(points, normals, points.new_zeros(2, 4, 5, 21, 3))
    return lambda observation: place.of_hand(observation.joints)


def test_a_fresh_regression_changes_nothing(make_observation, relate):
    observation = make_observation()
    with torch.no_grad():
        got = RegressionDenoiser(REGRESSION)(observation, relate(observation))
    torch.testing.assert_close(got, observation.joints, atol=1e-6, rtol=0)


@pytest.mark.parametrize("network", NETWORKS, ids=lambda n: type(n).__name__)
def test_answers_turn_with_the_scene(network, wake, make_observation, relate):
    network, observation = wake(network), make_observation()
    relations, turn = relate(observation), axis_angle_to_matrix(torch.tensor([0.4, -1.1, 0.7]))
    axes = turn.expand(2, 3, 3)
    got = network(observation, relations)
    turned = network(observation.turned(axes), relations.turned(axes))
    assert (got - observation.joints).abs().max() > 1e-3
    torch.testing.assert_close(turned, got @ turn, atol=1e-4, rtol=0)


def test_the_autoencoder_knows_nothing_of_trust(wake, make_observation, relate):
    network, observation = wake(TochAutoencoder(TOCH)), make_observation()
    relations = relate(observation)
    doubtful = type(observation)(observation.joints, 0 * observation.trust)
    got = network(observation, relations)
    assert torch.equal(network(doubtful, relations), got)


@pytest.mark.parametrize("name", ["toch", "regression"])
def test_a_baseline_without_weights_is_told(tmp_path, name):
    with pytest.raises(CheckpointError, match=rf"{name}\.safetensors: expected weights there"):
        load_baseline(name, tmp_path)
