import math
from dataclasses import replace

import pytest
import torch

from geneoh.generators.text import Reading, TextConfig, TextNetwork
from geneoh.generators.text2hoi.learning.stages import generator_task
from geneoh.generators.text2hoi.learning.text_training import (
    KINDS,
    TextTask,
    TextTrainConfig,
    text_loss,
)
from geneoh.generators.text2hoi.networks.library import TextModel, load_text_encoder
from geneoh.generators.text2hoi.sentences.captions import Sentences
from geneoh.training.data import DataSource, Learned
from geneoh.training.loop import train
from geneoh.training.processes import Team

CPU = torch.device("cpu")
SMALL = TextTrainConfig(steps=2, batch=4, warmup=1, validation_batches=2)


class Said(TextNetwork):
    """A network whose vectors are given and whose heads are certain of nothing."""

    def __init__(self, vectors):
        super().__init__(TextConfig(pieces=2, piece_width=2, width=4, heads=1))
        self.given = vectors

    def forward(self, pieces):
        return self.given

    def read(self, sentence):
        return Reading(*(torch.zeros(len(sentence), n) for n in (5, 4, 3)))


def sentences(verb):
    zeros = torch.zeros(len(verb), dtype=torch.long)
    return Sentences(
        torch.ones(len(verb), 2, 1, dtype=torch.long), torch.tensor(verb), zeros, zeros
    )


def loss(vectors, verb, **settings):
    return float(text_loss(Said(vectors), sentences(verb), replace(SMALL, **settings)))


def test_heads_that_know_nothing_cost_the_logarithm_of_the_classes():
    found = loss(torch.eye(4), [0, 1], contrast=0.0, nouns=1.0)
    assert found == pytest.approx(math.log(5) + math.log(4) + math.log(3), abs=1e-5)


def test_contrast_of_phrasings_that_agree_with_their_own_only():
    alike = torch.tensor([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    rest = loss(alike, [0, 1], contrast=0.0)
    # own phrasing at cosine 1, the other meaning at 0, each over a temperature of 1
    expected = math.log(1 + math.exp(-1.0))
    assert loss(alike, [0, 1], contrast=1.0, temperature=1.0) - rest == pytest.approx(expected)


def test_contrast_does_not_push_equal_meanings_apart():
    same = torch.ones(4, 2)
    assert loss(same, [3, 3], contrast=1.0) == pytest.approx(loss(same, [3, 3], contrast=0.0))


def test_a_step_is_the_same_for_the_same_seed_and_divided_among_processes():
    task = TextTask(SMALL)
    first, again = (task.pieces(5, Team(), CPU)[0].samples for _ in range(2))
    assert torch.equal(first.pieces, again.pieces)
    assert len(first.verb) == 4
    divided = TextTask(replace(SMALL, accumulate=2)).pieces(5, Team(), CPU)
    assert [len(piece.samples.verb) for piece in divided] == [2, 2]
    assert [piece.draws.part.first for piece in divided] == [0, 2]
    assert torch.equal(torch.cat([piece.samples.pieces for piece in divided]), first.pieces)


def test_withheld_synonyms_are_only_learned_when_asked_for():
    assert TextTrainConfig().withhold
    assert len(KINDS) == TextTrainConfig().validation_batches


def test_trained_weights_are_a_whole_encoder(tmp_path):
    learned = Learned(DataSource(tmp_path), tmp_path)
    task, notes = generator_task("text", None, ["steps=2", "batch=4"], learned)
    assert notes == ()
    path = train(task, tmp_path, device=CPU)
    model = TextModel(path)
    assert model.verbs[:2] == ["lift", "put down"]
    assert model.hands == ["left hand", "right hand", "both hands", None]
    encoder = load_text_encoder(tmp_path)
    vectors = encoder.encode(["Lift a mug with the left hand.", "open"])
    assert vectors.shape == (2, encoder.width)
    torch.testing.assert_close(vectors[1], model.vectors(["open"])[0], atol=1e-5, rtol=1e-4)
