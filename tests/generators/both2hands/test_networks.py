"""Sizes of the paper, and what the networks see."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from made_bodies import SMALL, speech, tiny_networks

from geneoh.config import configured
from geneoh.errors import ConfigError
from geneoh.generators.both2hands.networks import (
    BlendConfig,
    Blender,
    BodyHands,
    HandsConfig,
    TextHands,
)
from geneoh.generators.both2hands.training import Both2HandsConfig

CONFIGS = Path(__file__).parents[3] / "configs"
LEVEL = torch.tensor([400.0, 900.0])


def parameters(network):
    return sum(p.numel() for p in network.parameters())


def paper(stage):
    return configured(Both2HandsConfig(), CONFIGS / f"{stage}_paper.toml")


def hands(seed, frames=20):
    return torch.randn(2, frames, 270, generator=torch.Generator().manual_seed(seed))


def test_the_paper_s_networks_have_its_sizes():
    with torch.device("meta"):
        text = replace(paper("text_hands").text_hands, text=768)
        assert parameters(BodyHands(paper("body_hands").body_hands)) == 11_039_246
        assert parameters(TextHands(text)) == 11_331_598
        assert parameters(Blender(paper("blend").blend)) == 10_789_646


def test_hands_of_a_sentence_have_no_frame_but_the_wrist_s():
    with pytest.raises(ConfigError, match=r"text_hands\.frame.*world"):
        configured(Both2HandsConfig(), settings=["text_hands.frame=world"])


def test_the_shipped_sizes_take_ten_megabytes_in_half_precision():
    config = Both2HandsConfig()
    with torch.device("meta"):
        made = (
            BodyHands(config.body_hands), TextHands(config.text_hands), Blender(config.blend)
        )  # fmt: skip
    assert 2 * sum(map(parameters, made)) < 10_000_000


@pytest.mark.parametrize("form", ["ours", "paper"])
def test_hands_depend_on_the_body(form):
    network = tiny_networks(form).body
    bodies = torch.randn(2, 20, 198, generator=torch.Generator().manual_seed(1))
    found = network.denoised(hands(0), LEVEL, network.encode(bodies))
    other = network.denoised(hands(0), LEVEL, network.encode(bodies.flip(0)))
    assert found.shape == (2, 20, 270)
    assert not torch.allclose(found, other, atol=1e-4)


@pytest.mark.parametrize("form", ["ours", "paper"])
def test_hands_depend_on_the_sentence_and_not_on_its_padding(form):
    network = tiny_networks(form).text
    said = speech(["the left hand waves", "both hands clap twice now"])
    found = network.denoised(hands(0), LEVEL, network.encode(said))
    alone = network.denoised(hands(0)[:1], LEVEL[:1], network.encode(said[:1, :4]))
    torch.testing.assert_close(found[:1], alone, atol=1e-5, rtol=1e-4)
    other = network.denoised(hands(0), LEVEL, network.encode(said.flip(0)))
    assert not torch.allclose(found, other, atol=1e-4)


def test_steps_of_hands_come_back_as_frames():
    network = BodyHands(HandsConfig(**SMALL, frames_per_token=5))
    made = hands(3)
    steps = network.steps(made)
    assert steps.shape == (2, 4, 2, 5 * 135)
    torch.testing.assert_close(network.frames_of(steps), made)
    changed = made.clone()
    changed[..., :45] += 1  # positions of the left hand
    moved = (network.steps(changed) != steps).any(-1)
    assert moved[:, :, 0].all()
    assert not moved[:, :, 1].any()


def test_before_training_our_blend_is_the_weighted_mean():
    blender = Blender(BlendConfig(**SMALL))
    one, other = hands(0, 7), hands(1, 7)
    torch.testing.assert_close(blender(one, other, LEVEL), 0.8 * one + 0.2 * other)


@pytest.mark.parametrize("form", ["ours", "paper"])
def test_every_block_of_the_blend_is_used_and_learned(form):
    torch.manual_seed(0)
    blender = Blender(BlendConfig(**SMALL | {"depth": 4, "form": form}))
    torch.nn.init.normal_(blender.leave.weight)
    blender(hands(0), hands(1), LEVEL).square().sum().backward()
    unused = [n for n, p in blender.named_parameters() if p.grad is None or not p.grad.any()]
    assert [name for name in unused if not name.endswith("key.bias")] == []


def test_blocks_of_the_blend_look_at_the_sentence_s_hands_first():
    torch.manual_seed(0)
    blender = Blender(BlendConfig(**SMALL | {"depth": 1, "form": "paper"}))
    body, text = hands(0), hands(1)
    seen = []
    blender.blocks[0].key.register_forward_hook(lambda _, inputs, __: seen.append(inputs[0]))
    blender.blocks[0].query.register_forward_hook(lambda _, inputs, __: seen.append(inputs[0]))
    blender(body, text, LEVEL)
    torch.testing.assert_close(seen[0], blender._tokens(body))
    torch.testing.assert_close(seen[1], blender._tokens(text))
