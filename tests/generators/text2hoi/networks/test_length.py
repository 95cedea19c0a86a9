from dataclasses import replace
from pathlib import Path

import pytest
import torch
from draws import seeded

from geneoh.config import configured
from geneoh.generators.text2hoi.learning.training import LengthTrainConfig
from geneoh.generators.text2hoi.networks.autoencoders import (
    LengthConfig,
    LengthNetwork,
    length_loss,
)

PAPER = Path(__file__).parents[4] / "configs/length_paper.toml"
SMALL = LengthConfig(latent=4, hidden=16, text=3)


def network():
    torch.manual_seed(0)
    return LengthNetwork(SMALL)


def with_bias(bias):
    """A network that answers sigmoid(bias) whatever it is told."""
    model = network()
    for parameter in model.parameters():
        torch.nn.init.zeros_(parameter)
    model.decoder[2].bias.data.fill_(bias)
    return model


@pytest.mark.parametrize(("bias", "frames"), [(-50.0, 2), (50.0, 150), (0.0, 75)])
def test_frames_are_the_share_of_150_and_never_fewer_than_2(bias, frames):
    drawn = with_bias(bias).sample(torch.zeros(5, 3), generator=seeded())
    assert drawn.tolist() == [frames] * 5


def test_loss_of_a_known_answer():
    # every length is taken for 75 of 150; the latent is that of the prior, so nothing diverges
    length = torch.tensor([75, 150, 0])
    given = with_bias(0.0), length, torch.zeros(3, 3)
    found = length_loss(*given, divergence=7.0, noise=torch.zeros(3, 4))
    assert found.item() == pytest.approx((0.0 + 0.25 + 0.25) / 3)


def test_divergence_of_a_known_latent():
    model = with_bias(0.0)
    model.encoder[2].bias.data[:4] = 2.0  # a mean of 2 in four numbers, of variance 1
    given = model, torch.tensor([75]), torch.zeros(1, 3)
    found = length_loss(*given, divergence=1.0, noise=torch.zeros(1, 4))
    assert found.item() == pytest.approx(4 * 0.5 * 2.0**2)


def test_one_seed_gives_one_length_and_others_others():
    model, text = network(), torch.randn(40, 3, generator=seeded(3))
    first, again = (model.sample(text, generator=seeded(1)) for _ in range(2))
    assert torch.equal(first, again)
    assert not torch.equal(first, model.sample(text, generator=seeded(2)))


def test_learned_lengths_follow_the_sentence_and_keep_their_spread():
    model, generator = network(), seeded(5)
    adam = torch.optim.Adam(model.parameters(), 3e-3)
    middle = torch.tensor([45.0, 105.0])
    for _ in range(900):
        which = torch.randint(2, (64,), generator=generator)
        text = torch.nn.functional.one_hot(which, 3).float()
        length = (middle[which] + 12 * torch.randn(64, generator=generator)).round().long()
        noise = torch.randn(64, 4, generator=generator)
        adam.zero_grad()
        length_loss(model, length, text, divergence=1e-3, noise=noise).backward()
        adam.step()
    told = torch.eye(3)[:2].repeat_interleave(400, 0)
    drawn = model.sample(told, generator=generator).float().view(2, 400)
    assert drawn.mean(1).tolist() == pytest.approx(middle.tolist(), abs=7)
    assert all(5 < spread < 20 for spread in drawn.std(1).tolist())


def test_the_paper_s_configuration_has_the_paper_s_sizes():
    config = configured(LengthTrainConfig(), PAPER).length
    made = LengthNetwork(replace(config, text=512))  # of CLIP
    sizes = [tuple(each.shape) for each in made.parameters() if each.ndim == 2]
    assert sizes == [(512, 513), (128, 512), (512, 576), (1, 512)]
