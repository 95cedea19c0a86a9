from dataclasses import replace

import torch
from made_actions import NAMES, WordEncoder, made_actions

from geneoh.generators.text2hoi.learning.samples import ActionData
from geneoh.generators.text2hoi.learning.training import LengthTask, LengthTrainConfig
from geneoh.generators.text2hoi.networks.autoencoders import LengthConfig, LengthNetwork
from geneoh.generators.text2hoi.networks.library import load_text_encoder
from geneoh.nn.weights import load_network
from geneoh.streamed import Streamed
from geneoh.synthesis.actions.action import VERBS
from geneoh.training.data import TrainingData
from geneoh.training.loop import train
from geneoh.training.processes import Team

CPU = torch.device("cpu")
TINY = LengthTrainConfig(
    steps=4,
    batch=8,
    warmup=1,
    validation_batches=1,
    checkpoint_every=1,
    length=LengthConfig(latent=2, hidden=8, text=WordEncoder.width),
)


def task(config=TINY, data=None):
    data = data or ActionData(Streamed.of([made_actions(12)]), NAMES)
    return LengthTask(config, TrainingData(data, data, {"source": "test"}), WordEncoder())


def test_batches_hold_lengths_and_sentences_of_the_same_actions():
    actions = made_actions(26)
    # the length says which verb it is, so a sentence of another action would show
    actions = replace(actions, verb=torch.arange(26) % 13, length=10 + torch.arange(26) % 13)
    (piece,) = task(data=ActionData(Streamed.of([actions]), NAMES)).pieces(0, Team(), CPU)
    assert piece.samples.text.shape == (8, WordEncoder.width)
    assert set(piece.samples.length.tolist()) <= set(range(10, 10 + len(VERBS)))
    assert piece.draws.batch == piece.draws.total


def test_a_batch_is_divided_into_shares():
    pieces = task(replace(TINY, accumulate=4)).pieces(3, Team(), CPU)
    assert [len(piece.samples.length) for piece in pieces] == [2] * 4
    assert [piece.draws.part.first for piece in pieces] == [0, 2, 4, 6]


def load(path):
    return load_network(path, LengthNetwork, LengthConfig)


def test_lengths_that_differ_by_verb_are_learned_from_sentences(tmp_path):
    actions = made_actions(40)
    lift = torch.arange(40) % 2 == 0
    verb = torch.where(lift, VERBS.index("lift"), VERBS.index("shake"))
    actions = replace(actions, verb=verb, length=torch.where(lift, 30, 120))
    config = replace(
        TINY,
        steps=100,
        batch=32,
        rate=3e-3,
        ema=0.9,
        checkpoint_every=100,
        length=LengthConfig(latent=2, hidden=32),
    )
    data, encoder = ActionData(Streamed.of([actions]), NAMES), load_text_encoder()
    learned = LengthTask(config, TrainingData(data, data, {}), encoder)
    network = load(train(learned, tmp_path, device=CPU))
    generator = torch.Generator().manual_seed(0)
    said = ["Lift a mug with the left hand.", "Shake a mug with the left hand."]
    text = encoder.encode([sentence for sentence in said for _ in range(20)])
    frames = network.sample(text, generator=generator).float().view(2, 20).mean(1)
    assert float(frames[0]) < 60 < 90 < float(frames[1])
