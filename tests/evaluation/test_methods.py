"""Every way of cleaning, on ten frames of the example."""

from dataclasses import asdict, replace
from pathlib import Path

import pytest
import torch
import trees

from geneoh.baselines.filters import TUNED, filtered
from geneoh.errors import InputError, MissingAssetError
from geneoh.evaluation import methods
from geneoh.evaluation.external_results import stored_name
from geneoh.evaluation.methods import (
    BaselineRow,
    BestFilterRow,
    FilterRow,
    GeneohRow,
    InputRow,
    OptimisedRow,
    PredictionsRow,
    joints_of,
)
from geneoh.evaluation.scores import Bench, Judge
from geneoh.hand.library import load_hand
from geneoh.nn.checkpoint import Checkpoint, save_checkpoint
from geneoh.pipeline.denoise import Denoised, Options
from geneoh.readers.npz_files import save_sequence
from geneoh.training.config import TrainConfig
from geneoh.training.loop import build_model


def error(cleaned, case) -> float:
    return float((cleaned.joints - joints_of(case.clean)).norm(dim=-1).mean())


def test_the_input_is_scored_where_it_was_seen(noisy_case):
    hand = noisy_case.noisy.hands[0]
    valid = hand.valid.clone()
    valid[3] = False
    gappy = replace(noisy_case.noisy, hands=(replace(hand, valid=valid),))
    cleaned = InputRow().clean(replace(noisy_case, noisy=gappy))
    assert torch.equal(cleaned.valid, valid)
    assert torch.equal(cleaned.joints[valid], hand.joints[valid])


@pytest.mark.parametrize(("kind", "on"), TUNED)
def test_a_filter_row_is_its_tuned_filter(noisy_case, kind, on):
    cleaned = FilterRow(kind, on).clean(noisy_case)
    hand, fps = noisy_case.noisy.hands[0], noisy_case.noisy.fps
    assert torch.equal(cleaned.joints, filtered(hand, TUNED[kind, on], on, fps))
    assert cleaned.verts is None


def test_keypoints_alone_have_no_row_on_parameters(noisy_case):
    bare = replace(noisy_case.noisy.hands[0], pose=None, wrist=None)
    case = replace(noisy_case, noisy=replace(noisy_case.noisy, hands=(bare,)))
    assert FilterRow("savgol", "parameters").clean(case) is None
    assert FilterRow("savgol", "keypoints").clean(case) is not None
    assert BestFilterRow("parameters").clean(case) is None
    assert BestFilterRow("keypoints").clean(case) is not None


@pytest.mark.parametrize("on", ["keypoints", "parameters"])
def test_the_best_filter_beats_every_tuned_one_and_needs_the_truth(noisy_case, on):
    row = BestFilterRow(on)
    best = error(row.clean(noisy_case), noisy_case)
    tuned = [kind for kind, what in TUNED if what == on]
    assert best <= min(error(FilterRow(kind, on).clean(noisy_case), noisy_case) for kind in tuned)
    assert row.clean(replace(noisy_case, clean=None)) is None


def test_optimisation_alone_takes_noise_and_depth_away(noisy_case):
    case = noisy_case
    bench, filtering = Bench(case, Judge(close_frames=2)), FilterRow("savgol", "parameters")
    cleaned, plain = OptimisedRow().clean(case), filtering.clean(case)
    assert error(cleaned, case) < 0.8 * error(InputRow().clean(case), case)
    depths = [bench.score("row", made, 0.0).values["depth_mm"] for made in (cleaned, plain)]
    assert depths[0] < depths[1]


@pytest.mark.parametrize("name", ["toch", "regression"])
def test_a_baseline_row_answers_for_every_frame_of_a_left_hand(tmp_path, noisy_case, name):
    """With weights that were never trained the regression returns its input."""
    config = TrainConfig()
    model = build_model(name, config)
    record = {"stage": name, "config": asdict(config)}
    save_checkpoint(tmp_path / f"{name}.safetensors", Checkpoint(model.state_dict(), record))
    cleaned = BaselineRow(name, tmp_path).clean(noisy_case)
    assert cleaned.joints.shape == (10, 21, 3)
    assert cleaned.joints.isfinite().all()
    if name == "regression":
        given = joints_of(noisy_case.noisy)
        torch.testing.assert_close(cleaned.joints, given, atol=1e-4, rtol=0)


def test_our_row_cleans_by_its_options_and_the_seed_of_the_case(noisy_case):
    row = GeneohRow(Options(preset="fast", seed=5))
    cleaned = row.clean(noisy_case)
    assert error(cleaned, noisy_case) < error(InputRow().clean(noisy_case), noisy_case)
    assert torch.equal(row.clean(noisy_case).joints, cleaned.joints)
    other = row.clean(replace(noisy_case, seed=12))
    assert not torch.equal(other.joints, cleaned.joints)
    assert cleaned.verts.shape == (10, 778, 3)
    assert set(cleaned.result.hands) == {"left"}


def test_our_rows_are_called_by_preset_and_by_what_they_lack():
    assert GeneohRow(Options(preset="paper")).name == "geneoh paper"
    assert GeneohRow(Options(without=("motion",))).name == "geneoh default, w/o motion"


def test_predictions_are_read_by_clip_noise_and_seed(tmp_path, noisy_case):
    path = tmp_path / stored_name(noisy_case.clip, noisy_case.noise, noisy_case.seed)
    assert path.name == "short_gauss_11.npz"
    save_sequence(noisy_case.clean, path)
    row = PredictionsRow(tmp_path)
    assert row.name == tmp_path.name
    assert error(row.clean(noisy_case), noisy_case) == 0


def test_a_prediction_that_is_missing_or_too_short_is_told(tmp_path, noisy_case, recording):
    row = PredictionsRow(Path(tmp_path))
    with pytest.raises(MissingAssetError, match=r"short_gauss_11\.npz: expected the result"):
        row.clean(noisy_case)
    save_sequence(recording, tmp_path / "short_gauss_11.npz")
    with pytest.raises(InputError, match="expected the clip's 10 frames, got 146"):
        row.clean(noisy_case)


def test_a_left_hand_with_betas_of_the_official_file_is_scored_with_the_mesh_of_that_file(
    noisy_case, tmp_path, monkeypatch
):
    mano_dir = trees.write_mano(tmp_path / "mano")
    hand = noisy_case.noisy.hands[0]
    assert hand.side == "left"
    betas = torch.linspace(-2, 2, 10)
    shipped = load_hand("left", source="mano-as-shipped", mano_dir=mano_dir).shaped(betas)
    posed = shipped.posed(hand.pose, hand.wrist)
    track = replace(hand, joints=posed.joints, betas=betas, hand_model="mano-as-shipped")
    result = Denoised(replace(noisy_case.noisy, hands=(track,)), {}, ())
    monkeypatch.setattr(methods, "denoise", lambda *_: result)
    cleaned = GeneohRow(Options(hand="mano", mano_dir=mano_dir)).clean(noisy_case)
    torch.testing.assert_close(cleaned.verts, posed.verts, atol=1e-6, rtol=0)
