import pytest
import torch

from geneoh.errors import CheckpointError, ConfigError
from geneoh.generators.text import TextEncoder
from geneoh.generators.text2hoi.learning.training import text_record
from geneoh.generators.text2hoi.networks.autoencoders import LengthConfig, LengthNetwork
from geneoh.generators.text2hoi.networks.library import (
    SHIPPED,
    load_text2hoi,
    load_text_encoder,
    refuse_other_encoder,
    text2hoi_weights,
)
from geneoh.nn.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from geneoh.nn.weights import load_network


@pytest.fixture(scope="module")
def frames():
    """The mean of 50 lengths for a sentence, by the shipped network."""
    network = load_network(text2hoi_weights("length", None), LengthNetwork, LengthConfig)
    encoder, generator = load_text_encoder(), torch.Generator().manual_seed(0)

    def mean(sentence):
        drawn = network.sample(encoder.encode([sentence] * 50), generator=generator)
        assert 2 <= int(drawn.min()) <= int(drawn.max()) <= 150
        return float(drawn.float().mean())

    return mean


@pytest.mark.parametrize(
    ("sentence", "expected"),  # means of made actions of the verb
    [
        ("Lift a mug with the left hand.", 73),
        ("The right hand puts down a plate.", 77),
        ("A box is carried by both hands.", 143),
        ("rotate the bottle with my left hand", 98),
        ("Inspecting a toy with the right hand.", 150),
    ],
)
def test_shipped_lengths_are_those_of_the_verb(frames, sentence, expected):
    assert frames(sentence) == pytest.approx(expected, abs=12)


def with_encoder(folder, seed: int):
    """A folder with a text encoder of the shipped one's size that was trained otherwise."""
    saved = load_checkpoint(SHIPPED / "text.safetensors")
    generator = torch.Generator().manual_seed(seed)
    tensors = {
        name: tensor[:, torch.randperm(tensor.shape[1], generator=generator)]
        if tensor.ndim > 1
        else tensor
        for name, tensor in saved.tensors.items()
    }
    save_checkpoint(folder / "text.safetensors", Checkpoint(tensors, saved.record))
    return folder


def test_the_shipped_networks_are_refused_with_another_text_encoder(tmp_path):
    with pytest.raises(ConfigError, match=r"contact.safetensors: .* train it again"):
        load_text2hoi(with_encoder(tmp_path, 0))
    assert load_text2hoi().text.width == 128


def test_weights_know_the_encoder_that_they_were_trained_with(tmp_path):
    (tmp_path / "other").mkdir()
    own, other = (
        load_text_encoder(with_encoder(folder, seed))
        for seed, folder in enumerate((tmp_path, tmp_path / "other"))
    )
    path, record = tmp_path / "length.safetensors", text_record(own)
    refuse_other_encoder(path, record, 128, own)
    rounded = TextEncoder(128, lambda said: own.encode(said).bfloat16().float())
    refuse_other_encoder(path, record, 128, rounded)  # of another machine
    with pytest.raises(ConfigError, match="expected the text encoder that it was trained with"):
        refuse_other_encoder(path, record, 128, other)
    # older weights tell no vector
    refuse_other_encoder(path, {"text": record["text"]}, 128, other)
    for damaged in (["?"], [1.0], [10**400] * 128, None):
        with pytest.raises(CheckpointError, match="expected a record with the vector"):
            refuse_other_encoder(path, {"text_vector": damaged}, 128, own)


def test_what_a_folder_lacks_is_as_shipped(tmp_path):
    assert text2hoi_weights("length", tmp_path) == SHIPPED / "length.safetensors"
    (tmp_path / "length.safetensors").write_bytes(b"")
    assert text2hoi_weights("length", tmp_path) == tmp_path / "length.safetensors"


def test_a_folder_without_any_network_is_refused(tmp_path):
    with pytest.raises(CheckpointError, match="nowhere: expected weights of text, length"):
        load_text2hoi(tmp_path / "nowhere")
