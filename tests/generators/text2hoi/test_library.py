import pytest
import torch

from geneoh.denoisers.library import load_network
from geneoh.generators.text2hoi.length import LengthConfig, LengthNetwork
from geneoh.generators.text2hoi.library import SHIPPED, weights_of
from geneoh.generators.text2hoi.text import load_text_encoder


@pytest.fixture(scope="module")
def frames():
    """The mean of 50 lengths for a sentence, by the shipped network."""
    network = load_network(weights_of("length", None), "length", LengthNetwork, LengthConfig)
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


def test_what_a_folder_lacks_is_as_shipped(tmp_path):
    assert weights_of("length", tmp_path) == SHIPPED / "length.safetensors"
    (tmp_path / "length.safetensors").write_bytes(b"")
    assert weights_of("length", tmp_path) == tmp_path / "length.safetensors"
