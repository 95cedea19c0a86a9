from dataclasses import replace

import numpy as np
import pytest
import torch
from made_bodies import speech, tiny_networks
from made_gestures import TINY, made_gestures, tiny_task

from geneoh.errors import CheckpointError
from geneoh.generators.both2hands.stages import sentence_vocabulary
from geneoh.generators.both2hands.training import blended_answers, hands_loss, naming_loss
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.synthesis.draws import Draws, Part
from geneoh.training.loop import train
from geneoh.training.processes import Team

CPU = torch.device("cpu")
WHOLE = Part(0, TINY.batch, TINY.batch)


@pytest.mark.parametrize("stage", ["body_hands", "text_hands"])
def test_the_scale_of_the_data_lies_in_the_weights(tmp_path, stage):
    task = tiny_task(stage, replace(TINY, steps=1))
    saved = load_checkpoint(train(task, tmp_path, device=CPU)).tensors
    scale = task.network().scale
    torch.testing.assert_close(saved["scale.middle"], scale.middle, atol=1e-3, rtol=1e-3)
    assert saved["scale.size"].max() < 1
    assert saved["scale.size"].min() > 0


def test_the_sentence_counts_in_the_loss_of_the_blend():
    task = tiny_task("blend")
    ((samples, draws),) = task.drawn(True, WHOLE, 1, "step", 0)
    state = draws.generator.get_state()

    def loss(said):
        draws = Draws(WHOLE.count, torch.Generator().set_state(state))
        other = replace(samples, sentence=said)
        found, clean = blended_answers(task.network(), task.branches, other, TINY, draws)
        return hands_loss(found, clean, samples.real, TINY)

    assert (loss(samples.sentence) - loss(speech(["other words"] * 4))).abs() > 1e-5


def test_a_clip_is_learned_with_a_sentence_of_its_own():
    task, heard = tiny_task("blend"), []

    def listen(sentences):
        heard.extend(sentences)
        return speech(sentences)

    ((samples, _),) = replace(task, speech=listen).drawn(True, WHOLE, 1, "step", 0)
    rests = samples.scene.motion.rotations[:, 0, 22:37].flatten(1)
    for row, sentence in enumerate(heard):
        own = [n for n, said in enumerate(task.data.training.joined) if sentence in said]
        true = task.data.training.motion.rotations[own, 0, 22:37].flatten(1)
        assert (true - rests[row]).abs().amax(1).min() < 1e-6


def test_the_paper_s_target_is_the_weighted_mean_of_both_answers():
    config = replace(TINY, target="mean")
    task = tiny_task("blend", config)
    ((samples, draws),) = task.drawn(True, WHOLE, 1, "step", 0)
    found, target = blended_answers(task.network(), task.branches, samples, config, draws)
    torch.testing.assert_close(found, target)  # ours begins with that mean


def test_what_hands_do_is_learned_out_of_sentences_where_it_is_known():
    task, network = tiny_task("text_hands"), tiny_networks().text.requires_grad_(True)
    ((samples, _),) = task.drawn(True, WHOLE, 1, "step", 0)
    chance = torch.tensor(float(network.config.gestures)).log()
    assert (naming_loss(network, samples) - chance).abs() < 1
    naming_loss(network, samples).backward()
    assert network.words.pieces.weight.grad.any()
    unknown = replace(samples, gesture=samples.gesture - 1)
    assert naming_loss(network, unknown) == 0


def test_frames_after_the_end_of_a_clip_do_not_count():
    found, clean = torch.zeros(1, 4, 270), torch.zeros(1, 4, 270)
    clean[:, 2:] = 9.0
    real = torch.tensor([[True, True, False, False]])
    for error in ("squared", "absolute"):
        assert hands_loss(found, clean, real, replace(TINY, error=error)) == 0
    still = replace(TINY, velocity=0.0)
    assert hands_loss(found, clean, real.flip(1), still) == 81.0


def test_pieces_of_a_batch_have_the_loss_of_the_whole():
    whole = tiny_task("body_hands").pieces(0, Team(), CPU)
    divided = tiny_task("body_hands", replace(TINY, accumulate=2)).pieces(0, Team(), CPU)
    model = tiny_networks().body
    total = sum(piece.loss(model) for piece in divided)
    torch.testing.assert_close(total, whole[0].loss(model), rtol=0.1, atol=0)


def test_a_blend_of_other_networks_is_not_continued(tmp_path):
    train(tiny_task("blend", replace(TINY, steps=1)), tmp_path, device=CPU)
    other = tiny_task("blend", replace(TINY, steps=2), tiny_networks(seed=5))
    with pytest.raises(CheckpointError, match="networks that are blended"):
        train(other, tmp_path, device=CPU)


def told_otherwise(task, steps: int):
    """The task with other words for the same clips and a vocabulary of them, for more steps."""
    words = np.char.replace(task.data.training.joined, "hand", "palm")
    clips, config = replace(task.data.training, joined=words), replace(task.config, steps=steps)
    data = replace(task.data, training=clips)
    return replace(task, config=config, data=data, tokenizer=sentence_vocabulary(clips, 40))


@pytest.mark.parametrize(
    ("name", "words"), [("data", "words of the data"), ("tokenizer", "vocabulary")]
)
def test_a_run_that_was_told_other_words_is_not_continued(tmp_path, name, words):
    task = tiny_task("text_hands", replace(TINY, steps=1))
    task = replace(task, tokenizer=sentence_vocabulary(task.data.training, 40))
    train(task, tmp_path, device=CPU)
    other = told_otherwise(task, 2)
    other = replace(task, config=other.config, **{name: getattr(other, name)})
    with pytest.raises(CheckpointError, match=rf"the saved run has {words} .{{40,99}};"):
        train(other, tmp_path, device=CPU)


def test_made_clips_have_the_fields_of_the_engine():
    clips = made_gestures()
    assert clips.motion.rotations.shape == (6, 20, 52, 3, 3)
    assert clips.take(slice(2), "B").joined.shape == (2, 2)
