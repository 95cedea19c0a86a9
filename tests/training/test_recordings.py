"""Clips that are cut out of recordings, and the shards that keep them."""

import os
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import short_clips
import torch
from trees import case_of, landmarks, scene, write_mano
from trees.writers import write_mesh

import geneoh
from geneoh.errors import InputError
from geneoh.files.tensors import opened_tensors
from geneoh.geometry.mirror import mirror_points, mirror_rotations
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.readers.base import ReaderOptions
from geneoh.sequence.sequence import ObjectTrack
from geneoh.synthesis.motions.motion import Interactions
from geneoh.synthesis.shards import read_shard
from geneoh.training import recordings
from geneoh.training.recordings import ClipConfig, make_shards, recorded_shard, spans
from tools.noisy_objects.clips import large

EXAMPLES = Path(__file__).parents[2] / "examples"
SHORT = ClipConfig(shortest=5, longest=20, points=48)


def joints_of(clips: Interactions) -> torch.Tensor:
    """Keypoints (B, T, 21, 3) of clips."""
    turns = axis_angle_to_matrix(clips.pose)
    return forward_kinematics(turns, clips.wrist, clips.offsets[:, None])[0]


def cut(source: str, path: Path, folder: Path, config: ClipConfig = SHORT, **known):
    """The shards of a source, which must all be readable."""
    shards, problems = make_shards(source, path, folder, config, ReaderOptions(**known))
    assert problems == []
    return shards


def files_in(shard: Path) -> dict[str, tuple[int, str]]:
    """The files that a shard was made from, by their names."""
    with opened_tensors(shard) as (_, record):
        return record["files"]


@pytest.fixture
def example(tmp_path) -> Path:
    """A folder with the example recording and its mesh, in the layout in which TACO's come."""
    folder = tmp_path / "one"
    folder.mkdir()
    shutil.copy(EXAMPLES / "taco_object.obj", folder / "object.obj")
    with np.load(EXAMPLES / "taco_clean.npz") as file:
        rotation, translation = file["object_rotation"][:, 0], file["object_translation"][:, 0]
        pose = np.tile(np.eye(4), (len(rotation), 1, 1))
        pose[:, :3, :3], pose[:, :3, 3] = rotation, translation
        names = {"pose": "hand_pose", "wrist": "hand_trans", "joints": "hand_joints"}
        hand = {name: file[f"left_{field}"] for field, name in names.items()}
    np.savez(folder / "sequence.npz", **hand, obj_pose=pose, side="left", fps=30)
    return folder


def arrays_of(example: Path) -> dict[str, np.ndarray]:
    """What the example recording holds, to be changed and written again."""
    with np.load(example / "sequence.npz") as file:
        return dict(file)


@pytest.mark.parametrize(
    "source", ["taco", "arctic", "grab", "h2o", "dexycb", "oakink2", "hocap", "hot3d"]
)
def test_clips_of_a_data_set_hold_its_hands_as_right_ones(source, tmp_path):
    case = case_of(source)
    step = 4 if source == "grab" else 1  # 120 frames a second
    s = scene(case.left, 8 * step + 1)
    (tmp_path / "data").mkdir()
    case.build(tmp_path / "data", s, False)
    mano = write_mano(tmp_path / "mano")
    known = case.options(tmp_path / "data")
    (shard,) = cut(source, tmp_path / "data" / case.start, tmp_path / "out", mano_dir=mano, **known)
    record, clips = recorded_shard(shard), read_shard(shard)
    assert sum(record.left_out.values()) == 0
    assert clips.rotation.shape[1:3] == (20, 2)
    assert clips.points.shape[1:] == (48, 3)
    assert bool((clips.part.amax(1) == case.parts - 1).all())
    for one, joints in zip(record.clips, joints_of(clips), strict=True):
        side = "left" if "_left_" in one.name else "right"
        wanted = torch.from_numpy(case.expected(s).joints[side][::step]).float()
        wanted = mirror_points(wanted) if side == "left" else wanted
        first = int(one.name[-5:])
        within = 4e-3 if step > 1 else 2e-3  # frames of a higher rate are means
        torch.testing.assert_close(
            joints[: one.length], wanted[first : first + one.length], atol=within, rtol=0
        )


def test_a_recording_is_cut_where_the_hand_is_near_and_seen(example, tmp_path):
    arrays = arrays_of(example)
    for name in ("hand_pose", "hand_trans", "hand_joints"):
        arrays[name][80:83] = np.nan
    np.savez(example / "sequence.npz", **arrays)
    (shard,) = cut("sequences", example, tmp_path / "out", ClipConfig(shortest=30, longest=60))
    record, clips = recorded_shard(shard), read_shard(shard)
    assert record.left_out["without the hand"] == 3
    lengths = [clip.length for clip in record.clips]
    assert sum(lengths) + sum(record.left_out.values()) == 146
    assert all(30 <= length <= 60 for length in lengths)
    truth = geneoh.load(EXAMPLES / "taco_clean.npz").hands[0].joints
    for one, joints, wrist in zip(record.clips, joints_of(clips), clips.wrist, strict=True):
        first = int(one.name[-5:])
        assert not {80, 81, 82} & set(range(first, first + one.length))
        wanted = mirror_points(truth[first : first + one.length])
        torch.testing.assert_close(joints[: one.length], wanted, atol=5e-3, rtol=0)
        assert wrist[one.length :].equal(wrist[one.length - 1].expand(60 - one.length, 3))


def test_frames_in_which_no_keypoint_has_confidence_are_left_out(tmp_path):
    recording = geneoh.load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")
    confidence = torch.ones(146, 21)
    confidence[80:83] = 0
    hand = replace(recording.hands[0], confidence=confidence)
    geneoh.save(replace(recording, hands=(hand,)), tmp_path / "sequence.npz")
    (shard,) = cut("sequences", tmp_path, tmp_path / "out", ClipConfig(shortest=30))
    record = recorded_shard(shard)
    assert record.left_out["without the hand"] == 3


def test_frames_without_a_pose_of_the_object_are_left_out(example, tmp_path):
    arrays = arrays_of(example)
    arrays["obj_pose"][70] = np.nan
    np.savez(example / "sequence.npz", **arrays)
    (shard,) = cut("sequences", example, tmp_path / "out", ClipConfig(shortest=30))
    record = recorded_shard(shard)
    assert record.left_out["without the object"] == 1
    for one in record.clips:
        first = int(one.name[-5:])
        assert 70 not in range(first, first + one.length)


def test_the_part_that_the_hand_holds_comes_first_as_in_cleaning(tmp_path):
    recording = geneoh.load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")
    held = recording.object
    beside = torch.ones(146, 1, 3), torch.eye(3).expand(146, 1, 3, 3)
    both = ObjectTrack(
        held.meshes * 2,
        torch.cat([beside[1], held.rotation], dim=1),
        torch.cat([beside[0], held.translation], dim=1),
    )
    geneoh.save(replace(recording, object=both), tmp_path / "sequence.npz")
    (shard,) = cut("sequences", tmp_path, tmp_path / "out", ClipConfig(shortest=30))
    record, clips = recorded_shard(shard), read_shard(shard)
    for one, rotation in zip(record.clips, clips.rotation, strict=True):
        first = int(one.name[-5:])
        wanted = mirror_rotations(held.rotation[first : first + one.length, 0])
        torch.testing.assert_close(rotation[: one.length, 0], wanted)


def test_points_of_a_large_object_are_where_the_hand_is_as_in_cleaning(tmp_path):
    small, away = short_clips.example(), []
    for name, recording in (("small", small), ("large", large(small))):
        path = tmp_path / f"{name}.npz"
        geneoh.save(recording, path)
        (mesh,) = recording.object.meshes
        write_mesh(path.with_suffix(".obj"), mesh.verts.numpy(), mesh.faces.numpy())
        (shard,) = cut("sequences", path, tmp_path / "out", ClipConfig())
        clips = read_shard(shard)
        assert clips.points.shape == (2, 512, 3)
        beside = joints_of(clips) - clips.translation[:, :, :1]
        seen = beside @ clips.rotation[:, :, 0]
        away.append(float(torch.cdist(seen.flatten(1, 2), clips.points).amin(2).mean()))
    assert away[1] < away[0] + 0.002  # spread over all of it, they would be 15 mm farther


def test_other_frame_rates_are_brought_to_thirty(example, tmp_path):
    np.savez(example / "sequence.npz", **arrays_of(example) | {"fps": np.array(60.0)})
    (shard,) = cut("sequences", example, tmp_path / "out", ClipConfig(shortest=30))
    record = recorded_shard(shard)
    frames = sum(clip.length for clip in record.clips) + sum(record.left_out.values())
    assert frames == 73


def test_a_hand_of_keypoints_alone_is_given_a_pose(example, tmp_path):
    arrays = arrays_of(example)
    kept = {name: arrays[name] for name in ("hand_joints", "obj_pose", "side", "fps")}
    arrays = {name: v[60:80] if v.ndim > 1 else v for name, v in kept.items()}
    np.savez(example / "sequence.npz", **arrays)
    (shard,) = cut("sequences", example, tmp_path / "out")
    wanted = mirror_points(torch.from_numpy(arrays["hand_joints"]).float())
    error = (joints_of(read_shard(shard))[0] - wanted).norm(dim=-1)
    assert float(error.mean()) < 0.008


@pytest.mark.parametrize(
    ("kept", "wanted"),
    [
        ([(0, 9)], [(0, 9)]),
        ([(0, 4)], []),
        ([(1, 20)], [(1, 6), (7, 7), (14, 6)]),
        ([(0, 11)], [(0, 6), (6, 5)]),
        ([(0, 6), (7, 14)], [(0, 6), (7, 7)]),
    ],
)
def test_stretches_are_cut_into_equal_clips_of_allowed_length(kept, wanted):
    mask = torch.zeros(20, dtype=torch.bool)
    for start, stop in kept:
        mask[start:stop] = True
    left_out: Counter[str] = Counter()
    config = ClipConfig(shortest=5, longest=9)
    assert list(spans(mask, config, left_out)) == wanted
    assert sum(left_out.values()) + sum(length for _, length in wanted) == int(mask.sum())


def test_frames_that_no_clip_of_allowed_length_has_room_for_are_counted():
    left_out: Counter[str] = Counter()
    mask = torch.ones(8, dtype=torch.bool)
    assert list(spans(mask, ClipConfig(shortest=5, longest=7), left_out)) == [(0, 7)]
    assert left_out.total() == 1


def test_a_second_run_reads_what_the_first_one_made(example, tmp_path):
    (shard,) = cut("sequences", example, tmp_path / "out")
    made = shard.stat().st_mtime_ns
    os.utime(example / "sequence.npz")  # newer, but with the same contents
    cut("sequences", example, tmp_path / "out")
    assert shard.stat().st_mtime_ns == made


@pytest.mark.parametrize("change", ["file", "config", "version", "broken"])
def test_a_shard_of_other_files_or_settings_is_made_again(example, tmp_path, change, monkeypatch):
    (shard,) = cut("sequences", example, tmp_path / "out")
    config, made = SHORT, shard.stat().st_mtime_ns
    if change == "file":
        arrays = arrays_of(example).items()
        fewer = {name: v[:100] if v.ndim > 1 else v for name, v in arrays}
        np.savez(example / "sequence.npz", **fewer)
    elif change == "config":
        config = ClipConfig(shortest=6, longest=20, points=48)
    elif change == "version":
        monkeypatch.setattr(recordings, "FORMAT", recordings.FORMAT + 1)
    else:
        shard.write_bytes(b"half of it")
    (again,) = cut("sequences", example, tmp_path / "out", config)
    assert again.stat().st_mtime_ns != made
    with opened_tensors(again) as (_, record):
        assert record["config"]["shortest"] == config.shortest
    assert [size for size, _ in files_in(again).values()] == [
        (example / name).stat().st_size for name in ("sequence.npz", "object.obj")
    ]


def test_clips_are_cut_again_by_mano_where_they_were_cut_without(example, tmp_path):
    arrays, mano = arrays_of(example), write_mano(tmp_path / "mano")
    pose = arrays["hand_pose"]
    smplx = {"global_orient": pose[:, :3], "hand_pose": pose[:, 3:], "transl": arrays["hand_trans"]}
    smplx |= {"side": "left", "fps": 30.0, "obj_pose": arrays["obj_pose"]}
    np.savez(example / "sequence.npz", **smplx)
    (shard,) = cut("sequences", example, tmp_path / "out")
    before = read_shard(shard).pose
    np.savez(example / "sequence.npz", flat_hand_mean=False, **smplx)
    for _ in ("first", "again"):
        made = shard.stat().st_mtime_ns
        (shard,) = cut("sequences", example, tmp_path / "out", mano_dir=mano)
        assert "MANO_LEFT.pkl" in files_in(shard)
    assert shard.stat().st_mtime_ns == made
    assert not torch.equal(read_shard(shard).pose, before)


def test_clips_of_one_name_in_several_folders_are_all_cut(example, tmp_path):
    for number, part in enumerate(("x/1", "y/1", "x_1/one", "x/1_one")):
        shutil.copytree(example, tmp_path / "many" / part)
        arrays = arrays_of(example)
        arrays["obj_pose"][:, 0, 3] += number
        for name in ("hand_trans", "hand_joints"):
            arrays[name] = arrays[name] + np.float32([number, 0, 0])
        np.savez(tmp_path / "many" / part / "sequence.npz", **arrays)
    for _ in ("first", "again"):
        shards = cut("sequences", tmp_path / "many", tmp_path / "out")
        places = sorted(round(float(read_shard(shard).translation[0, 0, 0, 0])) for shard in shards)
        assert [place - places[0] for place in places] == [0, 1, 2, 3]


def test_a_shard_is_made_again_where_its_mesh_has_changed(example, tmp_path):
    (shard,) = cut("sequences", example, tmp_path / "out")
    before, mesh = read_shard(shard).points, example / "object.obj"
    lines = [line.split() for line in mesh.read_text().splitlines()]
    for line in lines:
        if line[:1] == ["v"]:
            line[1:4] = [str(0.9 * float(number)) for number in line[1:4]]
    mesh.write_text("\n".join(map(" ".join, lines)))
    (shard,) = cut("sequences", example, tmp_path / "out")
    size, smaller = (points[0].abs().amax() for points in (before, read_shard(shard).points))
    assert float(smaller / size) == pytest.approx(0.9, abs=0.03)


def test_a_shard_is_made_again_where_another_file_was_moved_to_its_place(example, tmp_path):
    (shard,) = cut("sequences", example, tmp_path / "out")
    place, before = example / "sequence.npz", read_shard(shard).wrist
    arrays = arrays_of(example)
    for name in ("hand_trans", "hand_joints"):
        arrays[name] = arrays[name] + np.float32([0.01, 0, 0])
    np.savez(tmp_path / "other.npz", **arrays)
    assert (tmp_path / "other.npz").stat().st_size == place.stat().st_size
    os.utime(tmp_path / "other.npz", (0, 0))
    (tmp_path / "other.npz").replace(place)
    (shard,) = cut("sequences", example, tmp_path / "out")
    assert not read_shard(shard).wrist.equal(before)


def test_a_shard_is_made_again_where_a_clip_of_a_file_for_each_frame_has_changed(tmp_path):
    case = case_of("oakink")
    case.build(tmp_path / "data", scene(case.left, 9), False)
    start = tmp_path / "data" / case.start
    (shard,) = cut("oakink", start, tmp_path / "out")
    before = read_shard(shard).wrist
    for file in start.rglob("general_info/*__8__0.pkl"):
        file.unlink()
    (shard,) = cut("oakink", start, tmp_path / "out")
    assert not read_shard(shard).wrist.equal(before)


@pytest.mark.parametrize(
    ("source", "changed"),
    [("dexycb", "extrinsics.yml"), ("hoi4d", "3.pickle"), ("hocap", "subject_1.yaml")],
)
def test_a_shard_is_made_again_where_a_file_beside_its_clip_has_changed(source, changed, tmp_path):
    case, data = case_of(source), tmp_path / "data"
    case.build(data, scene(case.left, 9), False)
    known = {"mano_dir": write_mano(tmp_path / "mano"), **case.options(data)}
    times = []
    for _ in ("first", "again", "changed"):
        if len(times) == 2:
            (file, *_) = data.rglob(changed)
            file.write_bytes(file.read_bytes() + b"\n")
        (shard, *_) = cut(source, data / case.start, tmp_path / "out", **known)
        times.append(shard.stat().st_mtime_ns)
    assert times[0] == times[1] != times[2]


def test_what_cannot_be_read_is_told_and_the_rest_is_used(example, tmp_path):
    (example / "broken.npz").write_bytes(b"no archive")
    shards, problems = make_shards("sequences", example, tmp_path / "out", SHORT, ReaderOptions())
    assert len(shards) == 1
    assert len(problems) == 1
    assert "broken: not read," in problems[0]


def test_of_several_meshes_in_a_folder_the_one_of_a_file_s_name_is_its_own(example, tmp_path):
    for name in ("sequence", "other"):
        shutil.copy(example / "object.obj", example / f"{name}.obj")
    (shard,) = cut("sequences", example, tmp_path / "out")
    assert str(example / "sequence.obj") in files_in(shard)


def test_a_hand_without_an_object_is_to_be_converted_with_one(tmp_path):
    landmarks(tmp_path, scene(), False)
    with pytest.raises(InputError, match=r"got 0; .*`geneoh convert --obj` .* sequences=FOLDER"):
        make_shards("landmarks", tmp_path, tmp_path / "out", SHORT, ReaderOptions())


def test_where_no_clip_can_be_read_their_number_is_told(tmp_path):
    for name in ("first", "second"):
        (tmp_path / f"{name}.npz").write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"first: not read, .* \(none of 2 clips can be read\)"):
        make_shards("sequences", tmp_path, tmp_path / "out", SHORT, ReaderOptions())


def test_a_source_without_anything_to_read_is_refused(example, tmp_path):
    (example / "object").mkdir()
    (example / "object.obj").rename(example / "object" / "object.obj")
    with pytest.raises(InputError, match="names no mesh, expected one of its name"):
        make_shards("sequences", example, tmp_path / "out", SHORT, ReaderOptions())
    with pytest.raises(InputError, match="expected npz files of sequences"):
        make_shards("sequences", example / "object", tmp_path, SHORT, ReaderOptions())
