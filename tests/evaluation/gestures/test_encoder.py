from dataclasses import replace

import pytest
import torch
from draws import seeded
from made_gestures import made_gestures

from geneoh.evaluation.gestures.encoder import (
    FRAMES_READ,
    EncoderConfig,
    EncoderTask,
    GestureEncoder,
    Seen,
)
from geneoh.evaluation.gestures.runner import shuffled
from geneoh.generators.text import SentenceConfig
from geneoh.training.loop import trained

TINY = EncoderConfig(
    steps=60, batch=8, rate=5e-3, warmup=5, ema=0.9, validate_every=60, checkpoint_every=60,
    width=16, depth=1, heads=2, features=8, hidden=0.5,
    text=SentenceConfig(pieces=60, piece_width=8, width=16, heads=2, longest=8),
)  # fmt: skip


@pytest.fixture(scope="module")
def task():
    return EncoderTask(TINY, made_gestures(24), made_gestures(24, seed=1))


@pytest.fixture(scope="module")
def model(task, tmp_path_factory):
    return trained(task, tmp_path_factory.mktemp("encoder"))


def test_frames_are_seen_from_the_first_to_the_last_before_the_end():
    clips = made_gestures(3)
    seen = Seen.of(clips)
    assert seen.body.shape == (3, FRAMES_READ, 198)
    cut = Seen.of(clips.take(slice(1, 2), "B")[: int(clips.length[1])])
    torch.testing.assert_close(seen.hands[1:2], cut.hands)


def test_where_a_body_stands_and_faces_changes_nothing():
    clips = made_gestures(2)
    pose = clips.pose.clone()
    away = replace(clips, root=clips.root + torch.tensor([3.0, 0, 1]), pose=pose)
    torch.testing.assert_close(Seen.of(away).body, Seen.of(clips).body, atol=1e-4, rtol=1e-3)


def test_true_clips_are_told_from_the_same_bodies_with_other_hands(task, model):
    """Hands bend as the sentences say; the bodies alone do not tell how."""
    clips = task.validation
    told = model.sentences(task.numbers(clips.joined[:, 0].tolist()))
    true = model.motions(Seen.of(clips))
    wrong = model.motions(Seen.moved(clips, shuffled(clips, generator=seeded())))
    assert (told * true).sum(-1).mean() > (told * wrong).sum(-1).mean() + 0.3


def test_answers_are_unit_vectors_and_the_same_every_time(task, model):
    seen = Seen.of(task.validation)
    first, again = model.motions(seen), model.motions(seen)
    assert torch.equal(first, again)
    torch.testing.assert_close(first.norm(dim=-1), torch.ones(24))


def test_token_and_temperature_are_trained_and_saved(model):
    fresh = GestureEncoder(TINY)
    kept = dict(fresh.named_parameters()) | dict(fresh.named_buffers())
    assert {"token", "cold", "mean", "std"} <= set(kept)
    assert not torch.equal(model.cold, fresh.cold)


def test_hidden_bodies_are_not_seen(task, model):
    seen = Seen.of(task.validation)
    moved = replace(seen, body=seen.body + 1.0)
    hidden = torch.ones(24, dtype=torch.bool)
    assert torch.equal(model.motions(seen, hidden), model.motions(moved, hidden))
    assert not torch.allclose(model.motions(seen), model.motions(moved), atol=1e-3)
