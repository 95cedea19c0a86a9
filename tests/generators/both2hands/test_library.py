from dataclasses import replace

import pytest
import torch
from made_bodies import SKELETON, made_motion, tiny_networks
from made_gestures import TINY, made_gestures, tiny_task

from geneoh.config import as_dict
from geneoh.errors import CheckpointError, ConfigError
from geneoh.generators.both2hands.library import load_both2hands, load_branches, reader_of
from geneoh.generators.both2hands.sampling import Both2HandsSampling, sample_hands
from geneoh.generators.both2hands.stages import sentence_vocabulary
from geneoh.nn.checkpoint import load_checkpoint, save_checkpoint
from geneoh.training.loop import train

CPU = torch.device("cpu")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Networks that were trained for a step each."""
    made, config = tmp_path_factory.mktemp("networks"), replace(TINY, steps=1)
    tokenizer = sentence_vocabulary(made_gestures(), TINY.text_hands.words.pieces)
    task = tiny_task("text_hands", config)
    reader = reader_of(tokenizer, config.text_hands)
    train(replace(task, speech=reader, tokenizer=tokenizer), made, device=CPU)
    train(tiny_task("body_hands", config), made, device=CPU)
    branches = load_branches(made)
    train(replace(tiny_task("blend", config), branches=branches), made, device=CPU)
    return made


def copied(folder, target, stage, **changes):
    for path in folder.glob("*.safetensors"):
        checkpoint = load_checkpoint(path)
        if path.stem == stage:
            checkpoint = replace(checkpoint, **changes)
        save_checkpoint(target / path.name, checkpoint)
    return target


def test_trained_networks_make_hands_of_sentences(folder):
    networks, motion = load_both2hands(folder), made_motion(frames=8)

    def made(sentence):
        generator = torch.Generator().manual_seed(0)
        config = Both2HandsSampling(steps=2)
        return sample_hands(networks, motion, SKELETON, [sentence] * 2, config, generator=generator)

    one, other = (made(f"the left hand {word}").rotations for word in ("rests", "waves"))
    assert not torch.allclose(one, other, atol=1e-4)


def test_the_vocabulary_is_that_of_the_weights(folder):
    said = load_both2hands(folder).speech(["Rests it!", "an unheard word"])
    assert said.shape[0] == 2
    assert torch.equal(said[0], load_both2hands(folder).speech(["rests it", "an unheard word"])[0])


def test_networks_of_other_data_are_not_blended_in_one_process(folder, tmp_path):
    tensors = load_checkpoint(folder / "text_hands.safetensors").tensors
    tensors["scale.middle"] += 1
    other = copied(folder, tmp_path, "text_hands", tensors=tensors)
    with pytest.raises(ConfigError, match="trained on the same data"):
        load_both2hands(other)


def test_a_blend_of_other_networks_is_refused(folder, tmp_path):
    tensors = load_checkpoint(folder / "body_hands.safetensors").tensors
    tensors["body_scale.middle"] += 1
    other = copied(folder, tmp_path, "body_hands", tensors=tensors)
    with pytest.raises(ConfigError, match=r"blend.safetensors: .* train it again"):
        load_both2hands(other)


@pytest.mark.parametrize("change", [{"tokenizer": None}, {"config": {}}])
def test_weights_without_their_vocabulary_or_size_are_refused(folder, tmp_path, change):
    record = load_checkpoint(folder / "text_hands.safetensors").record | change
    other = copied(folder, tmp_path, "text_hands", record=record)
    with pytest.raises(CheckpointError, match="train them again"):
        load_both2hands(other)


def test_networks_for_another_text_encoder_are_refused(folder, tmp_path):
    network = tiny_networks().text
    config = replace(network.config, text=5)
    record = {"config": as_dict(replace(TINY, text_hands=config))}
    fresh = type(network)(config).state_dict()
    other = copied(folder, tmp_path, "text_hands", tensors=fresh, record=record)
    with pytest.raises(ConfigError, match=r"of 5 features, .* got none"):
        load_both2hands(other)


def test_a_folder_without_any_network_is_refused(tmp_path):
    with pytest.raises(CheckpointError, match="nowhere: expected weights of body_hands,"):
        load_both2hands(tmp_path / "nowhere")
