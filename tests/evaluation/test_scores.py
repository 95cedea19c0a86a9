"""What is measured on one cleaned hand."""

from dataclasses import replace

import pytest
import torch

from geneoh.evaluation.cases import Case
from geneoh.evaluation.methods import Cleaned, InputRow, everywhere, joints_of
from geneoh.evaluation.scores import MEASURES, Bench, Judge, rounded
from geneoh.pipeline.denoise import Denoised

JUDGE = Judge(close_frames=3)


@pytest.fixture(scope="module")
def bench(clean_case):
    return Bench(clean_case, JUDGE)


def test_ground_truth_against_itself_has_no_error(bench, clean_case):
    score = bench.score("input", InputRow().clean(clean_case), 0.0)
    for key in ("mpjpe_mm", "mpvpe_mm", "proximity_mm", "acceleration_error_mm"):
        assert score.values[key] == 0
    for key in ("contact_iou_pct", "contact_iou_verts_pct", "tips_f_pct"):
        assert score.values[key] == 100
    assert score.error_by_frame_mm == [0] * 10
    assert score.error_by_joint_mm == [0] * 21


def test_the_recording_has_its_own_plausibility(recording):
    """Its depth and acceleration are known from the data's own notes: 2.6 mm and 8 mm."""
    case = Case("taco", "whole", "clean", 0, None, recording)
    score = Bench(case, JUDGE).score("input", InputRow().clean(case), 0.0)
    assert 1.5 < score.values["depth_mm"] < 4
    assert 7 < score.values["acceleration_mm"] < 9


def test_a_hand_moved_by_a_centimetre_is_a_centimetre_off(bench, clean_case):
    shift = torch.tensor([0.006, 0.0, 0.008])
    score = bench.score("moved", everywhere(joints_of(clean_case.clean) + shift), 1.5)
    assert score.values["mpjpe_mm"] == pytest.approx(10, abs=1e-3)
    assert score.values["mpvpe_mm"] == pytest.approx(10, abs=0.5)
    assert score.values["acceleration_error_mm"] == pytest.approx(0, abs=1e-3)
    assert score.values["contact_iou_pct"] < 60
    assert score.error_by_frame_mm == pytest.approx([10] * 10)
    assert score.seconds == 1.5


def test_frames_that_are_not_valid_count_for_nothing(bench, clean_case):
    joints = joints_of(clean_case.clean).clone()
    joints[4] += 0.05
    valid = torch.ones(10, dtype=torch.bool)
    valid[4] = False
    score = bench.score("gap", Cleaned(joints, None, valid), 0.0)
    assert score.values["mpjpe_mm"] == 0
    assert score.values["acceleration_error_mm"] == 0
    assert score.error_by_frame_mm[4] is None


def test_without_ground_truth_only_plausibility_is_measured(noisy_case):
    bench = Bench(replace(noisy_case, clean=None), JUDGE)
    score = bench.score("input", InputRow().clean(noisy_case), 0.0)
    assert score.values["depth_mm"] > 0
    assert "mpjpe_mm" not in score.values
    assert score.error_by_frame_mm == []


def test_every_measure_is_taken(bench, clean_case):
    score = bench.score("input", InputRow().clean(clean_case), 0.0)
    spread_alone = {"within_spread_pct"}
    assert set(score.values) == {measure.key for measure in MEASURES} - spread_alone
    assert all(value is not None for value in score.values.values())


@pytest.mark.parametrize(("spread", "share"), [(0.001, 0.0), (0.1, 100.0)])
def test_a_spread_is_held_against_the_error(bench, noisy_case, spread, share):
    cleaned = InputRow().clean(noisy_case)
    hand = noisy_case.noisy.hands[0]
    sure = replace(hand, joint_spread=torch.full(hand.joints.shape[:2], spread))
    result = Denoised(replace(noisy_case.noisy, hands=(sure,)), {}, ())
    off = torch.tensor([0.01, 0.0, 0.0])
    moved = replace(cleaned, joints=joints_of(noisy_case.clean) + off, result=result)
    assert bench.score("ours", moved, 0.0).values["within_spread_pct"] == share


def test_close_frames_are_spread_over_the_clip():
    assert Judge(close_frames=4).close(20).tolist() == [2, 7, 12, 17]
    assert Judge(close_frames=30).close(3).tolist() == [0, 1, 2]


def test_what_is_no_number_is_none():
    assert rounded(float("nan")) is None
    assert rounded(1.23456) == 1.23
