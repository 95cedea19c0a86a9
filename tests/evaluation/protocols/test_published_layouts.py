"""Each data set in its published layout gives the clips, frames and noise of its protocol."""

import math
import pickle
import shutil

import numpy as np
import pytest
import torch
import trees

from geneoh.errors import ConfigError, InputError
from geneoh.evaluation.cases import find_cases, write_inputs
from geneoh.evaluation.options import EvaluationOptions, ProtocolOptions
from geneoh.evaluation.protocols.clips import recordings_of
from geneoh.readers.mano import read_mano


def cases(name, root, mano_dir, **options):
    noises = options.pop("noises", ())
    chosen = ProtocolOptions(mano_dir=mano_dir, frames=20, stride=10, **options)
    asked = {"noises": tuple(noises), "seeds": (11,), "protocol": chosen}
    return find_cases(EvaluationOptions(name, root, **asked))


def clips(found) -> list[str]:
    return [case.clip.name for case in found]


def assert_joints(sequence, expected: np.ndarray) -> None:
    (hand,) = sequence.hands
    torch.testing.assert_close(hand.joints, torch.from_numpy(expected).float(), atol=2e-5, rtol=0)


def test_grab_gives_windows_at_30_frames_a_second_of_either_hand(tree, mano_dir, known_scene):
    found = cases("grab", tree("grab", 160), mano_dir)
    assert clips(found) == [
        *(f"s1/mug_drink_1_left_{start:05d}" for start in (0, 40, 80)),
        *(f"s1/mug_drink_1_right_{start:05d}" for start in (0, 40, 80)),
    ]
    case = found[4]
    assert (case.clean.frames, case.clean.fps) == (20, 30.0)
    assert_joints(case.clean, known_scene(160).joints["right"][40:120:4])
    assert case.noisy.hands[0].joints.shape == (20, 21, 3)
    assert case.noisy.object is case.clean.object


def rewrite(path, **changes):
    with np.load(path, allow_pickle=True) as stored:
        fields = dict(stored)
    np.savez(path, **{**fields, **changes})


def test_grab_leaves_out_frames_in_which_the_other_hand_touches(tree, mano_dir):
    root = tree("grab", 160)
    labels = np.zeros((160, 8), np.int8)
    labels[:, 0] = 22  # the right hand's palm, all the time
    labels[100:, 1] = 40  # a finger of the left one, in the last sixty frames
    rewrite(root / "grab/s1/mug_drink_1.npz", contact=np.array({"object": labels}, dtype=object))
    # the right hand keeps 25 frames at 30 a second, the left one none
    assert clips(cases("grab", root, mano_dir)) == ["s1/mug_drink_1_right_00000"]


def test_grab_leaves_out_frames_in_which_the_wrist_is_far(tree, mano_dir):
    root = tree("grab", 160)
    path = root / "grab/s1/mug_drink_1.npz"
    with np.load(path, allow_pickle=True) as stored:
        hand = stored["rhand"].item()
    hand["params"]["transl"][:60] += 0.3
    rewrite(path, rhand=np.array(hand, dtype=object))
    kept = [name for name in clips(cases("grab", root, mano_dir)) if "right" in name]
    assert kept == ["s1/mug_drink_1_right_00060"]


def test_grab_tests_on_the_objects_that_toch_holds_out(tree, mano_dir):
    root = tree("grab", 160)
    shutil.copy(root / "grab/s1/mug_drink_1.npz", root / "grab/s1/apple_eat_1.npz")
    assert {name.split("_")[0] for name in clips(cases("grab", root, mano_dir))} == {"s1/mug"}
    (root / "grab/s1/mug_drink_1.npz").unlink()
    with pytest.raises(InputError, match="got none"):
        cases("grab", root, mano_dir)


def offsets(case, root, mano_dir):
    """What the noise added to translation, orientation and fingers."""
    (noisy,), (clean,) = case.noisy.hands, case.clean.hands
    turn = noisy.pose - clean.pose
    return noisy.wrist - clean.wrist, turn[:, 0], turn[:, 1:].flatten(1)


@pytest.mark.parametrize(
    ("name", "sizes", "says", "spread", "middle"),
    [
        ("grab", (0.01, 0.1, 0.5), "paper", 1.0, 0.0),
        ("grab", (0.01, 0.05, 0.4), "code", 1.0, 0.0),
        # Beta(8, 2) has mean 0.8 and variance 16 / (100 * 11)
        ("grab-beta", (0.01, 0.05, 0.3), "paper", math.sqrt(16 / 1100), 0.8),
    ],
)
def test_the_papers_noise_has_the_papers_sizes(tree, mano_dir, name, sizes, says, spread, middle):
    root = tree("grab", 160)
    found = cases(name, root, mano_dir, noise_sizes=says, windows="whole")
    rows = torch.from_numpy(read_mano(mano_dir, "right").components[:24]).float()
    drawn = [[], [], []]
    for case in (case for case in found if "right" in case.clip.name):
        shift, turn, fingers = offsets(case, root, mano_dir)
        coefficients = torch.linalg.lstsq(rows.T, fingers.T).solution.T
        torch.testing.assert_close(coefficients @ rows, fingers, atol=1e-4, rtol=0)
        for values, part in zip(drawn, (shift, turn, coefficients), strict=True):
            values.append(part.flatten())
    for values, size in zip(map(torch.cat, drawn), sizes, strict=True):
        assert float(values.std()) == pytest.approx(size * spread, rel=0.2)
        assert float(values.mean()) == pytest.approx(size * middle, abs=0.2 * size)


def test_noise_on_angles_is_drawn_on_every_finger_joint(tree, mano_dir):
    case = cases("arctic", tree("arctic"), mano_dir, finger_noise="angles")[0]
    _, turn, fingers = offsets(case, None, mano_dir)
    assert float(turn.std()) == pytest.approx(0.05, rel=0.2)
    assert float(fingers.std()) == pytest.approx(0.3, rel=0.05)
    assert float(fingers.std(0).min()) > 0.15


@pytest.mark.parametrize("setting", [{"noise_sizes": "code"}, {"finger_noise": "angles"}])
def test_settings_of_the_papers_noise_are_refused_where_it_is_not_drawn(setting):
    options = EvaluationOptions("taco", noises=("gauss",), protocol=ProtocolOptions(**setting))
    with pytest.raises(ConfigError, match="expected none without --noise paper"):
        find_cases(options)


def test_arctic_gives_the_right_hand_of_s01_in_overlapping_windows(tree, mano_dir, known_scene):
    root = tree("arctic")
    shutil.copytree(root / "raw_seqs/s01", root / "raw_seqs/s02")
    found = cases("arctic", root, mano_dir)
    assert clips(found) == [f"s01/box_grab_01_right_{start:05d}" for start in (0, 10, 20)]
    case = found[2]
    assert case.clean.object.rotation.shape[:2] == (20, 2)
    assert_joints(case.clean, known_scene().joints["right"][20:40])


def test_arctic_drops_windows_with_a_wrist_out_of_reach_and_the_codes_reach_is_longer(
    tree, mano_dir
):
    root = tree("arctic")
    path = root / "raw_seqs/s01/box_grab_01.mano.npy"
    hands = np.load(path, allow_pickle=True).item()
    hands["right"]["trans"][0, 1] += 0.2
    np.save(path, hands, allow_pickle=True)
    assert "s01/box_grab_01_right_00000" not in clips(cases("arctic", root, mano_dir))
    recordings_of.cache_clear()
    assert "s01/box_grab_01_right_00000" in clips(cases("arctic", root, mano_dir, reach="code"))


def test_hoi4d_takes_a_window_from_the_categorys_first_frame_without_truth(
    tree, mano_dir, known_scene
):
    root = tree("hoi4d")
    name = "ZY20210800001/H1/C2/N12/S55/s02/T1_right_00000"
    (case,) = cases("hoi4d", root, mano_dir)
    assert case.clip.name == name
    assert (case.clean, case.noise, case.noisy.fps, case.noisy.frames) == (None, "recorded", 15, 20)
    assert_joints(case.noisy, known_scene().joints["right"][:20])
    (again,) = cases("hoi4d", root, mano_dir, noises=["clean"])
    assert again.clean is not None


def test_hoi4d_starts_laptops_at_frame_120_and_the_code_at_0(tree, mano_dir):
    root = tree("hoi4d_articulated", 145)
    for path in (root / "handpose").rglob("*.pickle"):
        if 20 <= int(path.stem) < 120 or "left" in str(path):
            path.unlink()  # a frame without a hand, which takes no time to read
    (case,) = cases("hoi4d", root, mano_dir)
    assert case.clip.name.endswith("T1_right_00120")
    assert case.noisy.object.rotation.shape[:2] == (20, 2)
    (case,) = cases("hoi4d", root, mano_dir, start_frames="zero")
    assert case.clip.name.endswith("T1_right_00000")


def test_hoi4d_goes_on_to_where_the_object_is_annotated(tree, mano_dir):
    root = tree("hoi4d")
    next(root.rglob("objpose/00010.json")).unlink()
    next(root.rglob("refinehandpose_right/**/20.pickle")).unlink()
    (case,) = cases("hoi4d", root, mano_dir)
    assert case.clip.name.endswith("T1_00011_right_00000")
    hand = case.noisy.hands[0]
    assert hand.valid.tolist() == [t != 9 for t in range(20)]


def test_hoi4d_runs_without_mano_on_our_own_hand_and_says_so(tree):
    case = cases("hoi4d", tree("hoi4d"), None)[0]
    assert "geneoh's mean hand" in case.noisy.source
    assert bool(case.noisy.hands[0].joints.isfinite().all())


def test_hoi4d_leaves_out_other_categories(tree, mano_dir, known_scene):
    root = tree("hoi4d")
    trees.hoi4d_hands(root, known_scene(), trees.HOI_ID.format(category="C17"), False)
    (root / "HOI4D_annotations" / trees.HOI_ID.format(category="C17") / "objpose").mkdir()
    assert [name.split("/")[2] for name in clips(cases("hoi4d", root, mano_dir))] == ["C2"]


def test_taco_gives_each_hand_with_what_it_holds(tree, mano_dir, known_scene):
    found = cases("taco", tree("taco"), mano_dir, windows="first", noises=["gauss"])
    assert clips(found) == [
        "_stir__spoon__bowl_/20230917_001_target_left_00000",
        "_stir__spoon__bowl_/20230917_001_tool_right_00000",
    ]
    case = found[0]
    assert_joints(case.clean, known_scene().joints["left"][:20])
    assert (
        float((case.noisy.hands[0].joints - case.clean.hands[0].joints).norm(dim=-1).mean()) > 0.01
    )


@pytest.mark.parametrize("name", ["grab", "grab-beta", "hoi4d", "arctic", "taco"])
def test_a_case_that_went_to_another_process_is_the_same(name, tree, mano_dir):
    root = tree(name.split("-")[0], 160 if "grab" in name else 40)
    case = cases(name, root, mano_dir)[-1]
    sent = pickle.dumps(case)
    assert case.noisy.frames > 0
    recordings_of.cache_clear()
    again = pickle.loads(sent)
    for one, other in zip(case.noisy.hands, again.noisy.hands, strict=True):
        for field in ("joints", "pose", "wrist"):
            torch.testing.assert_close(getattr(one, field), getattr(other, field), rtol=0, atol=0)


def test_whole_recordings_are_one_clip(tree, mano_dir):
    found = cases("arctic", tree("arctic"), mano_dir, windows="whole")
    assert clips(found) == ["s01/box_grab_01_right_00000"]
    assert found[0].clean.frames == 40


def test_a_damaged_file_is_a_clip_that_says_so_and_keeps_no_other_out(tree, mano_dir, tmp_path):
    root = tree("arctic")
    for name in ("mano", "object"):
        file = root / f"raw_seqs/s01/box_grab_01.{name}.npy"
        shutil.copy(file, file.with_name(f"box_use_01.{name}.npy"))
    whole = [case.clip.name for case in cases("arctic", root, mano_dir)]
    damaged = root / "raw_seqs/s01/box_use_01.mano.npy"
    damaged.write_bytes(damaged.read_bytes()[:3000])
    recordings_of.cache_clear()
    found = cases("arctic", root, mano_dir)
    bad = "s01/box_use_01"
    assert clips(found) == [*(name for name in whole if not name.startswith(bad)), bad]
    with pytest.raises(InputError, match=r"box_use_01\.mano\.npy"):
        found[-1].noisy.frames  # noqa: B018
    with pytest.raises(InputError, match=r"box_use_01\.mano\.npy"):
        write_inputs(found, tmp_path / "inputs")
    assert not (tmp_path / "inputs").exists()


def test_a_copy_of_damaged_files_alone_is_refused(tree, mano_dir):
    root = tree("arctic")
    (root / "raw_seqs/s01/box_grab_01.object.npy").unlink()
    with pytest.raises(InputError, match=r"box_grab_01\.object\.npy: no such file"):
        cases("arctic", root, mano_dir)


@pytest.mark.parametrize("change", [{"frames": 0}, {"frames": -3}, {"stride": 0}, {"stride": -1}])
def test_windows_of_no_frames_or_no_step_are_refused(change):
    with pytest.raises(ConfigError, match="must be 1 to"):
        ProtocolOptions(**change)
