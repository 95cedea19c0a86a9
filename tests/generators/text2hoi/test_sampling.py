from dataclasses import replace

import pytest
import torch
from made_actions import NAMES, WordEncoder, made_actions
from made_networks import TINY, answering, in_paper_form

from geneoh.choices import DRAWS
from geneoh.config import as_dict
from geneoh.errors import CheckpointError, ConfigError
from geneoh.generators.text2hoi import sampling as module
from geneoh.generators.text2hoi.choosing import best_draws
from geneoh.generators.text2hoi.networks import library
from geneoh.generators.text2hoi.networks.autoencoders import (
    ContactNetwork,
    LengthConfig,
    LengthNetwork,
)
from geneoh.generators.text2hoi.networks.interaction import InteractionNetwork
from geneoh.generators.text2hoi.networks.library import Text2HoiNetworks, load_text2hoi
from geneoh.generators.text2hoi.networks.objects import Objects
from geneoh.generators.text2hoi.sampling import (
    UNKNOWN,
    Text2HoiSampling,
    condition_of,
    drawn_numbers,
    sample_actions,
)
from geneoh.nn.checkpoint import Checkpoint, save_checkpoint

HANDS = ["right hand", "left hand", "both hands"]
SAID = ["Lift a mug with the right hand.", "Push the drawer.", "Carry the mouse."]
LENGTHS = torch.tensor([12, 7, 2])
TOLD = WordEncoder().encode(SAID)


@pytest.fixture(scope="module")
def networks() -> Text2HoiNetworks:
    length = LengthNetwork(LengthConfig(text=WordEncoder.width)).eval()
    contact = ContactNetwork(TINY.contact).eval()
    return Text2HoiNetworks(WordEncoder(), contact, answering(TINY.interaction), length)


@pytest.fixture(scope="module")
def objects() -> Objects:
    return Objects.of(made_actions(count=3))


def sampled(networks, objects, seed=0, draws=DRAWS, **given):
    """An action for each sentence and its contact map."""
    config, generator = Text2HoiSampling(steps=4, draws=draws), torch.Generator().manual_seed(seed)
    asked = networks, objects, SAID, HANDS, LENGTHS, config
    return sample_actions(*asked, generator=generator, **given)


def drawn(networks, objects, seed=0):
    return sampled(networks, objects, seed)[0]


def test_two_seeds_make_two_clips_and_one_seed_one(networks, objects):
    first, again, other = (drawn(networks, objects, seed) for seed in (0, 0, 1))
    assert first.wrist.equal(again.wrist)
    assert first.pose.equal(again.pose)
    assert (first.translation - other.translation).abs().amax((1, 2)).min() > 1e-4


def test_a_given_contact_map_leaves_the_noise_as_it_is(networks, objects):
    actions, maps = sampled(networks, objects, draws=1)
    given, _ = sampled(networks, objects, draws=1, contact=maps)
    assert given.translation.equal(actions.translation)
    assert not sampled(networks, objects, draws=1, contact=torch.zeros_like(maps))[1].any()


def every_draw(networks, objects):
    """All four draws of each sentence with their contact maps."""
    every = torch.arange(3).repeat_interleave(4)
    return sample_actions(
        networks,
        objects.take(every, "B"),
        [SAID[clip] for clip in every],
        [HANDS[clip] for clip in every],
        LENGTHS[every],
        Text2HoiSampling(steps=4, draws=1),
        generator=torch.Generator().manual_seed(0),
    )


def test_the_best_of_several_draws_is_kept_for_each_clip(networks, objects):
    several, touched = sampled(networks, objects, draws=4)
    alone, maps = every_draw(networks, objects)
    kept = best_draws(alone, 4)
    assert several.wrist.equal(alone.wrist[kept])
    assert touched.equal(maps[kept])
    assert (maps[0] - maps[1]).abs().max() > 0
    assert (kept // 4).tolist() == [0, 1, 2]
    assert several.length.tolist() == LENGTHS.tolist()
    assert not sampled(networks, objects, draws=1)[0].wrist.equal(several.wrist)


def test_a_draw_that_passes_the_object_as_asked_is_kept(networks, objects, monkeypatch):
    asked = []

    def second_of_each(actions, givers, draws):
        asked.append(givers)
        assert draws == 4
        return torch.arange(len(actions.length)) % 4 == 1

    monkeypatch.setattr(module, "passed_by", second_of_each)
    kept, _ = sampled(networks, objects, draws=4, giver=["left", None, "right"])
    assert asked == [["left"] * 4 + [None] * 4 + ["right"] * 4]
    alone, _ = every_draw(networks, objects)
    assert kept.wrist.equal(alone.wrist[1::4])


def test_a_sample_has_the_hands_the_lengths_and_the_objects_that_were_asked_for(networks, objects):
    actions = drawn(networks, objects)
    assert actions.hands.tolist() == [[False, True], [True, False], [True, True]]
    assert actions.length.tolist() == LENGTHS.tolist()
    assert actions.joint.shape == (3, 12)
    assert actions.points.equal(objects.points)
    assert not actions.wrist[0, 0].any()
    assert not actions.pose[1, 1].any()
    assert not actions.joint[:2].any()  # rigid
    assert actions.joint[2].any()
    assert actions.translation[1, 6:].diff(dim=0).abs().max() == 0  # held after its end
    eye = torch.eye(3).expand(3, 12, 3, 3)
    torch.testing.assert_close(actions.rotation @ actions.rotation.mT, eye, atol=1e-5, rtol=0)
    assert actions.verb.tolist() == actions.name.tolist() == [UNKNOWN] * 3
    assert len(NAMES) == 3


def perfect(networks, clean):
    """The networks with one that always knows the clean numbers."""
    interaction = InteractionNetwork(TINY.interaction)
    interaction.denoised = lambda x, level, told: clean * told.shown
    return replace(networks, interaction=interaction)


@pytest.mark.parametrize("sampler", ["multistep", "ancestral"])
def test_a_network_that_knows_the_clean_numbers_is_followed(networks, objects, sampler):
    clean = torch.randn(3, 12, 208, generator=torch.Generator().manual_seed(5))
    told = condition_of(networks.interaction, objects, TOLD, HANDS, LENGTHS, torch.zeros(3, 48))
    found = drawn_numbers(
        perfect(networks, clean).interaction,
        told,
        Text2HoiSampling(sampler, 7, guidance=1.0),
        generator=torch.Generator().manual_seed(0),
    )
    torch.testing.assert_close(found[told.shown], clean[told.shown], atol=1e-4, rtol=0)


def test_the_network_is_told_the_number_of_each_level(networks, objects):
    heard = []
    interaction = InteractionNetwork(TINY.interaction)
    interaction.denoised = lambda x, level, told: (heard.append(level.unique().item()), 0 * x)[1]
    told = condition_of(networks.interaction, objects, TOLD, HANDS, LENGTHS, torch.zeros(3, 48))
    generator = torch.Generator().manual_seed(0)
    drawn_numbers(interaction, told, Text2HoiSampling(steps=4, guidance=1.0), generator=generator)
    assert heard == [992, 874, 188, 7]  # of noise 80 to 0.02, even in its logarithm
    heard.clear()
    paper = Text2HoiSampling("ancestral", steps=1000, guidance=1.0)
    drawn_numbers(interaction, told, paper, generator=generator)
    assert heard == list(range(1000, 0, -1))


def test_guidance_goes_beyond_the_answer_without_the_sentence(networks, objects):
    """Answers of 1 with a sentence and 3 without: at guidance 2 the answer is -1."""
    interaction = InteractionNetwork(TINY.interaction)
    told_of = interaction.encode
    given = {}

    def told(condition):
        found = told_of(condition)
        given[id(found)] = 1.0 if condition.text_given.all() else 3.0
        return found

    interaction.encode = told
    interaction.denoised = lambda x, level, told: torch.full_like(x, given[id(told)])
    condition = condition_of(
        networks.interaction, objects, TOLD, HANDS, LENGTHS, torch.zeros(3, 48)
    )
    for guidance, expected in ((1.0, 1.0), (2.0, -1.0), (0.0, 3.0)):
        config = Text2HoiSampling(steps=2, guidance=guidance)
        generator = torch.Generator().manual_seed(0)
        found = drawn_numbers(interaction, condition, config, generator=generator)
        torch.testing.assert_close(found, torch.full_like(found, expected))


def test_the_paper_s_form_is_told_a_contact_map_of_zeros_and_ones(networks, objects):
    paper = InteractionNetwork(in_paper_form(TINY.interaction))
    generator = torch.Generator().manual_seed(0)
    contact = networks.contact.sample(objects, TOLD, generator=generator).detach()
    for network, values in ((networks.interaction, contact), (paper, (contact > 0.5).float())):
        told = condition_of(network, objects, TOLD, HANDS, LENGTHS, contact)
        assert told.contact.equal(values)


def saved(folder, networks):
    for name in ("contact", "interaction", "length"):
        network = getattr(networks, name)
        record = {"config": {name: as_dict(network.config)}}
        save_checkpoint(folder / f"{name}.safetensors", Checkpoint(network.state_dict(), record))


def test_networks_of_a_folder_make_the_same_clips(networks, objects, tmp_path, monkeypatch):
    saved(tmp_path, networks)
    monkeypatch.setattr(library, "load_text_encoder", lambda *_: WordEncoder())
    loaded = load_text2hoi(tmp_path)
    assert loaded.interaction.config == TINY.interaction
    torch.testing.assert_close(drawn(loaded, objects).wrist, drawn(networks, objects).wrist)


def test_networks_of_another_text_encoder_are_refused(networks, tmp_path, monkeypatch):
    saved(tmp_path, networks)
    monkeypatch.setattr(WordEncoder, "width", 9)
    monkeypatch.setattr(library, "load_text_encoder", lambda *_: WordEncoder())
    with pytest.raises(ConfigError, match="expected a text encoder of 8 features, got one of 9"):
        load_text2hoi(tmp_path)


def test_damaged_weights_are_told_of(networks, objects):
    broken = InteractionNetwork(TINY.interaction)
    torch.nn.init.constant_(broken.text.bias, torch.nan)
    with pytest.raises(CheckpointError, match="damaged"):
        drawn(replace(networks, interaction=broken), objects)
