import json
import sys

import pytest
import torch

from geneoh.errors import CheckpointError, ConfigError, InputError
from geneoh.generators.text2hoi.learning.text_training import accuracy
from geneoh.generators.text2hoi.networks.library import (
    SHIPPED,
    TextEncoder,
    load_text_encoder,
    shipped_model,
)
from geneoh.nn.checkpoint import Checkpoint, load_checkpoint, save_checkpoint


def test_a_sentence_is_embedded_once_and_kept():
    asked = []

    def embed(sentences):
        asked.extend(sentences)
        return torch.tensor([[len(asked), len(sentences)]]).float()

    encoder = TextEncoder(2, embed)
    first = encoder.encode(["b", "a", "b"])
    assert first.tolist() == [[1.0, 1.0], [2.0, 1.0], [1.0, 1.0]]
    assert torch.equal(encoder.encode(["a"]), first[1:2])
    assert asked == ["b", "a"]
    assert encoder.encode([]).shape == (0, 2)


def test_a_vector_is_the_same_bit_for_bit_beside_any_sentences():
    sentences = [f"lift the {noun} with the left hand" for noun in ("mug", "big red box", "pan")]
    together = shipped_model().encoder().encode(sentences)
    for sentence, vector in zip(sentences, together, strict=True):
        assert shipped_model().encoder().encode([sentence])[0].equal(vector)


def test_only_the_latest_sentences_are_kept(monkeypatch):
    asked = []
    monkeypatch.setattr("geneoh.generators.text.KEPT", 2)
    encoder = TextEncoder(1, lambda said: asked.extend(said) or torch.ones(len(said), 1))
    assert encoder.encode(["a", "b", "c"]).shape == (3, 1)
    encoder.encode(["c", "b"])
    assert asked == ["a", "b", "c"]
    encoder.encode(["a"])
    assert asked == ["a", "b", "c", "a"]


def test_shipped_encoder_is_small_and_of_width_128():
    assert (SHIPPED / "text.safetensors").stat().st_size < 1_000_000
    encoder = load_text_encoder()
    assert encoder.width == 128
    vectors = encoder.encode(["Lift a mug with both hands.", "Pour from the kettle."])
    assert vectors.shape == (2, 128)
    assert not vectors.requires_grad


@pytest.mark.parametrize(
    ("kind", "verbs", "hands"),
    [
        ("seen words", 0.98, 0.99),
        ("unseen phrasings", 0.8, 0.97),
        ("misspellings", 0.9, 0.97),
        ("unseen synonyms", 0.9, 0.99),  # the shipped weights know them
    ],
)
def test_shipped_encoder_reads_verb_and_hands(kind, verbs, hands):
    generator = torch.Generator().manual_seed(99)
    right = accuracy(shipped_model().network, shipped_model().tokenizer, kind, generator=generator)
    assert right[0] >= verbs
    assert right[1] >= hands


def test_phrasings_of_a_meaning_are_closer_than_other_meanings():
    said = [
        "Lift a mug with the left hand.",
        "the coffee mug is picked up by my left hand",
        "Close a laptop with both hands.",
    ]
    vectors = shipped_model().vectors(said)
    own, other, wrong = torch.nn.functional.normalize(vectors, dim=-1)
    assert float(own @ other) > float(own @ wrong) + 0.3


def test_padding_by_longer_sentences_changes_no_vector():
    said = ["open", "put down the big red box slowly with both hands"]
    alone, beside = (shipped_model().vectors(each)[0] for each in (said[:1], said))
    torch.testing.assert_close(beside, alone, atol=1e-4, rtol=1e-4)


def test_weights_of_another_network_are_refused(tmp_path):
    path = tmp_path / "text.safetensors"
    save_checkpoint(path, Checkpoint({"a": torch.zeros(2)}, {"config": {"text": {}}}))
    with pytest.raises(CheckpointError, match="expected weights of this version's text network"):
        load_text_encoder(tmp_path)
    endless = {"config": {"text": {"depth": 10**9}}}  # would not end being built
    save_checkpoint(path, Checkpoint({"a": torch.zeros(2)}, endless))
    with pytest.raises(CheckpointError, match="depth must be at most 1"):
        load_text_encoder(tmp_path)
    shipped = load_checkpoint(SHIPPED / "text.safetensors")
    for missing, words in (("tokenizer", "their vocabulary"), ("classes", "the classes that")):
        record = {name: value for name, value in shipped.record.items() if name != missing}
        save_checkpoint(path, Checkpoint(shipped.tensors, record))
        with pytest.raises(CheckpointError, match=f"expected weights with {words}"):
            load_text_encoder(tmp_path)


def test_missing_folders_and_folders_without_a_model_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"found no folder; name the folder that holds"):
        load_text_encoder(tmp_path / "none")
    with pytest.raises(InputError, match=r"found a folder without config\.json"):
        load_text_encoder(tmp_path)
    (tmp_path / "config.json").write_text("{")
    with pytest.raises(InputError, match="found a damaged file"):
        load_text_encoder(tmp_path)


def test_a_foreign_folder_without_the_library_says_how_to_install_it(tmp_path, monkeypatch):
    (tmp_path / "config.json").write_text(json.dumps({"model_type": "clip"}))
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(ConfigError, match=r'pip install "geneoh\[text\]"'):
        load_text_encoder(tmp_path)


SMALL = {
    **{"vocab_size": 8, "hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1},
    **{"num_attention_heads": 2, "max_position_embeddings": 16, "pad_token_id": 0},
}
"""The size of a tiny model of the library."""


def word_tokenizer(folder):
    """The tokenizer of a tiny model, saved as the library saves it."""
    from tokenizers import Tokenizer, models, pre_tokenizers, processors
    from transformers import PreTrainedTokenizerFast

    words = ["<pad>", "<unk>", "<s>", "</s>", "lift", "open", "the", "mug"]
    tokenizer = Tokenizer(models.WordLevel({w: n for n, w in enumerate(words)}, unk_token="<unk>"))
    tokenizer.pre_tokenizer = pre_tokenizers.Whitespace()
    tokenizer.post_processor = processors.TemplateProcessing(
        single="<s> $A </s>", special_tokens=[("<s>", 2), ("</s>", 3)]
    )
    PreTrainedTokenizerFast(
        tokenizer_object=tokenizer, pad_token="<pad>", unk_token="<unk>", model_max_length=16
    ).save_pretrained(folder)


@pytest.mark.filterwarnings("ignore")  # of the library
def test_a_clip_folder_gives_unit_vectors_of_its_own_width(tmp_path):
    transformers = pytest.importorskip("transformers")
    ends = {"bos_token_id": 2, "eos_token_id": 3}
    config = transformers.CLIPTextConfig(**SMALL, projection_dim=12, **ends)
    transformers.CLIPTextModelWithProjection(config).save_pretrained(tmp_path)
    word_tokenizer(tmp_path)
    encoder = load_text_encoder(tmp_path)
    vectors = encoder.encode(["lift the mug", "open the mug", "lift"])
    assert encoder.width == 12
    assert vectors.shape == (3, 12)
    torch.testing.assert_close(vectors.norm(dim=-1), torch.ones(3))
    assert not torch.allclose(vectors[0], vectors[1], atol=1e-4)


@pytest.mark.filterwarnings("ignore")  # of the library
def test_a_sentence_transformers_folder_gives_the_mean_of_its_states(tmp_path):
    transformers = pytest.importorskip("transformers")
    transformers.BertModel(transformers.BertConfig(**SMALL)).save_pretrained(tmp_path)
    word_tokenizer(tmp_path)
    encoder = load_text_encoder(tmp_path)
    assert encoder.width == 16
    vectors = encoder.encode(["lift the mug", "open"])
    torch.testing.assert_close(vectors.norm(dim=-1), torch.ones(2))
    # padding beside a longer sentence must not count
    torch.testing.assert_close(vectors[1], load_text_encoder(tmp_path).encode(["open"])[0])


@pytest.mark.filterwarnings("ignore")  # of the library
def test_a_folder_without_weights_is_refused(tmp_path):
    pytest.importorskip("transformers")
    (tmp_path / "config.json").write_text(json.dumps({"model_type": "bert"}))
    with pytest.raises(InputError, match="expected a whole CLIP or sentence-transformers model"):
        load_text_encoder(tmp_path)
