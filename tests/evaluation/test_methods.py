"""Every way of cleaning, on ten frames of the example."""

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
import trees

from geneoh.baselines.filters import TUNED, filtered
from geneoh.baselines.networks import SHIPPED, baseline_weights
from geneoh.errors import CheckpointError, ConfigError, InputError, MissingAssetError
from geneoh.evaluation.cases import Case
from geneoh.evaluation.methods import (
    CleanedHand,
    best_filtered_hand,
    best_offset_hand,
    centroid_hand,
    denoised_hand,
    filtered_hand,
    geneoh_method,
    joints_of,
    methods_of,
    optimised_hand,
    predicted_hand,
    stored_hand,
    unchanged,
)
from geneoh.evaluation.options import EvaluationOptions
from geneoh.evaluation.protocols.clips import Clip
from geneoh.evaluation.scores import CaseScorer
from geneoh.hand.library import load_hand
from geneoh.nn.checkpoint import Checkpoint, save_checkpoint
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.readers.npz.files import save_sequence
from geneoh.training.config import TrainConfig
from geneoh.training.stages import build_model

ALL = EvaluationOptions("synthetic")
TRUTHFUL = ("best-filter", "best-offset")
OURS = ("one-call", "geneoh")


def error(cleaned, case) -> float:
    return float((cleaned.joints - joints_of(case.clean)).norm(dim=-1).mean())


def changed(case: Case, **changes) -> Case:
    """The case's noisy hand with other fields, as a recording with real noise."""
    hand = replace(case.noisy.hands[0], **changes)
    sequence = replace(case.noisy, hands=(hand,))
    return replace(case, clip=Clip("changed", lambda: sequence), noise="recorded")


def without_frame(case: Case, frame: int) -> torch.Tensor:
    """(T,) the frames in which the case's noisy hand is seen, but for one."""
    valid = case.noisy.hands[0].valid.clone()
    valid[frame] = False
    return valid


def test_a_frame_that_the_input_lacks_is_scored_between_its_neighbours(noisy_case):
    case = changed(noisy_case, valid=without_frame(noisy_case, 3))
    cleaned, given = unchanged(case), noisy_case.noisy.hands[0].joints
    torch.testing.assert_close(cleaned.joints[3], (given[2] + given[4]) / 2)
    assert torch.equal(cleaned.joints[4:], given[4:])
    score = CaseScorer(replace(case, noise="clean"), ALL).score
    assert None not in score("input", cleaned, 0.0).error_by_frame_mm


@pytest.mark.parametrize(("kind", "domain"), TUNED)
def test_a_filter_has_its_tuned_size(noisy_case, kind, domain):
    cleaned = filtered_hand(noisy_case, kind, domain)
    hand, fps = noisy_case.noisy.hands[0], noisy_case.noisy.fps
    assert torch.equal(cleaned.joints, filtered(hand, TUNED[kind, domain], domain, fps))
    assert cleaned.verts is None


def test_keypoints_alone_have_no_parameters_to_filter(noisy_case, short):
    bare = replace(short, hands=(replace(short.hands[0], pose=None, wrist=None),))
    case = replace(noisy_case, clip=Clip("bare", lambda: bare))
    for clean in (partial(filtered_hand, kind="savgol"), best_filtered_hand):
        assert clean(case, domain="keypoints").joints.isfinite().all()
        with pytest.raises(InputError, match="need a pose"):
            clean(case, domain="parameters")


@pytest.mark.parametrize("domain", ["keypoints", "parameters"])
def test_the_best_filter_beats_every_tuned_one_and_needs_the_truth(noisy_case, domain):
    best = error(best_filtered_hand(noisy_case, domain), noisy_case)
    tuned = [filtered_hand(noisy_case, kind, what) for kind, what in TUNED if what == domain]
    assert best <= min(error(each, noisy_case) for each in tuned)
    with pytest.raises(InputError, match="ground truth, which clips with noise recorded"):
        best_filtered_hand(replace(noisy_case, noise="recorded"), domain)


@pytest.mark.parametrize("noise", ["gauss", "burst", "bias"])
def test_no_filter_with_any_offset_is_nearer_than_the_best_of_both(noisy_case, noise):
    case = replace(noisy_case, noise=noise)
    best = error(best_offset_hand(case), case)
    for domain in ("keypoints", "parameters"):
        filtered = best_filtered_hand(case, domain).joints
        middle = (joints_of(case.clean) - filtered).mean((0, 1))
        for offset in (torch.zeros(3), middle, *(0.001 * torch.eye(3)), *(-0.001 * torch.eye(3))):
            assert best <= error(CleanedHand(filtered + offset), case) + 1e-9
    with pytest.raises(InputError, match="ground truth"):
        best_offset_hand(replace(noisy_case, noise="recorded"))


def test_the_middle_of_the_hand_is_smoothed_and_its_shape_is_kept(noisy_case):
    given, made = joints_of(noisy_case.noisy), centroid_hand(noisy_case).joints
    shapes = [joints - joints.mean(1, keepdim=True) for joints in (made, given)]
    torch.testing.assert_close(*shapes)
    rough = [joints.mean(1).diff(n=2, dim=0).norm(dim=-1).mean() for joints in (made, given)]
    assert rough[0] < 0.2 * rough[1]


def test_optimisation_alone_takes_noise_and_depth_away(noisy_case):
    case = noisy_case
    scorer = CaseScorer(case, ALL)
    cleaned, plain = optimised_hand(case), filtered_hand(case, "savgol", "parameters")
    assert error(cleaned, case) < 0.8 * error(unchanged(case), case)
    depths = [scorer.score("method", made, 0.0).values["depth_mm"] for made in (cleaned, plain)]
    assert depths[0] < depths[1]


@pytest.mark.parametrize("name", ["toch", "regression"])
def test_a_baseline_predicts_every_frame_of_a_left_hand(tmp_path, noisy_case, name):
    """With weights that were never trained the regression returns its input."""
    config = TrainConfig()
    model = build_model(name, config)
    record = {"stage": name, "config": asdict(config)}
    save_checkpoint(tmp_path / f"{name}.safetensors", Checkpoint(model.state_dict(), record))
    cleaned = predicted_hand(noisy_case, name, tmp_path)
    assert cleaned.joints.shape == (10, 21, 3)
    assert cleaned.joints.isfinite().all()
    if name == "regression":
        given = joints_of(noisy_case.noisy)
        torch.testing.assert_close(cleaned.joints, given, atol=1e-4, rtol=0)


def test_weights_that_were_trained_on_are_read_again(tmp_path, noisy_case):
    record = {"stage": "toch", "config": asdict(TrainConfig())}
    weights = build_model("toch", TrainConfig()).state_dict()
    found = []
    for factor in (1.0, 2.0):
        scaled = {name: factor * tensor for name, tensor in weights.items()}
        save_checkpoint(tmp_path / "toch.safetensors", Checkpoint(scaled, record))
        found.append(predicted_hand(noisy_case, "toch", tmp_path).joints)
    assert not torch.equal(*found)


def test_geneoh_cleans_by_its_options_and_the_seed_of_the_case(noisy_case):
    options = Options(preset="fast", seed=5)
    cleaned = denoised_hand(noisy_case, options)
    assert error(cleaned, noisy_case) < error(unchanged(noisy_case), noisy_case)
    assert torch.equal(denoised_hand(noisy_case, options).joints, cleaned.joints)
    other = denoised_hand(replace(noisy_case, seed=12), options)
    assert not torch.equal(other.joints, cleaned.joints)
    assert cleaned.verts.shape == (10, 778, 3)
    assert set(cleaned.result.hands) == {"left"}


def test_geneoh_cleans_as_the_command_does(noisy_case):
    options = Options(preset="fast", hand_delay=2.0)
    found = denoised_hand(noisy_case, options)
    whole = denoise(noisy_case.noisy, replace(options, seed=noisy_case.seed))
    assert found.joints.equal(whole.sequence.hands[0].joints)


def test_geneoh_is_called_by_preset_and_by_what_it_lacks():
    assert geneoh_method(Options(preset="paper")).name == "geneoh paper"
    assert geneoh_method(Options(without=("motion",))).name == "geneoh default, w/o motion"


@pytest.fixture(scope="module")
def as_shipped(short, tmp_path_factory):
    """A left hand with betas of the official left file, whose shapes differ from the mended."""
    mano_dir = trees.write_mano(tmp_path_factory.mktemp("mano"))
    model = load_hand("left", source="mano-as-shipped", mano_dir=mano_dir)
    betas = torch.linspace(-3, 3, 10)
    hand = short.hands[0]
    posed = model.shaped(betas).posed(hand.pose, hand.wrist)
    names = {"betas": betas, "hand_model": "mano-as-shipped", "joints": posed.joints}
    sequence = replace(short, hands=(replace(hand, **names),))
    return Case("taco", Clip("as-shipped", lambda: sequence), "clean", 11), mano_dir, posed.verts


def test_a_left_hand_is_posed_with_the_model_that_its_betas_belong_to(as_shipped):
    """The mended left model gives other bones for the same betas."""
    case, mano_dir, _ = as_shipped
    cleaned = denoised_hand(case, Options(preset="fast", hand="mano", mano_dir=mano_dir))
    hand = cleaned.result.sequence.hands[0]
    assert hand.hand_model == "mano-as-shipped"
    model = load_hand("left", source="mano-as-shipped", mano_dir=mano_dir)
    own = model.shaped(hand.betas).posed(hand.pose, hand.wrist)
    torch.testing.assert_close(cleaned.verts, own.verts, atol=1e-6, rtol=0)
    torch.testing.assert_close(cleaned.joints, own.joints, atol=1e-4, rtol=0)
    mended = load_hand("left", source="mano", mano_dir=mano_dir)
    other = mended.shaped(hand.betas).posed(hand.pose, hand.wrist).verts
    assert (cleaned.verts - other).norm(dim=-1).max() > 1e-3


def test_the_truth_is_measured_with_the_model_that_its_betas_belong_to(as_shipped):
    case, mano_dir, verts = as_shipped
    scorer = CaseScorer(case, replace(ALL, cleaner=Options(hand="mano", mano_dir=mano_dir)))
    torch.testing.assert_close(scorer.truth.verts, verts, atol=1e-5, rtol=0)


def test_predictions_are_read_by_clip_noise_and_seed(tmp_path, noisy_case):
    assert noisy_case.file_name == "short_gauss_11.npz"
    save_sequence(noisy_case.clean, tmp_path / noisy_case.file_name)
    (method,) = methods_of(replace(ALL, methods=("input",), predictions=(tmp_path,)))[0][1:]
    assert method.name == tmp_path.name
    assert error(method.clean(noisy_case), noisy_case) == 0


def test_a_prediction_that_is_missing_or_of_other_length_is_told(tmp_path, noisy_case, recording):
    with pytest.raises(MissingAssetError, match=r"short_gauss_11\.npz: expected the result"):
        stored_hand(noisy_case, tmp_path)
    save_sequence(recording, tmp_path / "short_gauss_11.npz")
    with pytest.raises(InputError, match="expected the clip's 10 frames, got 146"):
        stored_hand(noisy_case, tmp_path)


def test_a_prediction_without_a_frame_that_the_input_has_is_refused(tmp_path, noisy_case):
    case = changed(noisy_case, valid=without_frame(noisy_case, 7))
    path = tmp_path / case.file_name
    save_sequence(case.noisy, path)
    assert stored_hand(case, tmp_path).joints.isfinite().all()
    save_sequence(changed(noisy_case, valid=without_frame(noisy_case, 3)).noisy, path)
    with pytest.raises(InputError, match="which the input was observed, got none in 1 of them"):
        stored_hand(case, tmp_path)


def test_a_prediction_needs_nothing_of_the_object(tmp_path, noisy_case):
    hand = noisy_case.clean.hands[0]
    np.savez(tmp_path / noisy_case.file_name, joints=hand.joints.numpy(), side="left", fps=30.0)
    assert error(stored_hand(noisy_case, tmp_path), noisy_case) == 0
    assert noisy_case.read_stored(tmp_path / noisy_case.file_name).object.is_known


def test_a_prediction_without_a_rate_has_that_of_the_clip(tmp_path, noisy_case):
    slow = replace(noisy_case.clean, fps=15.0)
    case = replace(noisy_case, clip=Clip("short", lambda: slow))
    np.savez(tmp_path / case.file_name, joints=slow.hands[0].joints.numpy(), side="left")
    assert case.read_stored(tmp_path / case.file_name).fps == 15.0


def test_a_prediction_that_cannot_be_read_names_no_option_of_other_commands(tmp_path, noisy_case):
    path, joints = tmp_path / noisy_case.file_name, noisy_case.clean.hands[0].joints.numpy()
    own = {"format": "geneoh-sequence", "version": 1, "fps": 30.0, "right_joints": joints}
    for fields in (own, {"joints": np.repeat(joints, 2, 1)[:, :25], "side": "left"}):
        np.savez(path, **fields)
        with pytest.raises(InputError, match="store the clip's left hand as a sequence") as told:
            stored_hand(noisy_case, tmp_path)
        assert "--" not in str(told.value)


def test_a_prediction_of_parameters_is_posed_by_the_users_mano(tmp_path, as_shipped, caplog):
    case, mano_dir, _ = as_shipped
    hand = case.clean.hands[0]
    alone = replace(case.clean, hands=(replace(hand, joints=None),))
    save_sequence(alone, tmp_path / case.file_name)
    assert error(stored_hand(case, tmp_path), case) > 1e-3
    assert "the mean hand is used; --mano takes betas of MANO" in caplog.text
    told = replace(case, protocol=replace(case.protocol, mano_dir=mano_dir))
    assert error(stored_hand(told, tmp_path), case) < 1e-6


@pytest.mark.parametrize("domain", ["keypoints", "parameters"])
def test_a_stored_input_of_parameters_alone_can_be_filtered(tmp_path, noisy_case, domain):
    hand = noisy_case.noisy.hands[0]
    alone = replace(noisy_case.noisy, hands=(replace(hand, joints=None),))
    save_sequence(alone, tmp_path / noisy_case.file_name)
    case = replace(noisy_case, stored=tmp_path)
    assert error(filtered_hand(case, "savgol", domain), case) < error(unchanged(case), case)


def test_motion_diff_in_one_call_is_a_method_of_its_own(noisy_case):
    (method,), _ = methods_of(replace(ALL, methods=("one-call",)))
    options = method.clean.keywords["options"]
    assert options.without == ("diffusion", "spatial", "temporal", "fit")
    assert error(method.clean(noisy_case), noisy_case) < error(unchanged(noisy_case), noisy_case)


def test_motion_diff_in_one_call_is_the_same_beside_every_preset():
    """Its name has no preset, and the settings that identify a run have none either."""
    asked = replace(ALL, methods=("one-call",))
    others = replace(asked, presets=("paper",), cleaner=Options(preset="paper"))
    (method,), (other,) = methods_of(asked)[0], methods_of(others)[0]
    assert other.name == method.name
    assert other.clean.keywords == method.clean.keywords


def test_recorded_noise_is_scored_without_methods_that_are_told_the_truth():
    methods, notes = methods_of(EvaluationOptions("hoi4d"))
    assert not [method.name for method in methods if "told the truth" in method.name]
    left_out = [note.split(" is left out")[0] for note in notes if "ground truth" in note]
    assert left_out == list(TRUTHFUL)
    asked = EvaluationOptions("hoi4d", methods=TRUTHFUL[1:])
    assert len(methods_of(asked)[0]) == 1


def test_what_is_named_twice_is_scored_once():
    options = EvaluationOptions(
        "taco", noises=("gauss", "gauss"), seeds=(3, 3, 1), methods=("input", "input")
    )
    assert options.noises == ("gauss",)
    assert options.seeds == (3, 1)
    assert [method.name for method in methods_of(options)[0]] == ["input"]


def test_every_method_of_the_paper_and_of_a_sceptic_can_be_asked_for():
    methods, _ = methods_of(
        EvaluationOptions(
            "synthetic",
            methods=("input", "gaussian", *TRUTHFUL, "centroid", "optimisation", *OURS),
            presets=("default", "fast"),
            ablations=("motion", "fit", "camera"),
        )
    )
    assert [method.name for method in methods] == [
        "input",
        "Gaussian on keypoints",
        "Gaussian on parameters",
        "best filter on keypoints, told the truth †",
        "best filter on parameters, told the truth †",
        "best filter and best offset, told the truth †",
        "Gaussian on the hand's middle",
        "optimisation only",
        "MotionDiff in one call",
        "geneoh default",
        "geneoh fast",
        "geneoh default, w/o motion",
        "geneoh default, w/o fit",
        "geneoh default, w/o camera",
    ]


def test_baselines_without_weights_are_left_out_and_told(monkeypatch, tmp_path):
    monkeypatch.setattr("geneoh.baselines.networks.SHIPPED", tmp_path)
    methods, notes = methods_of(ALL)
    assert [method.name for method in methods][-1] == "geneoh default"
    assert len(methods) == 10
    assert [note.split(" is left out")[0] for note in notes] == ["toch", "regression"]
    assert "geneoh train --stage toch" in notes[0]
    # asked for by name, the method must fail
    assert len(methods_of(replace(ALL, methods=("toch",)))[0]) == 1


def test_baselines_come_from_the_users_folder_where_they_are_there(tmp_path):
    assert baseline_weights("toch", tmp_path) == SHIPPED / "toch.safetensors"
    (tmp_path / "toch.safetensors").touch()
    assert baseline_weights("toch", tmp_path) == tmp_path / "toch.safetensors"


def test_a_folder_without_the_weights_of_any_baseline_asked_for_is_refused(tmp_path):
    options = replace(ALL, methods=("toch", "input"), cleaner=Options(weights=tmp_path))
    with pytest.raises(CheckpointError, match="expected weights of toch"):
        methods_of(options)
    assert len(methods_of(replace(options, methods=("toch", "geneoh")))[0]) == 2
    (tmp_path / "toch.safetensors").touch()
    assert len(methods_of(options)[0]) == 2


def test_options_reach_every_method_of_ours():
    options = replace(ALL, methods=("geneoh",), ablations=("spatial",), cleaner=Options(samples=7))
    methods, _ = methods_of(options)
    given = [method.clean.keywords["options"] for method in methods]
    assert [each.samples for each in given] == [7, 7]
    assert given[1].without == ("spatial",)


def test_what_refined_poses_need_can_be_left_out_of_a_cleaner_that_refines_them():
    cleaner = Options(refine_object=True)
    options = replace(ALL, methods=("geneoh",), ablations=("object", "fit"), cleaner=cleaner)
    given = [method.clean.keywords["options"] for method in methods_of(options)[0]]
    assert [each.refine_object for each in given] == [True, False, True]


def test_a_folder_of_predictions_must_be_there_and_have_a_name_of_its_own(tmp_path):
    with pytest.raises(MissingAssetError, match="nowhere: expected a folder"):
        methods_of(replace(ALL, predictions=(Path("nowhere"),)))
    alike = tmp_path / "a" / "mine", tmp_path / "b" / "mine"
    for folder in alike:
        folder.mkdir(parents=True)
    with pytest.raises(ConfigError, match="more than once"):
        methods_of(replace(ALL, predictions=alike))
