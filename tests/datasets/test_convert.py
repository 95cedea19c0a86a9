"""Whole data sets into sequences: what cannot be read is told, and the rest goes on."""

import numpy as np
import pytest
import torch
from trees import FRAMES, dump, grab, hoi4d, scene, taco

from geneoh.datasets import convert as module
from geneoh.datasets.base import Known
from geneoh.datasets.convert import convert, find_clips, read_one, source_named
from geneoh.datasets.selftest import contradictions
from geneoh.errors import InputError
from geneoh.geometry.mesh import load_mesh
from geneoh.hand.library import load_hand
from geneoh.sequence.files import load_sequence
from geneoh.sequence.tracks import Sequence

EXAMPLE = "examples/taco_clean.npz"


def run(name, folder, out, known, **options):
    source = source_named(name)
    return list(convert(source, find_clips(source, [folder]), out, known, **options))


def test_what_is_written_reads_back_with_its_meshes(tmp_path, mano_dir):
    s = scene()
    taco(tmp_path / "in", s, False)
    known, out = Known(mano_dir=mano_dir), tmp_path / "out"
    (outcome,) = run("taco", tmp_path / "in", out, known)
    assert len(outcome.files) == 2
    for file in outcome.files:
        with np.load(out / file) as arrays:
            meshes = tuple(load_mesh(out / name) for name in arrays["object_files"].tolist())
        sequence = load_sequence(out / file, meshes)
        torch.testing.assert_close(
            meshes[0].verts, torch.from_numpy(s.verts).float(), atol=1e-7, rtol=0
        )
        assert "TACO (stir, spoon, bowl)" in sequence.source


def test_one_bad_clip_does_not_stop_the_others_and_a_second_run_does_only_what_is_left(
    tmp_path, mano_dir, monkeypatch
):
    grab(tmp_path / "in", scene(), False)
    bad = tmp_path / "in/grab/s1/bad_use_1.npz"
    bad.write_bytes(b"PK\x03\x04 nothing")
    known, out = Known(mano_dir=mano_dir), tmp_path / "out"
    first, second = run("grab", tmp_path / "in/grab", out, known)
    assert "bad_use_1.npz" in (first.problem or "")
    assert second.files == ("s1/mug_drink_1.npz",)
    assert not list(out.rglob("*.tmp"))
    calls = []
    real = module.read_clip
    monkeypatch.setattr(module, "read_clip", lambda *a: calls.append(a[1].name) or real(*a))
    _, again = run("grab", tmp_path / "in/grab", out, known)
    assert again.skipped
    assert calls == ["s1/bad_use_1"]


def test_a_clip_that_contradicts_its_convention_is_not_written_when_checked(tmp_path, mano_dir):
    grab(tmp_path / "in", scene(), True)
    (outcome,) = run(
        "grab", tmp_path / "in/grab", tmp_path / "out", Known(mano_dir=mano_dir), check=True
    )
    assert outcome.contradictions
    assert not (tmp_path / "out").exists()


def test_missing_files_become_masks_and_splits_and_never_zeros(tmp_path, mano_dir):
    hoi4d(tmp_path, scene(), False)
    next(tmp_path.rglob("refinehandpose_right/**/2.pickle")).unlink()
    next(tmp_path.rglob("objpose/00005.json")).unlink()
    source = source_named("hoi4d")
    (clip,) = find_clips(source, [tmp_path])
    before, after = module.read_clip(source, clip, Known(mano_dir=mano_dir))
    right = before.sequence.hand("right")
    assert right.valid.tolist() == [True, True, False, True, True]
    assert bool(right.joints[2].isnan().all())
    assert (before.sequence.frames, after.sequence.frames) == (5, FRAMES - 6)
    assert before.name.endswith("_00000")
    assert after.name.endswith("_00006")


def test_without_mano_the_wrist_is_that_of_the_mean_hand_and_a_relative_pose_is_refused(
    tmp_path, mano_dir
):
    grab(tmp_path, scene(), False)
    recording = read_one("grab", tmp_path / "grab", Known())
    assert "some 5 mm off" in recording.sequence.source
    assert recording.sequence.hand("right").joints is None
    assert recording.sequence.hand("right").hand_model == "mano"


def test_the_recording_and_its_simplified_pickle_are_one_sequence(tmp_path, pytestconfig):
    root = pytestconfig.rootpath
    mesh = load_mesh(root / "examples/taco_object.obj")
    clean = load_sequence(root / EXAMPLE, (mesh,))
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
    from_names = load_sequence(tmp_path / "sequence.npz", (mesh,))
    recording = read_one("taco_pickle", tmp_path / "20231104_017.pkl", Known())
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


def test_a_path_without_clips_is_refused(tmp_path):
    with pytest.raises(InputError, match="expected files of GRAB"):
        find_clips(source_named("grab"), [tmp_path])
    with pytest.raises(InputError, match="no such file or folder"):
        find_clips(source_named("grab"), [tmp_path / "nothing"])
