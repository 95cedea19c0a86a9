"""The baselines that answer at once: a TOCH-style autoencoder and a plain regression."""

from dataclasses import replace

import pytest
import torch

from geneoh.baselines.networks import (
    OBSERVATION_FEATURES,
    RegressionConfig,
    RegressionDenoiser,
    TochAutoencoder,
    TochConfig,
    load_baseline,
)
from geneoh.errors import CheckpointError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation.spatial import SpatialRelations


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_features_have_their_width_for_any_number_of_frames(make_observation, frames):
    assert make_observation(frames=frames).features().shape == (2, frames, OBSERVATION_FEATURES)


def test_steady_motion_has_no_jitter_and_a_spike_has(make_observation):
    start = make_observation(frames=1).joints
    joints = start + 0.01 * torch.arange(6.0)[:, None, None]
    steady = replace(make_observation(), joints=joints, trust=torch.ones(2, 6, 21))
    jitter = slice(63 + 60, 63 + 60 + 63)
    assert float(steady.features()[..., jitter].abs().max()) < 1e-4
    spiked = replace(steady, joints=joints + 0.02 * (torch.arange(6) == 3)[:, None, None])
    seen = spiked.features()[..., jitter].abs().amax((0, 2))
    torch.testing.assert_close(seen, torch.tensor([0.0, 0, 1, 2, 1, 0]), atol=1e-4, rtol=0)


def test_bone_lengths_are_those_of_most_frames(make_observation):
    joints = make_observation(frames=1).joints.expand(-1, 5, -1, -1).clone()
    plain = replace(make_observation(), joints=joints, trust=torch.ones(2, 5, 21))
    torn = joints.clone()
    torn[:, 2] *= 3
    bones = slice(OBSERVATION_FEATURES - 21, OBSERVATION_FEATURES - 1)
    assert torch.equal(
        replace(plain, joints=torn).features()[..., bones], plain.features()[..., bones]
    )


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
