"""Small networks with random weights, and observations to show them."""

import networks
import pytest


@pytest.fixture(scope="session")
def make_observation():
    return networks.observation


@pytest.fixture(scope="session")
def wake():
    return networks.awake


@pytest.fixture(scope="session")
def draw():
    return networks.normal
