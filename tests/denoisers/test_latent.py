from dataclasses import fields

import pytest
import torch

from geneoh.denoisers.latent import LatentConfig, LatentDenoiser, TemporalAutoencoder
from geneoh.representation.region import ContactRegion
from geneoh.representation.temporal import TemporalRelations, encode_temporal, places_by_distance

TINY = LatentConfig(latent=6, point_width=8, width=16, depth=1, heads=2)
K = 5


@pytest.fixture(scope="module")
def model(wake):
    return wake(LatentDenoiser(TINY))


@pytest.fixture(scope="module")
def relate(draw):
    """Temporal relations of a batch of two clips and their canonical contact points."""

    def make(frames: int, order: list[int] | None = None):
        pick = order or list(range(K))
        normals = torch.nn.functional.normalize(draw(2, 1, K, 3, seed=3), dim=-1)
        points = 0.03 * draw(2, 1, K, 3, seed=2) + 0.01 * draw(2, frames, 1, 3, seed=4)
        region = ContactRegion(
            points[:, :, pick],
            normals.expand(-1, frames, -1, -1)[:, :, pick],
            torch.eye(3).expand(2, frames, 3, 3),
            points.mean(2),
        )
        joints = 0.06 * draw(2, 1, 21, 3, seed=5) + 0.01 * draw(2, frames, 1, 3, seed=6)
        return encode_temporal(joints, region, 30.0), region.points_canon[:, :-1]

    return make


@pytest.mark.parametrize("frames", [2, 3, 7])
def test_a_latent_per_frame_pair_goes_in_and_statistics_come_out(model, relate, frames):
    relations, points = relate(frames)
    encoder = model.autoencoder
    latent = encoder.encode(relations, points)
    assert latent.shape == (2, frames - 1, 6)
    decoded = encoder.decode(latent, relations.object_velocity, relations.normals, points)
    for field in fields(decoded):
        assert getattr(decoded, field.name).shape == getattr(relations, field.name).shape
        assert bool(getattr(decoded, field.name).isfinite().all())


def test_the_latent_does_not_depend_on_the_order_of_contact_points(model, relate):
    order = [3, 0, 4, 2, 1]
    plain, shuffled = (model.autoencoder.encode(*relate(4, o)) for o in (None, order))
    torch.testing.assert_close(plain, shuffled, atol=1e-5, rtol=1e-5)


def test_decoded_statistics_follow_the_order_of_contact_points(model, relate, draw):
    order, latent = [3, 0, 4, 2, 1], draw(2, 3, 6)
    relations, points = relate(4)
    plain = model.autoencoder.decode(latent, relations.object_velocity, relations.normals, points)
    shuffled = model.autoencoder.decode(
        latent,
        relations.object_velocity[:, :, order],
        relations.normals[:, :, order],
        points[:, :, order],
    )
    torch.testing.assert_close(shuffled.velocity, plain.velocity[:, :, order])
    torch.testing.assert_close(shuffled.distance, plain.distance[:, :, order])


def test_the_latent_sees_every_statistic_it_is_said_to(model, relate):
    relations, points = relate(4)
    plain = model.autoencoder.encode(relations, points)
    for field in fields(TemporalRelations):
        values = {f.name: getattr(relations, f.name) for f in fields(TemporalRelations)}
        values[field.name] = values[field.name] + 0.1
        other = model.autoencoder.encode(TemporalRelations(**values), points)
        assert not torch.allclose(other, plain, atol=1e-5), field.name


def test_decoded_statistics_are_those_of_a_hand(model, relate, draw):
    relations, points = relate(4)
    around = relations.object_velocity, relations.normals, points
    decoded = model.autoencoder.decode(draw(2, 3, 6), *around)
    hand = places_by_distance(decoded.distance, points)
    again = (hand[:, :, None] - points[..., None, :]).norm(dim=-1)
    torch.testing.assert_close(again, decoded.distance, atol=5e-3, rtol=0)


def test_before_training_what_is_encoded_comes_back(relate):
    fresh = TemporalAutoencoder(LatentConfig())
    relations, points = relate(4)
    latent = fresh.encode(relations, points)
    decoded = fresh.decode(latent, relations.object_velocity, relations.normals, points)
    for field in fields(decoded):
        got, want = getattr(decoded, field.name), getattr(relations, field.name)
        torch.testing.assert_close(got, want, atol=5e-3, rtol=0)


def test_whitening_moves_the_latent_and_not_what_it_decodes_to(wake, relate):
    plain, white = (wake(TemporalAutoencoder(TINY)) for _ in range(2))
    white.latent_mean.fill_(0.7)
    white.latent_std.fill_(2.0)
    relations, points = relate(4)
    known = (relations.object_velocity, relations.normals, points)
    latents = [m.encode(relations, points) for m in (plain, white)]
    torch.testing.assert_close(latents[1], (latents[0] - 0.7) / 2)
    decoded = [m.decode(z, *known).velocity for m, z in zip((plain, white), latents, strict=True)]
    torch.testing.assert_close(*decoded)


@pytest.mark.parametrize("pairs", [1, 2, 6])
def test_a_clean_latent_has_the_shape_of_the_noisy_one(model, draw, pairs):
    x = draw(2, pairs, 6)
    assert model(x, torch.tensor([0.1, 1.0])).shape == x.shape


def test_an_untrained_network_is_the_skip_path(draw):
    x, sigma = draw(2, 3, 6), torch.tensor([0.3, 2.0])
    with torch.no_grad():
        got = LatentDenoiser(TINY)(x, sigma)
    torch.testing.assert_close(got, x / (1 + sigma**2)[:, None, None])


def test_an_almost_clean_latent_comes_back(model, draw):
    x = draw(2, 3, 6)
    torch.testing.assert_close(model(x, torch.full((2,), 1e-6)), x, atol=1e-4, rtol=0)


def test_the_clips_of_a_batch_do_not_influence_each_other(model, draw, relate):
    x, sigma = draw(2, 3, 6), torch.tensor([0.2, 1.0])
    whole = model(x, sigma)
    for i in range(2):
        pick = slice(i, i + 1)
        torch.testing.assert_close(model(x[pick], sigma[pick]), whole[pick])
    relations, points = relate(4)
    latent = model.autoencoder.encode(relations, points)
    alone = TemporalRelations(
        **{f.name: getattr(relations, f.name)[1:] for f in fields(TemporalRelations)}
    )
    torch.testing.assert_close(model.autoencoder.encode(alone, points[1:]), latent[1:])
