from pathlib import Path

import bodies
import numpy as np
import pytest
from bad_inputs import REFUSED, TOLD, write_good
from trees import write_mano

from geneoh.readers.npz.files import load

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_noise_is_added_to_the_hand_and_the_object_is_kept(geneoh, tmp_path):
    result = geneoh("corrupt", EXAMPLES / "taco_clean.npz", "--noise", "drop", "-o", "out.npz")
    assert result.stdout == "out.npz: 146 frames with drop noise, seed 0\n"
    clean = load(EXAMPLES / "taco_clean.npz")
    noisy = load(tmp_path / "out.npz")
    assert noisy.object.rotation.equal(clean.object.rotation)
    assert noisy.object.translation.equal(clean.object.translation)
    assert noisy.hands[0].side == "left"
    assert noisy.hands[0].betas.equal(clean.hands[0].betas)
    assert 0 < int(noisy.hands[0].valid.sum()) < 146
    assert not noisy.hands[0].wrist.allclose(clean.hands[0].wrist, equal_nan=True)
    assert "drop noise, seed 0, on taco_clean.npz" in noisy.source


def test_mano_adds_the_mean_pose_that_a_file_lacks(geneoh, tmp_path):
    pose = np.full((4, 48), 0.1)
    arrays = {"global_orient": pose[:, :3], "hand_pose": pose[:, 3:], "transl": pose[:, :3]}
    np.savez(tmp_path / "hand.npz", side="left", fps=30, flat_hand_mean=False, **arrays)
    given = ("corrupt", "hand.npz", "--noise", "gauss", "-o", "out.npz")
    assert "pass --mano" in geneoh(*given, code=2).stderr
    geneoh(*given, "--mano", write_mano(tmp_path / "mano"))


def test_keypoints_in_another_unit_are_read(geneoh, tmp_path):
    write_good(tmp_path)
    joints = load(tmp_path / "hand.npz").hands[0].joints
    np.save(tmp_path / "raw.npy", 100 * joints.numpy())
    given = ("corrupt", "raw.npy", "--noise", "drop", "--side", "right", "-o", "out.npz")
    geneoh(*given, "--keypoint-unit", "cm")
    (noisy,) = load(tmp_path / "out.npz").hands
    np.testing.assert_allclose(noisy.joints[noisy.valid], joints[noisy.valid], atol=0.05)


def test_the_same_seed_gives_the_same_file(geneoh, tmp_path):
    write_good(tmp_path)
    for out, seed in (("a.npz", 3), ("b.npz", 3), ("c.npz", 4)):
        geneoh("corrupt", "hand.npz", "--noise", "gauss", "--seed", seed, "-o", out)
    a, b, c = ((tmp_path / f"{name}.npz").read_bytes() for name in "abc")
    assert a == b != c


def test_a_seed_that_no_generator_takes_is_refused(geneoh, tmp_path):
    write_good(tmp_path)
    done = geneoh("corrupt", "hand.npz", "--noise", "gauss", "--seed", 2**63, code=2)
    assert "0<=x<=9223372036854775807" in done.stderr


def test_the_result_stands_beside_the_input_by_default(geneoh, tmp_path):
    write_good(tmp_path)
    before = (tmp_path / "hand.npz").read_bytes()
    geneoh("corrupt", "hand.npz", "--noise", "bias")
    assert (tmp_path / "hand.npz").read_bytes() == before
    assert load(tmp_path / "hand_bias.npz").frames == 6


def test_the_shipped_noisy_example_is_what_its_command_makes(geneoh, tmp_path):
    geneoh(
        *("corrupt", EXAMPLES / "taco_clean.npz", "--noise", "gauss", "--seed", 0),
        *("-o", "taco_noisy.npz"),
    )
    made = load(tmp_path / "taco_noisy.npz")
    shipped = load(EXAMPLES / "taco_noisy.npz")
    # To a hundredth of a millimetre: another torch may round differently, and draws the same.
    np.testing.assert_allclose(made.hands[0].joints, shipped.hands[0].joints, rtol=0, atol=1e-5)
    assert made.source == shipped.source


@pytest.mark.parametrize(
    "case",
    [case for case in REFUSED if case.in_reading],
    ids=lambda case: case.name,
)
def test_bad_input_ends_with_one_line_and_leaves_nothing(geneoh, tmp_path, case):
    write_good(tmp_path)
    case.spoil(tmp_path)
    before = sorted(path.name for path in tmp_path.iterdir())
    result = geneoh(
        "corrupt", "hand.npz", "--noise", "gauss", "-o", "out.npz", *case.options, code=2
    )
    assert result.stderr.startswith("Error: hand.npz: ")
    assert result.stderr.count("\n") == 1
    for word in case.words:
        assert word in result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    "case", [case for case in TOLD if case.in_reading], ids=lambda case: case.name
)
def test_odd_input_is_told_and_used(geneoh, tmp_path, case, caplog):
    write_good(tmp_path)
    case.spoil(tmp_path)
    geneoh("corrupt", "hand.npz", "--noise", "gauss", "-o", "out.npz")
    for word in case.words:
        assert word in caplog.text
    assert (tmp_path / "out.npz").exists()


def test_a_body_that_is_left_out_is_told(geneoh, tmp_path):
    bodies.hands_file(tmp_path / "hands.npz", bodies.recording())
    result = geneoh("corrupt", "hands.npz", "--noise", "gauss", "-o", "out.npz")
    assert result.stdout.startswith("note: the body that the hands belong to is left out")
    assert not load(tmp_path / "out.npz").left_out


def test_the_noise_of_a_camera_writes_its_ray(geneoh, tmp_path):
    geneoh("corrupt", EXAMPLES / "taco_clean.npz", "--noise", "camera", "-o", "out.npz")
    with np.load(tmp_path / "out.npz") as file:
        ray = file["camera_ray"]
    assert ray.shape == (146, 3)
    np.testing.assert_allclose(np.linalg.norm(ray, axis=-1), 1, atol=1e-6)
    noisy = load(tmp_path / "out.npz").hands[0]
    np.testing.assert_allclose(noisy.camera_ray, ray, atol=1e-6)
