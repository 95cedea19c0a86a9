import re
from shutil import copy

import numpy as np
import pytest
import torch

from geneoh.errors import InputError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.readers.mano import read_mano
from geneoh.readers.npz.hands import read_hands
from geneoh.readers.npz.layouts import layout_of
from geneoh.readers.records import Record
from geneoh.sequence.sequence import HandTrack

T = 5
RNG = np.random.default_rng(0)
POSE = 0.3 * RNG.standard_normal((T, 16, 3)).astype(np.float32)
PLACE = RNG.standard_normal((T, 3)).astype(np.float32)
JOINTS = 0.1 * RNG.standard_normal((T, 21, 3)).astype(np.float32)
BETAS = np.linspace(-1, 1, 10, dtype=np.float32)
OWN = {"format": np.array("geneoh-sequence"), "version": np.array(1)}
SMPLX = {
    "global_orient": POSE[:, 0],
    "hand_pose": POSE[:, 1:].reshape(T, 45),
    "transl": PLACE,
    "betas": BETAS,
    "flat_hand_mean": np.array(True),
}
TACO = {
    "side": np.array("left"),
    "hand_pose": POSE.reshape(T, 48),
    "hand_trans": PLACE,
    "hand_shape": BETAS,
    "hand_joints": JOINTS,
}


def read(arrays, *, side=None, mano_dir=None):
    record = Record("hand.npz", arrays)
    return read_hands(record, layout_of(record), side, mano_dir)


def only(reading):
    ((hand,), _) = reading
    return hand


def test_taco_names_hold_pose_and_wrist():
    hand = only(read(TACO))
    assert hand.side == "left"
    assert hand.hand_model == "mano-as-shipped"
    np.testing.assert_array_equal(hand.pose, POSE)
    np.testing.assert_array_equal(hand.wrist, PLACE)
    np.testing.assert_array_equal(hand.joints, JOINTS)
    np.testing.assert_array_equal(hand.betas, BETAS)


def test_the_side_of_a_hand_may_be_in_capitals():
    assert only(read({**TACO, "side": np.array("Left")})).side == "left"


def test_smplx_translation_plus_the_models_wrist_is_the_wrist():
    model = load_hand("right")
    verts = model.template + torch.einsum("vcs,s->vc", model.shape_dirs, torch.from_numpy(BETAS))
    reading = read({**SMPLX, "hand_model": np.array("embedded")}, side="right")
    hand = only(reading)
    torch.testing.assert_close(
        hand.wrist, torch.from_numpy(PLACE) + model.joint_regressor[0] @ verts
    )
    np.testing.assert_array_equal(hand.pose, POSE)
    assert reading[1] == ()


def test_the_wrist_of_a_known_hand_is_not_the_first_keypoint(mano_dir):
    named = {**SMPLX, "joints": JOINTS}
    for model, folder in (("embedded", None), ("mano", mano_dir)):
        arrays = {**named, "hand_model": np.array(model)}
        hand = load_hand("left", source=model, mano_dir=folder)
        wrist = torch.from_numpy(PLACE) + hand.rest_wrist(torch.from_numpy(BETAS))
        torch.testing.assert_close(only(read(arrays, side="left", mano_dir=folder)).wrist, wrist)
    unknown = (named, {**named, "hand_model": np.array("mano")})
    for arrays in unknown:
        np.testing.assert_array_equal(only(read(arrays, side="left")).wrist, JOINTS[:, 0])


@pytest.mark.parametrize("model", ["mano", "mano-as-shipped"])
def test_the_wrist_is_that_of_the_left_hand_that_the_betas_belong_to(mano_dir, model):
    arrays = {**SMPLX, "hand_model": np.array(model)}
    wrist = only(read(arrays, side="left", mano_dir=mano_dir)).wrist
    own, other = (
        load_hand("left", source=name, mano_dir=mano_dir).rest_wrist(torch.from_numpy(BETAS))
        for name in (model, "mano" if model == "mano-as-shipped" else "mano-as-shipped")
    )
    torch.testing.assert_close(wrist, torch.from_numpy(PLACE) + own)
    assert (own - other).norm() > 1e-3


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("layout", ["smplx", "taco", "own"])
def test_a_pose_with_manos_betas_gets_its_keypoints_where_mano_is_there(mano_dir, layout, side):
    named = {"pose": POSE, "wrist": PLACE, "betas": BETAS}
    own = {**OWN, "hand_model": np.array("mano-as-shipped")}
    arrays = {
        "smplx": SMPLX,
        "taco": {n: v for n, v in TACO.items() if n not in ("hand_joints", "side")},
        "own": own | {f"{side}_{name}": array for name, array in named.items()},
    }[layout]
    assert only(read(arrays, side=side)).joints is None
    hand = only(read(arrays, side=side, mano_dir=mano_dir))
    placed = (np.float64(values) for values in (POSE, hand.wrist, BETAS))
    expected = read_mano(mano_dir, side).keypoints(*placed)
    np.testing.assert_allclose(hand.joints, expected, atol=1e-6)


def test_a_pose_gets_no_keypoints_without_manos_betas_or_the_file_of_its_side(mano_dir, tmp_path):
    own = {**OWN, "left_pose": POSE, "left_wrist": PLACE, "left_betas": BETAS}
    mano = {**own, "hand_model": np.array("mano")}
    copy(mano_dir / "MANO_RIGHT.pkl", tmp_path)
    for arrays, folder in (
        ({**own, "hand_model": np.array("embedded")}, mano_dir),
        ({n: v for n, v in mano.items() if n != "left_betas"}, mano_dir),
        (mano, tmp_path),
    ):
        assert only(read(arrays, mano_dir=folder)).joints is None


@pytest.mark.parametrize(("side", "sign"), [("right", 1), ("left", -1)])
def test_smplx_without_a_model_places_the_mean_hands_wrist_and_says_so(side, sign):
    reading = read(SMPLX, side=side)
    offset = only(reading).wrist - torch.from_numpy(PLACE)
    torch.testing.assert_close(
        offset[0], torch.tensor([sign * 0.096, 0.006, 0.006]), rtol=0, atol=1e-6
    )
    assert "mean hand" in reading[1][0]


def test_smplx_joints_tell_the_wrist_exactly():
    reading = read({**SMPLX, "joints": JOINTS}, side="right")
    np.testing.assert_array_equal(only(reading).wrist, JOINTS[:, 0])
    assert reading[1] == ()


@pytest.mark.parametrize("nothing", [np.nan, 0.0])
def test_smplx_joints_without_the_wrist_in_a_frame_keep_the_frame(nothing):
    joints = JOINTS + 1.0
    joints[2, 0] = nothing
    hand = only(read({**SMPLX, "joints": joints}, side="right"))
    assert hand.valid.all()
    torch.testing.assert_close(hand.wrist, hand.joints[:, 0])


def test_smplx_files_may_say_whose_betas_they_have():
    shipped = {**SMPLX, "joints": JOINTS}
    assert only(read(shipped, side="left")).hand_model == "mano-as-shipped"
    for model in ("embedded", "mano"):
        hand = only(read({**shipped, "hand_model": np.array(model)}, side="left"))
        assert hand.hand_model == model


@pytest.mark.parametrize("root", [0, slice(1)])
def test_rotation_matrices_are_read_as_the_same_pose(root):
    matrices = axis_angle_to_matrix(torch.from_numpy(POSE)).numpy()
    arrays = {**SMPLX, "global_orient": matrices[:, root], "hand_pose": matrices[:, 1:]}
    torch.testing.assert_close(
        only(read(arrays, side="right")).pose, torch.from_numpy(POSE), rtol=0, atol=1e-6
    )


def test_betas_of_each_frame_are_averaged_aloud():
    reading = read({**SMPLX, "betas": np.stack([k * BETAS for k in range(1, T + 1)])}, side="right")
    np.testing.assert_allclose(only(reading).betas, 3 * BETAS, rtol=1e-6)
    assert any("averaged over 5 frames" in note for note in reading[1])


def test_frames_without_the_hand_have_no_betas():
    betas = np.stack([BETAS, 0 * BETAS, 3 * BETAS, 9 * BETAS, np.nan * BETAS])
    seen = {"valid": np.array([True, True, True, False, True])}
    reading = read({**SMPLX, **seen, "betas": betas}, side="right")
    np.testing.assert_allclose(only(reading).betas, 2 * BETAS, rtol=1e-6)
    assert any("averaged over 2 frames" in note for note in reading[1])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"hand_pose": POSE[:, 1:9].reshape(T, 24)},
            "'hand_pose' must be numbers of shape (T, 45) or .*in radians.*PCA",
        ),
        ({"hand_pose": np.zeros((T, 6))}, "of PCA coefficients say 'use_pca'"),
        ({"hand_pose": np.zeros((T, 15, 4))}, "; turn each rotation into an axis-angle"),
        ({"hand_pose": np.zeros((T, 15, 6))}, "; turn each rotation into an axis-angle"),
        ({"global_orient": np.zeros((T, 4))}, "; turn each rotation into an axis-angle"),
        ({"flat_hand_mean": np.array(False)}, "'flat_hand_mean' must be true"),
        ({"global_orient": None}, "no 'global_orient'"),
        ({"transl": None}, "needs its joints, or its pose with the wrist's place"),
        ({"transl": PLACE[:3]}, "'transl' with 3"),
        ({"betas": np.full(10, np.nan)}, "betas must be finite"),
        ({"betas": np.zeros(16)}, "'betas' must be .*got (16,) .*; give the ten of a MANO hand"),
        (
            {"global_orient": np.tile(np.diag([1.0, 1.0, -1.0]), (T, 1, 1, 1))},
            "'global_orient' must be rotation matrices with .*-1.0]] in row 0",
        ),
    ],
)
def test_smplx_refusals_say_what_to_do(change, words):
    arrays = {key: array for key, array in {**SMPLX, **change}.items() if array is not None}
    pattern = ".*".join(re.escape(part) for part in words.split(".*"))
    with pytest.raises(InputError, match=pattern):
        read(arrays, side="right")


@pytest.mark.parametrize("form", [(4,), (6,), (3, 3)])
def test_quaternions_are_not_told_to_lose_their_fourth_number(form):
    arrays = {**OWN, "right_pose": np.zeros((T, 16, *form)), "right_wrist": PLACE}
    with pytest.raises(InputError, match=r"'right_pose' must be .*; turn each rotation into an"):
        read(arrays)


def test_a_pose_that_needs_no_mean_may_say_so():
    _, told = read(SMPLX, side="right")
    _, silent = read({n: v for n, v in SMPLX.items() if n != "flat_hand_mean"}, side="right")
    both = "'flat_hand_mean' and 'use_pca' say otherwise"
    assert f"the pose is taken as absolute axis-angle vectors; {both}" in silent
    assert "taken as" not in " ".join(told)


def test_a_pose_of_as_many_numbers_as_coefficients_is_told(mano_dir):
    relative = {**SMPLX, "flat_hand_mean": np.array(False)}
    _, notes = read(relative, side="left", mano_dir=mano_dir)
    words = "the pose is taken as axis-angle vectors; 'use_pca' says otherwise"
    assert words in notes
    vectors = {**relative, "hand_pose": POSE[:, 1:]}
    for arrays in (vectors, {**relative, "use_pca": np.array(False)}):
        assert words not in read(arrays, side="left", mano_dir=mano_dir)[1]


def test_the_mean_pose_is_added_where_the_file_says_so_and_mano_is_there(mano_dir):
    mean = read_mano(mano_dir, "left").mean.reshape(15, 3)
    arrays = {**SMPLX, "flat_hand_mean": np.array(False)}
    hand = only(read(arrays, side="left", mano_dir=mano_dir))
    np.testing.assert_allclose(hand.pose[:, 1:], POSE[:, 1:] + mean, atol=1e-6)
    np.testing.assert_array_equal(hand.pose[:, 0], POSE[:, 0])
    assert np.abs(mean).max() > 0.01


@pytest.mark.parametrize("count", [6, 15, 45])
@pytest.mark.parametrize("flat", [True, False])
def test_coefficients_of_poses_are_decoded_where_the_file_says_so(mano_dir, count, flat):
    mano, coefficients = read_mano(mano_dir, "left"), RNG.standard_normal((T, count))
    about = {"use_pca": np.array(True), "flat_hand_mean": np.array(flat)}
    arrays = {**SMPLX, **about, "hand_pose": coefficients}
    hand = only(read(arrays, side="left", mano_dir=mano_dir))
    expected = coefficients @ mano.components[:count] + (0 if flat else mano.mean)
    np.testing.assert_allclose(hand.pose[:, 1:].reshape(T, 45), expected, atol=1e-5)


def test_coefficients_of_poses_need_mano(mano_dir):
    arrays = {**SMPLX, "use_pca": np.array(True)}
    with pytest.raises(InputError, match=r"'use_pca' must be false .* without MANO.*pass --mano"):
        read(arrays, side="left")
    arrays["hand_pose"] = np.zeros((T, 46))
    with pytest.raises(InputError, match="'hand_pose' must be at most 45 coefficients"):
        read(arrays, side="left", mano_dir=mano_dir)


def test_betas_of_a_model_that_does_not_exist_are_refused_by_the_files_name():
    arrays = {**OWN, "right_betas": BETAS, "right_joints": JOINTS, "hand_model": np.array("MANO")}
    with pytest.raises(InputError, match=r"^hand.npz: 'hand_model' must be one of .*got 'MANO'"):
        read(arrays)
    with pytest.raises(InputError, match=r"^the right hand: 'hand_model' must be one of"):
        HandTrack("right", torch.ones(T).bool(), torch.from_numpy(JOINTS), hand_model="MANO")


def test_bare_joints_are_a_hand():
    hand = only(read({"joints": JOINTS}, side="left"))
    assert hand.side == "left"
    assert hand.pose is None
    assert hand.hand_model is None
    np.testing.assert_array_equal(hand.joints, JOINTS)


def test_frames_without_numbers_count_as_not_observed_and_are_noted():
    joints = JOINTS.copy()
    joints[2, :11, 1] = np.nan
    joints[4] = np.inf
    reading = read({"joints": joints}, side="right")
    assert only(reading).valid.tolist() == [True, True, False, True, False]
    assert reading[1] == ("2 of 5 frames hold NaN in 'joints' and count as not observed",)


@pytest.mark.parametrize("mask", [{}, {"valid": np.ones(T, bool)}], ids=["no mask", "mask"])
@pytest.mark.parametrize("nothing", [np.nan, 0.0])
def test_single_keypoints_that_were_not_found_count_for_nothing(mask, nothing):
    joints = JOINTS + 1.0
    joints[:, [4, 8, 12, 16, 20]] = nothing
    joints[2, 0] = np.nan
    reading = read({"joints": joints, **mask}, side="right")
    hand = only(reading)
    assert hand.valid.all()
    assert (hand.confidence == 0).sum(-1).tolist() == [5, 5, 6, 5, 5]
    assert hand.confidence.max() == 1
    np.testing.assert_array_equal(hand.joints[:, 4], hand.joints[:, 3])
    assert reading[1][0].startswith("26 keypoints are NaN or at the origin in 5 of 5 frames")


@pytest.mark.parametrize("mask", [{}, {"valid": np.ones(T, bool)}], ids=["no mask", "mask"])
def test_zeros_in_place_of_most_keypoints_leave_no_hand_in_a_frame(mask):
    """They were taken for keypoints at the origin."""
    joints = JOINTS + 1.0
    joints[[1, 3], 9:] = 0.0
    reading = read({"joints": joints, **mask}, side="right")
    assert only(reading).observed.tolist() == [True, False, True, False, True]
    assert reading[1][0].endswith("in 2 of these they are most of the hand, and nothing counts")


def test_zeros_in_place_of_most_keypoints_of_every_frame_leave_nothing_to_clean():
    joints = JOINTS + 1.0
    joints[:, 9:] = 0.0
    with pytest.raises(InputError, match="at least one frame must hold the right hand"):
        read({"joints": joints}, side="right")


def test_a_wrist_at_the_origin_is_found():
    joints = JOINTS - JOINTS[:, :1]
    hand = only(read({"joints": joints}, side="right"))
    assert hand.confidence is None
    np.testing.assert_array_equal(hand.joints, joints)


@pytest.mark.parametrize("mask", [{}, {"valid": np.ones(T, bool)}], ids=["no mask", "mask"])
def test_nan_in_the_confidence_alone_is_told_as_such(mask):
    arrays = {"joints": JOINTS, "confidence": np.full(T, np.nan), **mask}
    with pytest.raises(InputError, match=r"'confidence'.*write 0 where nothing is known"):
        read(arrays, side="right")


def test_a_confidence_of_zero_everywhere_is_noted():
    _, notes = read({"joints": JOINTS, "confidence": np.zeros(T)}, side="right")
    assert notes == ("'confidence' is 0 everywhere: it is ignored, and all keypoints count",)


def test_frames_that_are_said_to_be_dropped_may_hold_anything():
    joints = JOINTS.copy()
    joints[2] = np.nan
    for valid in (np.arange(T) != 2, (np.arange(T) != 2).astype(np.int64)):
        hand = only(read({**TACO, "hand_joints": joints, "hand_valid": valid}))
        assert hand.valid.tolist() == [True, True, False, True, True]


def test_one_confidence_per_frame_is_that_of_each_keypoint():
    confidence = np.linspace(0, 1, T)
    hand = only(read({"joints": JOINTS, "confidence": confidence}, side="right"))
    assert hand.confidence.shape == (T, 21)
    np.testing.assert_allclose(hand.confidence[:, 7], confidence, rtol=1e-6)


def test_our_own_layout_needs_its_name():
    with pytest.raises(InputError, match="add format='geneoh-sequence' and version=1"):
        read({"right_joints": JOINTS})


def test_a_body_under_the_names_of_smplx_is_no_hand():
    body = {"global_orient": POSE[:, 0], "body_pose": np.zeros((T, 63)), "transl": PLACE}
    with pytest.raises(InputError, match=r"got a body \('body_pose'\).*geneoh generate --body"):
        read(body)
    with pytest.raises(InputError, match=r"got a body \('poses', 'trans'\).*generate --body"):
        read({"poses": np.zeros((T, 165)), "trans": PLACE})  # of AMASS
    with pytest.raises(InputError, match=r"'poses' must be called .*--from parameters"):
        read({"poses": np.zeros((T, 48)), "trans": PLACE})  # a hand was called a body
    hand = {**SMPLX, "body_pose": np.zeros((T, 63))}  # a field that is left alone
    assert only(read(hand, side="right")).pose is not None


UNSEEN = {
    "NaN": {"left_joints": JOINTS * np.nan},
    "valid": {"left_joints": JOINTS, "left_valid": np.zeros(T, bool)},
    "parameters": {
        "left_pose": POSE * np.nan,
        "left_wrist": PLACE * np.nan,
        "left_betas": BETAS * np.nan,
    },
    "zeros": {"left_joints": 0 * JOINTS},
    "no frame": {"left_joints": JOINTS[:0]},
}


@pytest.mark.parametrize("unseen", UNSEEN)
def test_a_second_hand_that_is_in_no_frame_is_left_out_aloud(unseen):
    hands, notes = read({**OWN, "right_joints": JOINTS, **UNSEEN[unseen]})
    assert [hand.side for hand in hands] == ["right"]
    assert notes == ("the left hand is in no frame and was left out",)


@pytest.mark.parametrize("unseen", ["NaN", "valid", "parameters"])
def test_a_hand_that_is_in_no_frame_is_refused_where_it_is_asked_for(unseen):
    with pytest.raises(InputError):
        read({**OWN, "right_joints": JOINTS, **UNSEEN[unseen]}, side="left")


def test_hands_that_are_both_in_no_frame_are_refused():
    with pytest.raises(InputError, match="at least one frame must hold the right hand"):
        read({**OWN, "right_joints": JOINTS * np.nan, "left_joints": JOINTS * np.nan})


def test_a_hand_of_no_frame_is_refused_in_our_own_layout():
    with pytest.raises(InputError, match=r"'right_joints' .* at least one frame is needed"):
        read({**OWN, "right_joints": JOINTS[:0]})


def test_our_own_layout_takes_the_pose_flat_or_by_joint():
    ours = {**OWN, "right_wrist": PLACE}
    flat = only(read({**ours, "right_pose": POSE.reshape(T, 48)}))
    by_joint = only(read({**ours, "right_pose": POSE}))
    assert torch.equal(flat.pose, by_joint.pose)
    with pytest.raises(InputError, match="expected a left hand, got right; drop --side"):
        read({**ours, "right_pose": POSE}, side="left")
