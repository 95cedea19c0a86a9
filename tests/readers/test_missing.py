"""What is missing, in each source's own way to say so, becomes a mask or a split, never zeros."""

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import trees
from trees import CASES, FRAMES, Case, case_of, scene, written

import geneoh
from geneoh.errors import InputError
from geneoh.readers.base import stretches

LOST = 3
"""The frame that goes missing."""
LEFT_CLIPS = next(case for case in CASES if case.build is trees.grab_clips_left)
HAMER = case_of("hamer")


def repickle(path: Path, change) -> None:
    """Change what a pickle of ours holds."""
    value = pickle.loads(path.read_bytes())
    change(value)
    path.write_bytes(pickle.dumps(value))


def change_npy(path: Path, change) -> None:
    """Change the object that a npy of ours holds."""
    value = np.load(path, allow_pickle=True)
    value = value.item() if value.ndim == 0 else value
    change(value)
    np.save(path, value)


def lose_hoi4d(root: Path) -> None:
    next(root.rglob(f"refinehandpose_right/**/{LOST}.pickle")).unlink()


def lose_hoi4d_case(root: Path) -> None:
    change_npy(root / "Mug/case3/merged_data.npy", lambda frames: frames.pop(LOST))


def lose_h2o(root: Path) -> None:
    path = next(root.rglob(f"hand_pose_mano/{LOST:06d}.txt"))
    words = path.read_text().split()
    path.write_text(" ".join([*words[:62], "0", *["0"] * 61]))  # the right hand's flag


def lose_dexycb(root: Path) -> None:
    path = next(root.rglob("pose.npz"))
    with np.load(path) as file:
        arrays = dict(file)
    arrays["pose_m"][LOST] = 0
    np.savez(path, **arrays)


def lose_dexycb_label(root: Path) -> None:
    path = next(root.rglob(f"labels_{LOST:06d}.npz"))
    np.savez(path, seg=np.zeros((4, 4), np.uint8), joint_3d=np.full((1, 21, 3), -1, "f4"))


def lose_hocap(root: Path) -> None:
    change_array(next(root.rglob("poses_m.npy")), 0)


def change_array(path: Path, row: int) -> None:
    """Write -1 for what one of several hands or objects is in one frame."""
    values = np.load(path)
    values[row, LOST] = -1
    np.save(path, values)


def lose_hot3d(root: Path) -> None:
    path = next(root.rglob("*.jsonl"))
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    del lines[2 * LOST]["hand_poses"]["1"]  # of two moments that are one
    path.write_text("\n".join(map(json.dumps, lines)))


def lose_ho3d(root: Path) -> None:
    repickle(
        next(root.rglob(f"meta/{LOST:04d}.pkl")),
        lambda fields: fields.update(handPose=None, handTrans=None, handBeta=None),
    )


def lose_oakink2(root: Path) -> None:
    frame = 100 + 4 * LOST
    path = next(root.rglob("anno_preview/*.pkl"))
    repickle(path, lambda fields: fields["raw_mano"][frame].pop("rh__pose_coeffs"))


def lose_aria(root: Path) -> None:
    lose_cells(root, "right_tracking_confidence", "-1")


def doubt_aria(root: Path) -> None:
    lose_cells(root, "right_tracking_confidence", "0.6")


def lose_cells(root: Path, column: str, text: str) -> None:
    path = next(root.rglob("hand_tracking_results.csv"))
    rows = [line.split(",") for line in path.read_text().splitlines()]
    rows[1 + LOST][[name.strip() for name in rows[0]].index(column)] = text
    path.write_text("\n".join(",".join(row) for row in rows))


def lose_landmarks(root: Path) -> None:
    value = json.loads((root / "hands.json").read_text())
    value["hands"]["right"][LOST] = None
    (root / "hands.json").write_text(json.dumps(value))


def hamer_dump(root: Path) -> dict[str, Any]:
    """What the dump of HaMeR holds that is written below a folder."""
    HAMER.write(root)
    return torch.load(root / "video.pt")


def lose_hamer(root: Path) -> None:
    value = torch.load(root / "video.pt")
    keep = ~((value["frame"] == LOST) & (value["right"] > 0.5))
    value["pred_mano_params"] = {n: v[keep] for n, v in value["pred_mano_params"].items()}
    torch.save(
        {n: v[keep] if isinstance(v, torch.Tensor) else v for n, v in value.items()},
        root / "video.pt",
    )


def lose_fphab(root: Path) -> None:
    repickle(next(root.rglob("pkls.pkl")), lambda fits: fits.pop(f"{LOST:06d}.pkl"))


def lose_oakink(root: Path) -> None:
    """Nothing of the frame is there: the object's place is missing as well."""
    next(root.rglob(f"general_info/*__{LOST}__0.pkl")).unlink()


@pytest.mark.parametrize(
    ("name", "lose", "with_mano"),
    [
        ("hoi4d", lose_hoi4d, True),
        ("h2o", lose_h2o, True),
        ("dexycb", lose_dexycb, True),
        ("dexycb", lose_dexycb_label, False),
        ("hocap", lose_hocap, True),
        ("hot3d", lose_hot3d, True),
        ("ho3d", lose_ho3d, True),
        ("oakink2", lose_oakink2, True),
        ("aria", lose_aria, False),
        ("aria", doubt_aria, False),
        ("landmarks", lose_landmarks, False),
        ("hamer", lose_hamer, False),
        ("fphab", lose_fphab, True),
    ],
    ids=lambda value: getattr(value, "__name__", str(value)),
)
def test_a_missing_hand_is_a_masked_frame(name, lose, with_mano, tmp_path, mano_dir):
    case = written(name, tmp_path)
    lose(tmp_path)
    (recording,) = case.read(tmp_path, mano_dir if with_mano else None)
    hand = recording.sequence.hand("right")
    assert hand.valid.tolist() == [t != LOST for t in range(FRAMES)]
    for part in (hand.joints, hand.pose, hand.wrist):
        assert part is None or bool(part[LOST].isnan().all())
        assert part is None or bool(part[hand.valid].isfinite().all())
    for other in recording.sequence.hands:
        assert other.side == "right" or bool(other.valid.all())


def spoil_isEffective(root: Path) -> None:
    path = next(root.rglob(f"objpose/{LOST:05d}.json"))
    path.write_text(json.dumps({**json.loads(path.read_text()), "isEffective": 0}))


def spoil_objpose(root: Path) -> None:
    next(root.rglob(f"objpose/{LOST:05d}.json")).unlink()


def spoil_dexycb(root: Path) -> None:
    path = next(root.rglob("pose.npz"))
    with np.load(path) as file:
        arrays = dict(file)
    arrays["pose_y"][LOST] = [0, 0, 0, 1, 0, 0, 0]
    np.savez(path, **arrays)


def spoil_hocap(root: Path) -> None:
    change_array(next(root.rglob("poses_o.npy")), 1)


def spoil_hot3d(root: Path) -> None:
    path = next(root.rglob("dynamic_objects.csv"))
    lines = path.read_text().splitlines()
    del lines[1 + 4 * LOST : 5 + 4 * LOST]
    path.write_text("\n".join(lines))


def spoil_ho3d(root: Path) -> None:
    repickle(next(root.rglob(f"meta/{LOST:04d}.pkl")), lambda f: f.update(objRot=None))


def spoil_h2o(root: Path) -> None:
    path = next(root.rglob(f"obj_pose_rt/{LOST:06d}.txt"))
    path.write_text(" ".join(["0"] * 17))


def spoil_oakink2(root: Path) -> None:
    """The frame's number is left out of the list: time goes on, the data do not."""
    path = next(root.rglob("anno_preview/*.pkl"))
    frame = 100 + 4 * LOST

    def change(fields):
        fields["mocap_frame_id_list"].remove(frame)
        del fields["raw_mano"][frame]
        del fields["obj_transf"]["O02@0015@00001"][frame]

    repickle(path, change)


@pytest.mark.parametrize(
    ("name", "lose"),
    [
        ("hoi4d", spoil_isEffective),
        ("hoi4d", spoil_objpose),
        ("hoi4d_cases", lose_hoi4d_case),
        ("dexycb", spoil_dexycb),
        ("hocap", spoil_hocap),
        ("hot3d", spoil_hot3d),
        ("ho3d", spoil_ho3d),
        ("h2o", spoil_h2o),
        ("oakink", lose_oakink),
        ("oakink2", spoil_oakink2),
    ],
    ids=lambda value: getattr(value, "__name__", str(value)),
)
def test_a_missing_object_splits_the_recording(name, lose, tmp_path, mano_dir):
    case = written(name, tmp_path)
    lose(tmp_path)
    before, after = (recording.sequence for recording in case.read(tmp_path, mano_dir))
    assert (before.frames, after.frames) == (LOST, FRAMES - LOST - 1)
    for sequence in (before, after):
        assert bool(sequence.object.translation.isfinite().all())
        assert all(bool(hand.valid.all()) for hand in sequence.hands)
    expected = torch.from_numpy(scene().shift[LOST + 1]).float()
    torch.testing.assert_close(after.object.translation[0, 0], expected, atol=1e-5, rtol=0)


def test_an_object_that_changes_within_a_sequence_makes_recordings_of_each(tmp_path, mano_dir):
    case = written("h2o", tmp_path)
    trees.write_mesh(tmp_path / "object/cocoa/cocoa.obj", scene().verts, scene().faces)
    for t in range(5, FRAMES):
        path = next(tmp_path.rglob(f"obj_pose_rt/{t:06d}.txt"))
        path.write_text(" ".join(["6", *path.read_text().split()[1:]]))
    found = {each.name: each.sequence.frames for each in case.read(tmp_path, mano_dir)}
    assert found == {
        "subject1/h1/0/cam4_milk_00000": 5,
        "subject1/h1/0/cam4_cocoa_00005": FRAMES - 5,
    }


@pytest.mark.parametrize(
    "change",
    [lambda clip: shifted(clip), lambda clip: numbered(clip)],
    ids=["a jump of the hand", "frame numbers that go on elsewhere"],
)
def test_a_clip_is_cut_where_time_jumps(change, tmp_path, mano_dir):
    LEFT_CLIPS.write(tmp_path)
    path = next(tmp_path.rglob("7.npy"))
    np.save(path, change(np.load(path)))
    first, second = LEFT_CLIPS.read(tmp_path, mano_dir)
    assert [first.sequence.frames, second.sequence.frames] == [4, FRAMES - 4]
    assert [first.name[-6:], second.name[-6:]] == ["_00000", "_00004"]


def shifted(clip: np.ndarray) -> np.ndarray:
    """The hand stands 49 mm aside, as it does in the middle of GeneOH's clip 14."""
    clip = clip.copy()
    clip["f0"][4:] += np.tile([0.049, 0, 0], 778).astype("f4")
    return clip


def numbered(clip: np.ndarray) -> np.ndarray:
    """As clips of two sequences are numbered, with ten between them."""
    clip = clip.copy()
    clip["f8"][4:] += 10
    return clip


def test_a_whole_split_is_no_clip(tmp_path, mano_dir):
    LEFT_CLIPS.write(tmp_path)
    path = next(tmp_path.rglob("7.npy"))
    clip = np.load(path)
    clip["f7"][5:] = 0
    np.save(path, clip)
    with pytest.raises(InputError, match="one object in all frames"):
        LEFT_CLIPS.read(tmp_path, mano_dir)


def test_a_slow_clip_is_not_cut():
    steady = np.ones(FRAMES, dtype=bool)
    assert stretches(steady, np.zeros(FRAMES, dtype=bool)) == [slice(0, FRAMES)]
    jump = np.arange(FRAMES) == 4
    assert stretches(steady, jump) == [slice(0, 4), slice(4, FRAMES)]
    assert stretches(~jump, jump) == [slice(0, 4), slice(5, FRAMES)]


def test_the_error_of_arctics_fit_is_carried_as_confidence(tmp_path, mano_dir):
    (recording,) = written("arctic", tmp_path).read(tmp_path, mano_dir)
    trust = recording.sequence.hand("right").confidence
    error = 1.0 + np.arange(FRAMES)
    expected = np.minimum(1, np.median(error) / error)
    np.testing.assert_allclose(trust, np.tile(expected[:, None], 21), rtol=1e-6)


@pytest.mark.parametrize("lost", [np.nan, 0.0])
def test_parameters_of_a_missing_frame_have_no_betas(lost, tmp_path):
    rows = np.random.default_rng(0).standard_normal((3, 61))
    rows[1] = lost
    np.save(tmp_path / "hand.npy", rows)
    sequence = geneoh.read("parameters", tmp_path, side="left", translation="wrist")
    np.testing.assert_allclose(sequence.hands[0].betas, rows[::2, 51:].mean(0), rtol=1e-5)
    assert sequence.hands[0].valid.tolist() == [True, not np.isnan(lost), True]


def test_of_two_detections_the_one_that_goes_on_is_taken(tmp_path):
    value = hamer_dump(tmp_path)
    # A stranger's right hand, a metre aside, comes first in every frame but the first.
    rows = torch.nonzero((value["right"] > 0.5) & (value["frame"] > 0))[:, 0]
    order = torch.cat([rows, torch.arange(len(value["right"]))])
    for name in [name for name in value if name != "pred_mano_params"]:
        value[name] = value[name][order].clone()
    value["pred_mano_params"] = {n: v[order] for n, v in value["pred_mano_params"].items()}
    value["pred_cam"][: len(rows), 1] += 1.0
    torch.save(value, tmp_path / "video.pt")
    (recording,) = HAMER.read(tmp_path, None)
    wanted = torch.from_numpy(scene(HAMER.left).wrist["right"]).float()
    torch.testing.assert_close(recording.sequence.hand("right").wrist, wanted, atol=1e-5, rtol=0)


def test_hands_of_both_sides_need_the_numbers_of_their_images(tmp_path):
    value = hamer_dump(tmp_path)
    del value["frame"]
    torch.save(value, tmp_path / "video.pt")
    with pytest.raises(InputError, match="'frame' must be the number of each row's image"):
        HAMER.read(tmp_path, None)


def test_nothing_at_all_is_refused(tmp_path, mano_dir):
    case = written("hoi4d", tmp_path)
    for path in tmp_path.rglob("*.pickle"):
        path.unlink()
    with pytest.raises(InputError, match="expected a hand in some frame, got none"):
        case.read(tmp_path, mano_dir)


def renumber_oakink2(root: Path, step: int) -> Case:
    """OakInk2's tree, whose frames from LOST on are `step` numbers of the capture later."""
    case = written("oakink2", root)

    def change(fields) -> None:
        old = fields["mocap_frame_id_list"]
        later = {number: number + step * (place >= LOST) for place, number in enumerate(old)}
        fields["mocap_frame_id_list"] = list(later.values())
        for name in ("raw_mano", *fields["obj_list"]):
            place = fields if name in fields else fields["obj_transf"]
            place[name] = {later[number]: value for number, value in place[name].items()}

    repickle(next(root.rglob("anno_preview/*.pkl")), change)
    return case


def test_frames_of_oakink2_behind_an_uneven_step_are_kept(tmp_path, mano_dir):
    (recording,) = renumber_oakink2(tmp_path, 1).read(tmp_path, mano_dir)
    assert recording.sequence.frames == FRAMES
    assert all(bool(hand.valid.all()) for hand in recording.sequence.hands)


def test_frames_of_oakink2_that_would_be_lost_are_told(tmp_path, mano_dir):
    case = renumber_oakink2(tmp_path, -3)
    with pytest.raises(InputError, match="'mocap_frame_id_list' must be frame numbers about 4"):
        case.read(tmp_path, mano_dir)


def test_frames_of_taco_go_by_their_numbers(tmp_path, mano_dir):
    case = written("taco", tmp_path)
    path = next(tmp_path.rglob("right_hand.pkl"))
    frames = list(pickle.loads(path.read_bytes()).values())
    numbered = {str(8 + t): frame for t, frame in enumerate(frames) if t != LOST}
    path.write_bytes(pickle.dumps(numbered))
    found = [recording.sequence.hands[0] for recording in case.read(tmp_path, mano_dir)]
    (right,) = (hand for hand in found if hand.side == "right")
    wanted = torch.from_numpy(scene(case.left).wrist["right"]).float()
    wanted[LOST] = torch.nan
    torch.testing.assert_close(right.wrist, wanted, atol=1e-5, rtol=0, equal_nan=True)


def dumped_by_image(root: Path) -> dict[str, Any]:
    """The right hand's detections one file an image, of which one has none; what it holds."""
    value = hamer_dump(root)
    (root / "video.pt").unlink()
    frame, right = value.pop("frame"), value["right"] > 0.5
    params, kept = value.pop("pred_mano_params"), {}
    for t in range(FRAMES):
        rows = torch.nonzero(right & (frame == t) & (t != LOST))[:, 0]
        kept = {n: v[rows] for n, v in value.items()}
        kept["pred_mano_params"] = {n: v[rows] for n, v in params.items()}
        torch.save(kept, root / f"{t:06d}.pt")
    return kept


def test_a_file_of_an_image_without_a_hand_is_a_frame_without_it(tmp_path):
    dumped_by_image(tmp_path)
    (recording,) = HAMER.read(tmp_path, None)
    valid = recording.sequence.hand("right").valid
    assert valid.tolist() == [frame != LOST for frame in range(FRAMES)]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda held: held.pop("right"), "'right' must be an array of numbers, got none"),
        (lambda held: held.update(right=[5.0]), "'right' must be 1 for a right hand and 0 for a"),
        (lambda held: held.update(frame=[-1]), "'frame' must be a frame's number, 0 to 300000"),
        (lambda held: held["pred_mano_params"].pop("betas"), "'betas' must be an array"),
        (lambda held: held["pred_cam"].neg_(), "'pred_cam' must be a positive scale and two"),
        (
            lambda held: held["pred_mano_params"]["hand_pose"].mul_(2),
            "'hand_pose' must be rotation matrices with .*, got .* in row 0",
        ),
    ],
)
def test_a_wrong_dump_is_told_how_to_be_made(tmp_path, change, expected):
    held = dumped_by_image(tmp_path)
    change(held)
    torch.save(held, tmp_path / f"{FRAMES - 1:06d}.pt")
    with pytest.raises(InputError, match=f"{expected}.*; dump the estimator's output as the page"):
        HAMER.read(tmp_path, None)


def test_rows_that_do_not_say_their_image_are_told(tmp_path):
    value = hamer_dump(tmp_path)
    right = value.pop("right") > 0.5
    del value["frame"]
    params = {n: v[right] for n, v in value.pop("pred_mano_params").items()}
    one = {"pred_mano_params": params, "right": torch.ones(int(right.sum()))}
    torch.save({n: v[right] for n, v in value.items()} | one, tmp_path / "video.pt")
    (recording,) = HAMER.read(tmp_path, None)
    assert "no 'frame'" in recording.sequence.source


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"version": 2}, "'version' must be 1, got int 2; write it as the page on estimators says"),
        ({"hands": {"both": []}}, "'hands' must be a dict with 'right', 'left' or both, got"),
        ({"hands": {"right": [None] * 3, "left": []}}, "got 3 right, 0 left; write null in frames"),
        ({"fps": "30"}, "'fps' must be .*, got text '30'; write it as the page on estimators says"),
    ],
)
def test_wrong_landmarks_of_our_own_format_are_told_how_to_be_written(tmp_path, change, expected):
    case = written("landmarks", tmp_path)
    path = tmp_path / "hands.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(InputError, match=expected):
        case.read(tmp_path, None)


def test_a_hawor_dump_of_other_values_is_told_what_it_holds(tmp_path):
    (tmp_path / "world_space_res.pth").write_bytes(pickle.dumps([np.zeros(3)] * 4))
    with pytest.raises(InputError, match="five arrays of HaWoR's world result, got a list of 4; "):
        case_of("hawor").read(tmp_path, None)


@pytest.fixture
def later(tmp_path):
    """A dump of HaMeR whose frames begin at number 5."""
    value = hamer_dump(tmp_path)
    value["frame"] += 5
    torch.save(value, tmp_path / "video.pt")
    return tmp_path


def poses_of(frames: int) -> np.ndarray:
    """Poses that tell the numbers of their frames, all near the hand."""
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, 0, 3] = 0.001 * np.arange(frames)
    return poses


def test_poses_of_other_frames_are_told_the_numbers_of_the_frames(later):
    words = f"numbers 5 to {FRAMES + 4}, got {FRAMES + 4}; cut"
    with pytest.raises(InputError, match=words):
        geneoh.read("hamer", later, object_pose=poses_of(FRAMES + 4))


@pytest.mark.parametrize("more", [0, 3])
def test_of_poses_of_the_whole_video_those_of_the_frames_are_taken(later, more):
    count = FRAMES + 5 + more
    read = geneoh.read("hamer", later, object_pose=poses_of(count))
    found = read.object.translation[:, 0, 0].numpy()
    np.testing.assert_allclose(found, 0.001 * np.arange(5, FRAMES + 5), atol=1e-6)
    words = f"of the object's {count} poses those of frames 5 to {FRAMES + 4}, counted from 0"
    assert words in read.source


def test_as_many_poses_with_other_numbers_are_told(later):
    (later / "poses").mkdir()
    for number, pose in enumerate(poses_of(FRAMES)):
        np.savetxt(later / "poses" / f"{number + 2:06d}.txt", pose)
    read = geneoh.read("hamer", later / "video.pt", object_pose=later / "poses")
    assert "begin with frame 2 and the hand with 5: taken one for each frame" in read.source


@pytest.mark.parametrize("first", [0, 3, 5])
def test_texts_of_poses_are_taken_by_their_numbers(later, first):
    (later / "poses").mkdir()
    for number, pose in enumerate(poses_of(FRAMES + 5)):
        if number >= first and number != 6:
            np.savetxt(later / "poses" / f"{number:06d}.txt", pose)
    read = geneoh.read("hamer", later / "video.pt", object_pose=later / "poses")
    found = read.object.translation[:, 0, 0].numpy()
    np.testing.assert_allclose(found, 0.001 * np.arange(5, FRAMES + 5), atol=1e-6)
    assert read.object.valid[:, 0].tolist() == [number != 6 for number in range(5, FRAMES + 5)]


def test_texts_from_a_later_number_on_lack_the_first_poses_of_the_hand(later):
    (later / "poses").mkdir()
    for number in range(6, FRAMES + 5):
        np.savetxt(later / "poses" / f"{number}.txt", np.eye(4))
    found = geneoh.read("hamer", later / "video.pt", object_pose=later / "poses").object
    assert found.valid[:, 0].tolist() == [False] + [True] * (FRAMES - 1)
    np.savetxt(later / "poses" / f"{FRAMES + 5}.txt", np.eye(4))
    (later / "poses" / "6.txt").unlink()
    with pytest.raises(InputError, match=f"got {FRAMES - 1} from number 7 on; cut"):
        geneoh.read("hamer", later / "video.pt", object_pose=later / "poses")


def test_a_hidden_file_among_the_meshes_does_not_shift_their_numbers(tmp_path, mano_dir):
    """With one, the mug of a clip became the apple before it in the listing."""
    LEFT_CLIPS.write(tmp_path)
    next(tmp_path.rglob("mug.ply")).with_name(".DS_Store").touch()
    (recording,) = LEFT_CLIPS.read(tmp_path, mano_dir)
    assert recording.mesh_names == ("grab_mug",)
