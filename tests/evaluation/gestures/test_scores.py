from dataclasses import replace

import pytest
import torch
from made_gestures import made_gestures

from geneoh.evaluation.generation.scores import repeat
from geneoh.evaluation.gestures.encoder import EncoderConfig, GestureEncoder
from geneoh.evaluation.gestures.scores import (
    MEASURES,
    SCORES,
    ScoredHands,
    range_of,
    score_hands,
    share_beyond,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.metrics.features import NORMAL_95, Interval


def scored(features: torch.Tensor, told: torch.Tensor | None = None, several: int = 0):
    count, width = features.shape
    generator = torch.Generator().manual_seed(1)
    return ScoredHands(
        features,
        features if told is None else told,
        torch.full((count,), 2.0),
        torch.full((count,), 0.25),
        torch.randn(several, 3, width, generator=generator),
    )


def drawn(count: int = 128) -> torch.Tensor:
    features = torch.randn(count, 6, generator=torch.Generator().manual_seed(0))
    return torch.nn.functional.normalize(features, dim=-1)


def test_every_measure_has_a_score():
    assert [measure.key for measure in MEASURES] == list(SCORES)


def test_sentences_that_are_their_clips_find_them_and_shuffled_ones_do_not():
    real = scored(drawn())
    wrong = scored(drawn().roll(1, 0), told=drawn())
    rows = repeat({"real": real, "wrong": wrong}, seed=0, repetitions=4, scores=SCORES)
    right, chance = rows["real"].cells, rows["wrong"].cells
    assert right["top1"].mean == 100
    assert right["mm_distance"].mean == pytest.approx(0, abs=1e-3)
    assert chance["top1"].mean < 15
    assert chance["mm_distance"].mean > 1
    assert right["fid"].mean < 0.3
    assert right["acceleration_mm"].mean == 2.0
    assert right["beyond"].mean == 25.0


def test_multimodality_is_of_answers_to_one_question_and_else_none():
    real = scored(drawn())
    several = scored(drawn(), several=4)
    rows = repeat({"a": real, "b": several}, seed=0, repetitions=2, scores=SCORES)
    assert torch.tensor(rows["a"].values["multimodality"]).isnan().all()
    assert rows["b"].cells["multimodality"].mean > 1


def test_the_interval_of_the_multimodality_is_that_over_other_bodies_and_sentences():
    generator = torch.Generator().manual_seed(2)

    def interval_of(prompts: int) -> Interval:
        sizes = 0.5 + torch.rand(prompts, 1, 1, generator=generator)
        made = scored(drawn())
        made = replace(made, several=sizes * torch.randn(prompts, 5, 6, generator=generator))
        rows = repeat({"made": made}, seed=0, repetitions=20, scores=SCORES)
        return rows["made"].cells["multimodality"]

    cells = [interval_of(16) for _ in range(8)]
    scatter = float(torch.tensor([cell.mean for cell in cells]).std())
    told = sum(cell.half for cell in cells) / (8 * NORMAL_95)
    assert 0.6 * scatter < told < 1.7 * scatter


def test_joints_beyond_the_range_of_training_are_counted():
    clips = made_gestures(3)
    limits = range_of(clips)
    assert share_beyond(limits, clips.motion, clips.before_end).max() == 0
    bent = clips.motion
    clips.pose[:, :, 22, 2] += 2.0  # one of 30 joints
    torch.testing.assert_close(
        share_beyond(limits, clips.motion, clips.before_end), torch.full((3,), 1 / 30)
    )
    assert share_beyond(limits, bent, clips.before_end).max() == 0


def test_frames_behind_the_end_of_a_clip_do_not_count():
    clips = replace(made_gestures(3), length=torch.full((3,), 12))
    model = GestureEncoder(EncoderConfig()).eval().requires_grad_(False)
    limits, told = range_of(clips), torch.zeros(3, 32)

    def measured(last: int):
        frames = torch.arange(20).clamp(max=last)
        motion = clips.motion.map(lambda x: x[:, frames], "T")
        motion.rotations[:, 12:, 30] = axis_angle_to_matrix(torch.tensor([3.0, 0.0, 0.0]))
        return score_hands(model, clips, motion, told, limits)

    rests, moves = measured(11), measured(19)
    assert torch.equal(rests.acceleration_mm, moves.acceleration_mm)
    assert rests.acceleration_mm.min() > 0
    assert moves.beyond.max() == 0
