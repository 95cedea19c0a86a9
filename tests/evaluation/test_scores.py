"""What is measured on one cleaned hand."""

from dataclasses import replace

import pytest
import torch

from geneoh.evaluation.cases import Case
from geneoh.evaluation.methods import CleanedHand, joints_of, unchanged
from geneoh.evaluation.options import EvaluationOptions, ProtocolOptions
from geneoh.evaluation.protocols.clips import Clip
from geneoh.evaluation.scores import MEASURES, CaseScorer, rounded
from geneoh.pipeline.results import Denoised

OPTIONS = EvaluationOptions("taco", close_frames=3)


@pytest.fixture(scope="module")
def scorer(clean_case):
    return CaseScorer(clean_case, OPTIONS)


def test_ground_truth_against_itself_has_no_error(scorer, clean_case):
    score = scorer.score("input", unchanged(clean_case), 0.0)
    for key in ("mpjpe_mm", "mpvpe_mm", "proximity_mm", "acceleration_error_mm"):
        assert score.values[key] == 0
    for key in ("contact_iou_pct", "contact_iou_verts_pct", "tips_f_pct"):
        assert score.values[key] == 100
    assert score.error_by_frame_mm == [0] * 10
    assert score.error_by_joint_mm == [0] * 21


def test_the_recording_has_its_own_plausibility(recording):
    """Its depth and acceleration are known from the data's own notes: 2.6 mm and 8 mm."""
    case = Case("taco", Clip("whole", lambda: recording), "recorded", 0)
    score = CaseScorer(case, OPTIONS).score("input", unchanged(case), 0.0)
    assert 1.5 < score.values["depth_mm"] < 4
    assert 7 < score.values["acceleration_mm"] < 9


def test_a_hand_moved_by_a_centimetre_is_a_centimetre_off(scorer, clean_case):
    shift = torch.tensor([0.006, 0.0, 0.008])
    score = scorer.score("moved", CleanedHand(joints_of(clean_case.clean) + shift), 1.5)
    assert score.values["mpjpe_mm"] == pytest.approx(10, abs=1e-3)
    assert score.values["mpvpe_mm"] == pytest.approx(10, abs=0.5)
    assert score.values["acceleration_error_mm"] == pytest.approx(0, abs=1e-3)
    assert score.values["contact_iou_pct"] < 60
    assert score.error_by_frame_mm == pytest.approx([10] * 10)
    assert score.seconds == 1.5


def test_without_ground_truth_only_plausibility_is_measured(noisy_case):
    scorer = CaseScorer(replace(noisy_case, noise="recorded"), OPTIONS)
    score = scorer.score("input", unchanged(noisy_case), 0.0)
    assert score.values["depth_mm"] > 0
    assert "mpjpe_mm" not in score.values
    assert score.error_by_frame_mm == []


def test_noise_on_the_object_is_in_no_score_of_a_recording_without_ground_truth(clean_case):
    """The hand and the true poses are the same, so its depth and slip are."""
    depths = []
    for noise in (None, "shaky_10"):
        protocol = ProtocolOptions(object_noise=noise)
        case = replace(clean_case, noise="recorded", protocol=protocol)
        score = CaseScorer(case, OPTIONS).score("input", unchanged(case), 0.0)
        depths.append([score.values[key] for key in ("depth_mm", "slip_mm_s", "volume_cm3")])
    assert depths[0] == depths[1]


def test_every_measure_is_taken(scorer, clean_case):
    score = scorer.score("input", unchanged(clean_case), 0.0)
    spread_alone = {"within_spread_pct"}
    assert set(score.values) == {measure.key for measure in MEASURES} - spread_alone
    assert all(value is not None for value in score.values.values())


@pytest.mark.parametrize(("spread", "share"), [(0.001, 0.0), (0.1, 100.0)])
def test_a_spread_is_held_against_the_error(scorer, noisy_case, spread, share):
    cleaned = unchanged(noisy_case)
    hand = noisy_case.noisy.hands[0]
    sure = replace(hand, joint_spread=torch.full(hand.joints.shape[:2], spread))
    result = Denoised(replace(noisy_case.noisy, hands=(sure,)), {}, ())
    off = torch.tensor([0.01, 0.0, 0.0])
    moved = replace(cleaned, joints=joints_of(noisy_case.clean) + off, result=result)
    assert scorer.score("ours", moved, 0.0).values["within_spread_pct"] == share


def test_what_is_no_number_is_none():
    assert rounded(float("nan")) is None
    assert rounded(1.23456) == 1.23
