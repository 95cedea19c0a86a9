"""That the bodies and the hands of made clips belong together."""

import pytest
import torch

from geneoh.evaluation.gestures.encoder import EncoderConfig, EncoderTask, Seen
from geneoh.evaluation.gestures.runner import shuffled
from geneoh.generators.text import SentenceConfig
from geneoh.synthesis.gestures.repertoire import GestureShares
from geneoh.synthesis.gestures.synthesis import BodyConfig, gesturing
from geneoh.training.loop import trained

GESTURES = ("wave", "show one", "show five", "raise fist", "clap", "type", "box")


def made(variants: range, bodies: range, seed: int):
    """Short clips, without rest of both hands."""
    config = BodyConfig(shares=GestureShares(idle=0.0, together=0.5, both=0.0))
    named = [(name, variant) for name in GESTURES for variant in variants]
    generator = torch.Generator().manual_seed(seed)
    return gesturing(named, list(bodies), 60, config, generator=generator)


@pytest.mark.slow
def test_the_encoder_tells_true_hands_from_those_of_other_clips_in_ways_it_never_saw(tmp_path):
    config = EncoderConfig(
        steps=90, batch=16, rate=3e-3, warmup=5, ema=0.9, validate_every=90, checkpoint_every=90,
        width=32, depth=1, heads=2, features=16,
        text=SentenceConfig(pieces=300, piece_width=16, width=32, heads=2),
    )  # fmt: skip
    task = EncoderTask(config, made(range(8), range(48), 0), made(range(8, 10), range(360, 384), 1))
    model, clips = trained(task, tmp_path), task.validation
    generator = torch.Generator().manual_seed(2)
    with_sentences = model.sentences(task.numbers(clips.joined[:, 0].tolist()))
    true = model.motions(Seen.of(clips))
    wrong = model.motions(Seen.moved(clips, shuffled(clips, generator=generator)))
    nearer = (with_sentences * true).sum(-1) > (with_sentences * wrong).sum(-1)
    assert nearer.float().mean() >= 0.75  # a seventh of the wrong hands make the same gesture
