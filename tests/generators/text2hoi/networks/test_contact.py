import math
from dataclasses import replace

import pytest
import torch
from made_actions import made_actions
from made_networks import TINY

from geneoh.generators.text2hoi.networks.autoencoders import (
    ContactConfig,
    ContactNetwork,
    contact_loss,
)
from geneoh.generators.text2hoi.networks.objects import Objects, PointConfig, PointNet, pooled


def network_of(**changes) -> ContactNetwork:
    torch.manual_seed(0)
    return ContactNetwork(replace(TINY.contact, **changes)).eval()


def test_two_seeds_make_two_maps_and_one_seed_one():
    network, objects = network_of(), Objects.of(made_actions())
    text = torch.ones(6, 8)

    def drawn(seed: int) -> torch.Tensor:
        with torch.no_grad():
            return network.sample(objects, text, generator=torch.Generator().manual_seed(seed))

    assert drawn(0).equal(drawn(0))
    assert not drawn(0).allclose(drawn(1))
    assert drawn(0).min() >= 0
    assert drawn(0).max() <= 1


def test_the_order_of_points_does_not_matter():
    network, objects = network_of(), Objects.of(made_actions())
    text, latent = torch.ones(6, 8), torch.zeros(6, 3)
    order = torch.randperm(48, generator=torch.Generator().manual_seed(0))
    first = network.decode(latent, objects, text)[:, order]
    torch.testing.assert_close(first, network.decode(latent, objects.take(order, "P"), text))


def test_the_loss_of_a_map_that_is_known_and_a_latent_that_tells_nothing():
    """Half of 48 points touched: the loss is the dice loss's, whose sums are one more."""
    network, objects = network_of(), Objects.of(made_actions())
    contact = (torch.arange(48) < 24).float().expand(6, 48)
    network.encode = lambda *_: (torch.zeros(6, 3), torch.zeros(6, 3))
    network.decode = lambda *_: 200.0 * (contact - 0.5)
    given = network, objects, contact, torch.ones(6, 8)
    found = contact_loss(*given, divergence=1.0, noise=torch.zeros(6, 3))
    assert found == pytest.approx(1 - 2 * 24 / 49)
    network.decode = lambda *_: torch.zeros(6, 48)
    network.encode = lambda *_: (torch.full((6, 3), 2.0), torch.zeros(6, 3))
    found = contact_loss(*given, divergence=0.5, noise=torch.zeros(6, 3))
    assert found == pytest.approx(math.log(2) + 1 - 2 * 12 / 49 + 0.5 * 6)


def test_a_map_without_any_contact_has_a_finite_loss():
    network, objects = network_of(), Objects.of(made_actions())
    given = {"divergence": 1.0, "noise": torch.zeros(6, 3)}
    assert contact_loss(network, objects, torch.zeros(6, 48), torch.ones(6, 8), **given).isfinite()


def test_the_latent_of_the_encoder_depends_on_the_map():
    network, objects = network_of(), Objects.of(made_actions())
    first, _ = network.encode(objects, torch.zeros(6, 48))
    second, _ = network.encode(objects, torch.ones(6, 48))
    assert (first - second).abs().amax(1).min() > 1e-5


def test_the_largest_features_of_each_group_are_kept():
    features = torch.tensor([[[1.0, -1.0], [3.0, -5.0], [2.0, -2.0]]])
    found = pooled(features, torch.tensor([[0, 0, 2]]), 3)
    assert found.tolist() == [[[3, -1], [0, 0], [2, -2]]]


def test_points_are_turned_by_nothing_before_training():
    config = PointConfig(6, 8, 12, turned=True)
    network = PointNet(3, config)
    points = torch.randn(2, 9, 3, generator=torch.Generator().manual_seed(0))
    assert network.turn is not None
    torch.testing.assert_close(network.turn(points), points)


def test_the_paper_s_decoder_reads_what_the_paper_s_does():
    """1,665 numbers of each point: latent 64, scale 1, features 1,024 and 64, sentence 512."""
    points = PointConfig(64, 128, 1024, turned=True)
    network = ContactNetwork(ContactConfig(64, 512, 512, places_alone=True, points=points))
    assert network.whole.in_features + network.each.in_features == 1665
