"""Whole data sets into sequences: what cannot be read is told, and the rest goes on."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch
import trees
from bad_inputs import good_arrays
from trees import FRAMES, dump, grab, hoi4d, scene, taco

from geneoh.errors import InputError
from geneoh.files.journal import only_run_in
from geneoh.geometry.mesh_files import load_mesh
from geneoh.hand.library import load_hand
from geneoh.readers import convert as convert_module
from geneoh.readers import recordings as recordings_module
from geneoh.readers.base import ReaderOptions, Recording
from geneoh.readers.checks.convention import contradictions
from geneoh.readers.convert import convert, notes_on
from geneoh.readers.npz.files import load
from geneoh.readers.pose_matching import PoseTrack
from geneoh.readers.recordings import find_clips, read_one, source_named
from geneoh.readers.sources import landmarks
from geneoh.sequence.sequence import Sequence

EXAMPLE = "examples/taco_clean.npz"


def run(name, folder, out, known, **options):
    source = source_named(name)
    return list(convert(source, find_clips(source, [folder], out), out, known, **options))


def test_what_is_written_reads_back_with_its_meshes(tmp_path, mano_dir):
    s = scene()
    taco(tmp_path / "in", s, False)
    known, out = ReaderOptions(mano_dir=mano_dir), tmp_path / "out"
    (outcome,) = run("taco", tmp_path / "in", out, known)
    assert len(outcome.files) == 2
    for file in outcome.files:
        sequence = load(out / file)
        torch.testing.assert_close(
            sequence.object.meshes[0].verts, torch.from_numpy(s.verts).float(), atol=1e-7, rtol=0
        )
        assert "TACO (stir, spoon, bowl)" in sequence.source


def test_one_bad_clip_does_not_stop_the_others_and_a_second_run_does_only_what_is_left(
    tmp_path, mano_dir, monkeypatch
):
    grab(tmp_path / "in", scene(), False)
    bad = tmp_path / "in/grab/s1/bad_use_1.npz"
    bad.write_bytes(b"PK\x03\x04 nothing")
    known, out = ReaderOptions(mano_dir=mano_dir), tmp_path / "out"
    first, second = run("grab", tmp_path / "in/grab", out, known)
    assert "bad_use_1.npz" in (first.problem or "")
    assert second.files == ("s1/mug_drink_1.npz",)
    assert not list(out.rglob("*.tmp"))
    calls = []
    real = convert_module.read_clip
    monkeypatch.setattr(convert_module, "read_clip", lambda *a: calls.append(a[1].name) or real(*a))
    _, again = run("grab", tmp_path / "in/grab", out, known)
    assert again.skipped
    assert calls == ["s1/bad_use_1"]


def test_a_clip_that_contradicts_its_convention_is_not_written_when_checked(tmp_path, mano_dir):
    grab(tmp_path / "in", scene(), True)
    (outcome,) = run(
        "grab", tmp_path / "in/grab", tmp_path / "out", ReaderOptions(mano_dir=mano_dir), check=True
    )
    assert outcome.contradictions
    assert not list((tmp_path / "out").rglob("*.npz"))


def test_a_clip_that_was_checked_is_not_checked_again(tmp_path, mano_dir):
    grab(tmp_path / "in", scene(), False)
    clips = "grab", tmp_path / "in/grab", tmp_path / "out", ReaderOptions(mano_dir=mano_dir)
    skipped = [run(*clips, check=check)[0].skipped for check in (False, True, True, False)]
    assert skipped == [False, False, True, True]


def test_a_mesh_that_cleaning_will_refuse_by_its_size_is_told():
    sequence = load(EXAMPLE, obj="examples/taco_object.obj")
    assert list(notes_on(Recording("clip", sequence))) == [sequence.source]
    (mesh,) = sequence.object.meshes
    tiny = replace(sequence.object, meshes=(replace(mesh, verts=0.001 * mesh.verts),))
    recording = Recording("clip", replace(sequence, object=tiny))
    source, told = notes_on(recording)
    assert source == sequence.source
    assert "too small for a hand: it looks scaled twice" in told


def test_missing_files_become_masks_and_splits_and_never_zeros(tmp_path, mano_dir):
    hoi4d(tmp_path, scene(), False)
    next(tmp_path.rglob("refinehandpose_right/**/2.pickle")).unlink()
    next(tmp_path.rglob("objpose/00005.json")).unlink()
    source = source_named("hoi4d")
    (clip,) = find_clips(source, [tmp_path])
    before, after = recordings_module.read_clip(source, clip, ReaderOptions(mano_dir=mano_dir))
    right = before.sequence.hand("right")
    assert right.valid.tolist() == [True, True, False, True, True]
    assert bool(right.joints[2].isnan().all())
    assert (before.sequence.frames, after.sequence.frames) == (5, FRAMES - 6)
    assert before.name.endswith("_00000")
    assert after.name.endswith("_00006")


def test_exchanged_parts_of_an_object_of_one_part_are_told_to_change_nothing(tmp_path, mano_dir):
    hoi4d(tmp_path / "whole", scene(), False)
    trees.hoi4d_cases(tmp_path / "cases", scene(), False)
    swapped = ReaderOptions(mano_dir=mano_dir, swap_parts=True)
    for name, folder in (("hoi4d", "whole"), ("hoi4d_cases", "cases")):
        source = read_one(name, tmp_path / folder, swapped).sequence.source
        assert "--swap-parts changes nothing about this object: it has one part" in source
        plain = read_one(name, tmp_path / folder, replace(swapped, swap_parts=False))
        assert "--swap-parts" not in plain.sequence.source


def test_without_mano_the_wrist_is_that_of_the_mean_hand_and_a_relative_pose_is_refused(
    tmp_path, mano_dir
):
    grab(tmp_path, scene(), False)
    recording = read_one("grab", tmp_path / "grab", ReaderOptions())
    assert "some 5 mm off" in recording.sequence.source
    assert recording.sequence.hand("right").joints is None
    assert recording.sequence.hand("right").hand_model == "mano"


def test_the_recording_and_its_simplified_pickle_are_one_sequence(tmp_path, pytestconfig):
    root = pytestconfig.rootpath
    mesh = load_mesh(root / "examples/taco_object.obj")
    clean = load(root / EXAMPLE, obj=(mesh,))
    hand, motion = clean.hand("left"), clean.object
    pose = torch.eye(4).repeat(clean.frames, 1, 1)
    pose[:, :3, :3], pose[:, :3, 3] = motion.rotation[:, 0], motion.translation[:, 0]
    arrays = {
        "hand_pose": hand.pose.reshape(-1, 48).numpy(),
        "hand_trans": hand.wrist.numpy(),
        "hand_shape": hand.betas.numpy(),
        "hand_joints": hand.joints.numpy(),
        "obj_pose": pose.numpy(),
    }
    np.savez(tmp_path / "sequence.npz", side="left", fps=30.0, **arrays)
    shaped = load_hand("left").shaped(torch.zeros(10))
    arrays["hand_verts"] = shaped.posed(hand.pose, hand.wrist).verts.numpy()
    arrays["obj_verts"] = (mesh.verts @ motion.rotation[:, 0].mT + motion.translation).numpy()
    arrays["obj_faces"] = mesh.faces.numpy().astype(np.int32)
    dump(tmp_path / "20231104_017.pkl", arrays)
    from_names = load(tmp_path / "sequence.npz", obj=(mesh,))
    recording = read_one("taco_pickle", tmp_path / "20231104_017.pkl", ReaderOptions())
    assert contradictions(recording) == []
    for sequence in (from_names, recording.sequence):
        assert_same(sequence, clean)


def assert_same(sequence: Sequence, other: Sequence) -> None:
    (hand,), (wanted,) = sequence.hands, other.hands
    assert (hand.side, hand.hand_model, sequence.fps) == (wanted.side, wanted.hand_model, other.fps)
    for name in ("valid", "pose", "wrist", "betas", "joints"):
        torch.testing.assert_close(getattr(hand, name), getattr(wanted, name), atol=0, rtol=0)
    torch.testing.assert_close(sequence.object.rotation, other.object.rotation)
    torch.testing.assert_close(sequence.object.translation, other.object.translation)
    torch.testing.assert_close(
        sequence.object.meshes[0].verts, other.object.meshes[0].verts, atol=1e-6, rtol=0
    )


def moved_away(side: str):
    """The scene with one hand that hangs five metres aside."""
    s = scene()
    return replace(s, wrist={**s.wrist, side: s.wrist[side] + [5.0, 0.0, 0.0]})


def test_a_hand_that_never_comes_near_is_left_out_and_the_other_kept(tmp_path, mano_dir):
    grab(tmp_path, moved_away("left"), False)
    recording = read_one("grab", tmp_path / "grab", ReaderOptions(mano_dir=mano_dir))
    assert [hand.side for hand in recording.sequence.hands] == ["right"]
    assert "the left hand never comes near the object" in recording.sequence.source


def test_betas_that_are_no_numbers_are_refused(tmp_path, mano_dir):
    s = scene()
    betas = {**s.betas, "left": np.where(np.arange(10) == 3, 1e300, s.betas["left"])}
    grab(tmp_path, s, False)
    np.save(tmp_path / "tools/subject_meshes/male/s1_lhand_betas.npy", betas["left"])
    with pytest.raises(InputError, match=r"mug_drink_1\.npz: the betas of the left hand must be"):
        read_one("grab", tmp_path / "grab", ReaderOptions(mano_dir=mano_dir))


def test_of_two_hands_the_asked_one_is_read(tmp_path, mano_dir):
    grab(tmp_path, scene(), False)
    recording = read_one("grab", tmp_path / "grab", ReaderOptions(mano_dir=mano_dir, side="left"))
    assert [hand.side for hand in recording.sequence.hands] == ["left"]
    trees.dexycb(tmp_path, scene(), False)
    with pytest.raises(InputError, match="expected a left hand, got right; drop --side"):
        read_one(
            "dexycb",
            tmp_path / "20200709-subject-01",
            ReaderOptions(mano_dir=mano_dir, side="left"),
        )


def test_of_a_clip_with_a_recording_for_each_hand_the_asked_one_is_read(tmp_path, mano_dir):
    trees.taco(tmp_path, scene(), False)
    for side in ("right", "left"):
        recording = read_one("taco", tmp_path, ReaderOptions(mano_dir=mano_dir, side=side))
        assert [hand.side for hand in recording.sequence.hands] == [side]
    left = ReaderOptions(mano_dir=mano_dir, side="left")
    with pytest.raises(InputError, match="expected a left hand, got right; drop --side"):
        read_one("taco", tmp_path, left, "_stir__spoon__bowl_/20230917_001_tool")


def test_a_rate_that_contradicts_the_one_in_the_file_is_refused(tmp_path, mano_dir):
    grab(tmp_path, scene(), False)
    with pytest.raises(InputError, match="says 120 frames a second, got --fps 30; drop one"):
        read_one("grab", tmp_path / "grab", ReaderOptions(mano_dir=mano_dir, fps=30.0))
    recording = read_one("grab", tmp_path / "grab", ReaderOptions(mano_dir=mano_dir, fps=120.0))
    assert recording.sequence.fps == 120


def test_clips_of_one_name_get_as_much_of_the_path_as_tells_them_apart(tmp_path):
    for name in ("a/take", "b/take", "b/other"):
        (tmp_path / name).mkdir(parents=True)
        trees.landmarks(tmp_path / name, scene(), False)
    np.save(tmp_path / "a/hand.npy", scene().joints["right"])
    np.savez(tmp_path / "a/hand.npz", joints=scene().joints["right"])
    found = [clip.name for clip in find_clips(source_named("landmarks"), [tmp_path])]
    assert found == ["a/take/hands", "other/hands", "b/take/hands"]
    (tmp_path / "b/hand.npz").write_bytes((tmp_path / "a/hand.npz").read_bytes())
    names = [clip.name for clip in find_clips(source_named("keypoints"), [tmp_path])]
    assert names == ["hand_npy", "hand_npz", "hand"]


def test_journals_of_geneoh_are_no_landmarks(tmp_path):
    trees.landmarks(tmp_path, scene(), False)
    made = run("landmarks", tmp_path, tmp_path / "out", ReaderOptions())
    again = run("landmarks", tmp_path, tmp_path / "out", ReaderOptions())
    assert [outcome.problem for outcome in (*made, *again)] == [None] * 2
    (tmp_path / "out" / "journal.jsonl").write_text("{}")
    assert len(find_clips(source_named("landmarks"), [tmp_path])) == 1


def test_sequences_of_an_earlier_conversion_below_the_path_are_no_clips(tmp_path):
    np.savez(tmp_path / "hand.npz", joints=scene().joints["right"], side="right")
    source, out = source_named("keypoints"), tmp_path / "out"
    for _ in range(2):
        clips = find_clips(source, [tmp_path], out)
        assert [clip.name for clip in clips] == ["hand"]
        assert not any(outcome.failed for outcome in convert(source, clips, out, ReaderOptions()))
    assert len(find_clips(source, [out], out)) == 1


def test_sequences_of_an_earlier_conversion_into_the_same_folder_are_no_clips(tmp_path):
    np.save(tmp_path / "hand.npy", scene().joints["right"])
    known = ReaderOptions(side="right", fps=30.0)
    for skipped in (False, True):
        (outcome,) = run("keypoints", tmp_path, tmp_path, known)
        assert (outcome.clip.name, outcome.skipped) == ("hand", skipped)


def test_other_options_are_another_conversion(tmp_path, mano_dir):
    taco(tmp_path / "in", scene(), False)
    out = tmp_path / "out"
    assert not run("taco", tmp_path / "in", out, ReaderOptions())[0].skipped
    assert run("taco", tmp_path / "in", out, ReaderOptions())[0].skipped
    (again,) = run("taco", tmp_path / "in", out, ReaderOptions(mano_dir=mano_dir))
    assert not again.skipped
    for file in again.files:
        assert load(out / file).hands[0].joints is not None


def keypoints(folder, **options) -> bool:
    """Convert the keypoints in a folder; whether they were done before."""
    known = ReaderOptions(**{"side": "right", "fps": 30.0, **options})
    (outcome,) = run("keypoints", folder / "hand.npy", folder / "out", known)
    assert not outcome.failed
    return outcome.skipped


def rate(folder) -> float:
    return load(folder / "out/hand.npz").fps


@pytest.fixture
def in_folder(tmp_path):
    """A folder with bare keypoints."""
    np.save(tmp_path / "hand.npy", scene().joints["right"])
    return tmp_path


def test_other_poses_of_the_callers_object_are_another_conversion(tmp_path):
    np.save(tmp_path / "hand.npy", good_arrays()["joints"])
    frames = len(good_arrays()["joints"])
    poses = np.tile(np.eye(4), (frames, 1, 1))
    times = np.arange(frames) / 30

    def again(**known):
        (outcome,) = run(
            "keypoints",
            tmp_path / "hand.npy",
            tmp_path / "out",
            ReaderOptions(side="right", object_pose=PoseTrack(poses, **known)),
        )
        return outcome.skipped

    assert [again(), again(), again(times=times), again(times=times)] == [False, True, False, True]
    poses[0, 0, 3] = 0.01
    assert not again(times=times)


def test_a_file_that_another_run_replaced_is_made_again(in_folder):
    assert not keypoints(in_folder)
    assert not keypoints(in_folder, fps=60.0)
    assert not keypoints(in_folder)
    assert rate(in_folder) == 30
    assert keypoints(in_folder)


def test_a_changed_input_is_another_conversion(in_folder):
    keypoints(in_folder)
    np.save(in_folder / "hand.npy", scene().joints["right"] + 0.1)
    assert not keypoints(in_folder)
    assert keypoints(in_folder)


@pytest.mark.parametrize(
    ("source", "changed"),
    [
        ("arctic", "box_grab_01.object.npy"),
        ("hoi4d", "3.pickle"),
        ("fphab", "object_pose.txt"),
        ("grab", "s1_rhand_betas.npy"),
    ],
)
def test_a_changed_file_beside_a_clip_is_another_conversion(source, changed, tmp_path, mano_dir):
    case = trees.case_of(source)
    case.build(tmp_path / "in", scene(case.left), False)
    known = ReaderOptions(mano_dir=mano_dir, **case.options(tmp_path / "in"))
    (file, *_) = (tmp_path / "in").rglob(changed)
    for skipped in (False, True):
        (outcome,) = run(source, tmp_path / "in" / case.start, tmp_path / "out", known)
        assert (outcome.skipped, outcome.problem) == (skipped, None)
    file.write_bytes(file.read_bytes() + b"\n")
    (outcome,) = run(source, tmp_path / "in" / case.start, tmp_path / "out", known)
    assert not outcome.skipped


def test_a_folder_of_frames_that_is_not_there_is_no_input(tmp_path, mano_dir):
    case = trees.case_of("hoi4d")
    case.build(tmp_path / "in", scene(case.left), False)
    shutil.rmtree(tmp_path / "in/handpose/refinehandpose_left")
    known = ReaderOptions(mano_dir=mano_dir, **case.options(tmp_path / "in"))
    for skipped in (False, True):
        (outcome,) = run("hoi4d", tmp_path / "in" / case.start, tmp_path / "out", known)
        assert (outcome.skipped, outcome.problem) == (skipped, None)


def test_a_clip_does_not_replace_the_result_of_another_one_of_its_name(tmp_path):
    out, known = tmp_path / "out", ReaderOptions(side="right")
    for place, shift in (("one", 0.0), ("other", 0.1)):
        (tmp_path / place / "day").mkdir(parents=True)
        np.save(tmp_path / place / "day/hand.npy", scene().joints["right"] + shift)
    (first,) = run("keypoints", tmp_path / "one/day", out, known)
    before = (out / first.files[0]).read_bytes()
    with pytest.raises(InputError, match=r"is that of the result of .*/one/day/hand.npy in "):
        run("keypoints", tmp_path / "other/day", out, known)
    assert (out / first.files[0]).read_bytes() == before
    (out / first.files[0]).unlink()
    (second,) = run("keypoints", tmp_path / "other/day", out, known)
    assert second.files == first.files


def test_half_a_line_of_a_crash_is_no_hindrance(in_folder):
    (in_folder / "out").mkdir()
    (in_folder / "out/converted.jsonl").write_text('{"clip": "ha')
    assert not keypoints(in_folder)
    assert keypoints(in_folder)


def test_a_journal_of_others_is_kept(in_folder):
    (in_folder / "out").mkdir()
    journal = in_folder / "out/converted.jsonl"
    journal.write_text("my notes\n")
    with pytest.raises(InputError, match=r"converted.jsonl: is there already and was not written"):
        keypoints(in_folder)
    assert journal.read_text() == "my notes\n"


def test_two_conversions_do_not_share_a_folder(in_folder):
    with only_run_in(in_folder / "out"), pytest.raises(InputError, match="another run is working"):
        keypoints(in_folder)


def test_another_mesh_of_the_same_name_does_not_stand_in(tmp_path, mano_dir):
    s = scene()
    known, out = ReaderOptions(mano_dir=mano_dir), tmp_path / "out"
    for size in (1.0, 1.5):
        shutil.rmtree(tmp_path / "in", ignore_errors=True)
        grab(tmp_path / "in", replace(s, verts=size * s.verts), False)
        run("grab", tmp_path / "in/grab", out, known)
    with np.load(out / "s1/mug_drink_1.npz") as arrays:
        (file,) = arrays["object_files"].tolist()
    assert file == "../objects/grab_mug_2.obj"
    (mesh,) = load(out / "s1/mug_drink_1.npz").object.meshes
    torch.testing.assert_close(mesh.verts, torch.from_numpy(1.5 * s.verts).float())
    assert sorted(path.name for path in (out / "objects").iterdir()) == [
        "grab_mug.obj",
        "grab_mug_2.obj",
    ]


def test_of_a_whole_data_set_nothing_is_read_before_one_is_chosen(tmp_path, monkeypatch):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        trees.landmarks(tmp_path / name, scene(), False)
    monkeypatch.setattr(recordings_module, "read_clip", lambda *_: pytest.fail("a clip was read"))
    with pytest.raises(InputError, match="got a/hands, b/hands; choose one with --clip"):
        read_one("landmarks", tmp_path, ReaderOptions())


def test_a_path_without_clips_is_refused(tmp_path):
    with pytest.raises(InputError, match="expected files of GRAB"):
        find_clips(source_named("grab"), [tmp_path])
    with pytest.raises(InputError, match="no such file or folder"):
        find_clips(source_named("grab"), [tmp_path / "nothing"])


@pytest.mark.parametrize("error", [AttributeError, KeyError, NameError, TypeError, ValueError])
def test_a_bug_of_a_reader_is_no_damaged_file(error, tmp_path, monkeypatch):
    trees.landmarks(tmp_path, scene(), False)

    def broken(*_):
        raise error("a bug")

    monkeypatch.setattr(landmarks, "landmarks", replace(landmarks.landmarks, parts=broken))
    with pytest.raises(error, match="a bug"):
        run("landmarks", tmp_path, tmp_path / "out", ReaderOptions())
    with pytest.raises(error, match="a bug"):
        read_one("landmarks", tmp_path, ReaderOptions())


def test_a_bug_of_the_convention_check_is_no_damaged_file(tmp_path, monkeypatch):
    trees.landmarks(tmp_path, scene(), False)

    def broken(_):
        raise TypeError("a bug")

    monkeypatch.setattr(convert_module, "contradictions", broken)
    with pytest.raises(TypeError, match="a bug"):
        run("landmarks", tmp_path, None, ReaderOptions(), check=True)
