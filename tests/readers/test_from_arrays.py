"""Sequences from arrays in memory."""

from pathlib import Path

import numpy as np
import pytest
import torch

import geneoh
from geneoh.errors import InputError

EXAMPLES = Path(__file__).parents[2] / "examples"
MESH = EXAMPLES / "taco_object.obj"


@pytest.fixture(scope="module")
def recording():
    return geneoh.load(EXAMPLES / "taco_noisy.npz", obj=MESH)


@pytest.fixture
def arrays(recording) -> dict[str, np.ndarray]:
    (hand,), motion = recording.hands, recording.object
    return {
        "left_joints": hand.joints.numpy(),
        "object_rotation": motion.rotation[:, 0].numpy(),
        "object_translation": motion.translation[:, 0].numpy(),
    }


@pytest.mark.parametrize("kind", [np.asarray, torch.from_numpy, np.ndarray.tolist])
def test_arrays_tensors_and_lists_make_the_sequence_of_a_file(recording, arrays, kind):
    given = {name: kind(values) for name, values in arrays.items()}
    sequence = geneoh.from_arrays(**given, fps=30, meshes=MESH)
    assert torch.equal(sequence.hands[0].joints, recording.hands[0].joints)
    assert torch.equal(sequence.object.rotation, recording.object.rotation)
    assert sequence.object.meshes[0].sha256 == recording.object.meshes[0].sha256
    assert (sequence.fps, sequence.source) == (30, "arrays")


def test_masked_entries_are_missing_and_not_what_lies_below_the_mask(arrays):
    mask = np.zeros((146, 21, 3), bool)
    mask[3] = mask[5, 4] = True
    wrong = np.ma.array(np.where(mask, 9.0, arrays["left_joints"]), mask=mask)
    (hand,) = geneoh.from_arrays(**{**arrays, "left_joints": wrong}, fps=30, meshes=MESH).hands
    assert np.flatnonzero(~hand.valid).tolist() == [3]
    assert hand.confidence[5, 4] == 0


def test_every_field_of_a_hand_can_be_given(recording, arrays):
    (hand,) = recording.hands
    sequence = geneoh.from_arrays(
        **arrays,
        left_pose=hand.pose,
        left_wrist=hand.wrist,
        left_betas=hand.betas,
        left_valid=hand.valid,
        left_confidence=np.full((146, 21), 0.5),
        hand_model=hand.hand_model,
        fps=30,
        meshes=[geneoh.load_mesh(MESH)],
    )
    (made,) = sequence.hands
    for name in ("valid", "pose", "wrist", "betas"):
        assert torch.equal(getattr(made, name), getattr(hand, name)), name
    assert made.hand_model == hand.hand_model
    assert made.confidence.eq(0.5).all()


def test_frames_with_nan_count_as_not_observed(arrays):
    arrays["left_joints"][3] = np.nan
    sequence = geneoh.from_arrays(**arrays, fps=30)
    assert sequence.hands[0].valid.tolist() == [frame != 3 for frame in range(146)]
    assert "1 of 146 frames hold NaN" in sequence.source


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"left_joints": np.zeros((146, 63))},
            r"'left_joints' must be numbers of shape .T, 21, 3. in metres",
        ),
        (
            {"left_joints": np.zeros((146, 26, 3))},
            r"take the 21 out that are geneoh\.readers\.joint_orders\.ORDERS\['openxr'\]\.entries",
        ),
        ({"left_joint": np.zeros(3)}, "'left_joint' is no field.*did you mean 'left_joints'"),
        ({"joints": np.zeros(3)}, "did you mean 'left_joints' or 'right_joints'"),
        ({"obj": MESH}, "did you mean 'meshes'"),
        ({"mesh": MESH}, "did you mean 'meshes'"),
        ({"camera_pose": np.eye(4)}, "did you mean 'camera_to_world'"),
        ({"left_joints": np.zeros((3, 21, 146))}, "transpose, reshape would mix them"),
        ({"left_joints": np.zeros((3, 21, 4))}, "keep the first three numbers of each; where"),
        ({"left_joints": [np.zeros((21, 3)), np.zeros((20, 3))]}, "fill missing rows with NaN"),
        ({"colour": np.zeros(3)}, "'colour' is no field of a sequence; the fields are"),
        ({"object_translation": np.zeros((12, 3))}, "same number of frames"),
        ({"fps": 0}, "'fps' must be 1 to 1000"),
    ],
)
def test_what_is_no_sequence_is_refused_with_the_field_and_the_remedy(arrays, changes, message):
    with pytest.raises(InputError, match=message):
        geneoh.from_arrays(**{**arrays, "fps": 30, "meshes": MESH, **changes})


def test_times_of_the_frames_take_the_place_of_a_rate(arrays):
    kept = np.flatnonzero(np.arange(146) % 5 != 3)
    given = {name: values[kept] for name, values in arrays.items()}
    sequence = geneoh.from_arrays(**given, timestamps=kept / 30, meshes=MESH)
    assert sequence.fps == pytest.approx(30, rel=1e-3)
    assert sequence.frames == 146
    torch.testing.assert_close(
        sequence.hands[0].joints[kept], torch.from_numpy(given["left_joints"]), atol=1e-4, rtol=0
    )


def test_times_of_the_frames_may_be_dates_of_numpy(arrays):
    dates = np.datetime64("2026-01-01", "ns") + 40_000_000 * np.arange(146)
    sequence = geneoh.from_arrays(**arrays, timestamps=dates, meshes=MESH)
    assert (sequence.fps, sequence.frames) == (25, 146)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "expected 'fps', the number of frames a second, got none"),
        ({"frame_ids": np.arange(146)}, "expected 'fps', the number of frames a second, got none"),
        ({"timestamps": np.arange(9) / 30}, "'timestamps' must be one number for each of the 146"),
        ({"timestamps": np.arange(146) / 30, "fps": 60}, "'timestamps' says 30 frames a second"),
    ],
)
def test_what_says_no_rate_or_two_rates_is_refused(arrays, given, words):
    with pytest.raises(InputError, match=words):
        geneoh.from_arrays(**arrays, **given, meshes=MESH)


def test_bfloat16_is_read_as_the_numbers_that_it_holds(arrays):
    half = torch.from_numpy(arrays["left_joints"]).bfloat16()
    (hand,) = geneoh.from_arrays(**arrays | {"left_joints": half}, fps=30, meshes=MESH).hands
    assert torch.equal(hand.joints[hand.valid], half.float()[hand.valid])


def test_none_for_a_coordinate_in_lists_is_nan(arrays):
    joints = arrays["left_joints"][:3].tolist()
    joints[1][4][2] = None
    (hand,) = geneoh.from_arrays(left_joints=joints, fps=30).hands
    assert hand.confidence[:, 4].tolist() == [1, 0, 1]
