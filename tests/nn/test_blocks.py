import pytest
import torch
from draws import normal
from hypothesis import given
from hypothesis import strategies as st
from torch import nn

from geneoh.nn.blocks import FrameTransformer, fourier, mlp, rotary, sinusoid, zeroed


def trunk(width: int = 16, depth: int = 2) -> FrameTransformer:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        made = FrameTransformer(width, depth, heads=2)
        for block in made.blocks:  # zero at the start, so they would hide what they do
            nn.init.normal_(block.gain.weight, std=0.2)
    return made.eval().requires_grad_(False)


@given(st.integers(0, 50), st.integers(0, 9), st.integers(0, 9))
def test_rotary_products_depend_on_the_distance_of_frames_only(shift, i, j):
    query, key = normal(2, 1, 1, 1, 8)
    q, k = (rotary(x.expand(1, 1, 60, 8))[0, 0] for x in (query, key))
    torch.testing.assert_close(q[i + shift] @ k[j + shift], q[i] @ k[j], rtol=1e-4, atol=1e-4)


def test_rotary_turns_and_leaves_lengths_and_the_first_frame_alone():
    x = normal(2, 3, 7, 8)
    turned = rotary(x)
    torch.testing.assert_close(turned.norm(dim=-1), x.norm(dim=-1))
    assert torch.equal(turned[:, :, 0], x[:, :, 0])


def test_the_transformer_knows_the_order_of_frames():
    model, tokens, level = trunk(), normal(1, 6, 16), torch.zeros(1)
    forward, back = model(tokens, level), model(tokens.flip(1), level).flip(1)
    assert float((forward - back).abs().max()) > 1e-3


def test_two_clips_of_a_batch_do_not_see_each_other():
    model, tokens, level = trunk(), normal(3, 6, 16), torch.tensor([-1.0, 0.0, 0.5])
    whole = model(tokens, level)
    for i in range(3):
        torch.testing.assert_close(model(tokens[i : i + 1], level[i : i + 1]), whole[i : i + 1])


def test_the_noise_level_changes_what_the_transformer_says():
    model, tokens = trunk(), normal(1, 4, 16)
    low, high = (model(tokens, torch.tensor([x])) for x in (-1.0, 0.5))
    assert float((low - high).abs().max()) > 1e-2


@pytest.mark.parametrize("frames", [1, 2, 61])
def test_any_number_of_frames_goes_through(frames):
    assert trunk()(normal(2, frames, 16), torch.zeros(2)).shape == (2, frames, 16)


def test_an_mlp_has_its_widths_and_ends_in_a_linear_layer():
    layers = mlp(3, 5, 7)
    assert [type(layer) for layer in layers] == [nn.Linear, nn.SiLU, nn.Linear]
    assert layers(normal(2, 3)).shape == (2, 7)


def test_a_zeroed_layer_adds_nothing_and_can_learn():
    layer = zeroed(nn.Linear(4, 3))
    out = layer(normal(2, 4))
    assert not bool(out.any())
    out.sum().backward()
    assert bool(layer.weight.grad.any())


def test_levels_are_embedded_on_circles_and_told_apart():
    level = torch.linspace(-1.5, 1.0, 200)
    embedded = fourier(level, 16)
    sine, cosine = embedded.chunk(2, dim=-1)
    torch.testing.assert_close(sine**2 + cosine**2, torch.ones(200, 8))
    apart = torch.cdist(embedded, embedded) + torch.eye(200)
    assert float(apart.min()) > 0.01


@pytest.mark.parametrize("width", [1, 3, 8])
def test_places_have_as_many_numbers_as_are_asked_for(width):
    place = torch.arange(4.0)
    assert sinusoid(place, width).shape == (4, width)
    torch.testing.assert_close(sinusoid(place, width)[:, 0], place.sin())


def test_sinusoids_are_sines_and_cosines_in_turn():
    found = sinusoid(torch.tensor([0.0, 3.0]), 4)
    three = torch.tensor(3.0)
    expected = [three.sin(), three.cos(), (three / 100).sin(), (three / 100).cos()]
    torch.testing.assert_close(found[1], torch.stack(expected))
    assert found[0].tolist() == [0, 1, 0, 1]
