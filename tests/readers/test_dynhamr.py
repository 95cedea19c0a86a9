"""Dyn-HaMR's runs: which file is read, which frames were detected, and where the camera was."""

import json

import numpy as np
import pytest
import trimesh
from trees import FRAMES, case_of

import geneoh
from geneoh.errors import InputError

CASE = case_of("dynhamr")
RUN = "logs/video-0"
LAST = f"{RUN}/smooth_fit/video_000300_world_results.npz"


@pytest.fixture
def run(tmp_path):
    CASE.write(tmp_path)
    return tmp_path


def change(path, **fields):
    with np.load(path) as file:
        arrays = {**file, **fields}
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})


def change_info(run, change):
    path = run / RUN / "track_info.json"
    info = json.loads(path.read_text())
    change(info)
    path.write_text(json.dumps(info))


def test_the_last_step_of_the_last_phase_is_the_clip(run):
    (clip,) = CASE.clips(run)
    assert clip.path == (run / LAST).resolve()
    assert clip.name == "video_000300_world_results"


def test_a_file_of_an_earlier_phase_is_read_where_it_is_named(run):
    early = geneoh.read("dynhamr", run / RUN / "init/video_000000_init_world_results.npz")
    late = geneoh.read("dynhamr", run)
    shift = early.hand("right").wrist - late.hand("right").wrist
    np.testing.assert_allclose(shift, 1, atol=1e-5)


def test_frames_without_a_detection_were_not_observed(run):
    def hide(info):
        info["tracks"]["1"]["vis_mask"][3 + 2] = False  # the third frame of the hands

    change_info(run, hide)
    (recording,) = CASE.read(run, None)
    right, left = (recording.sequence.hand(side) for side in ("right", "left"))
    assert right.valid.tolist() == [True, True, False] + [True] * (FRAMES - 3)
    assert left.valid.all()


def test_zeros_where_a_track_has_not_begun_were_not_observed(run):
    (run / RUN / "track_info.json").unlink()
    with np.load(run / LAST) as file:
        pose = file["pose_body"].copy()
    pose[0, :2] = 0
    change(run / LAST, pose_body=pose)
    (recording,) = CASE.read(run, None)
    assert recording.sequence.hand("left").valid.tolist() == [False] * 2 + [True] * (FRAMES - 2)
    assert "frames in which no hand was detected count as seen" in recording.sequence.source


def test_poses_of_the_whole_video_are_cut_to_the_frames_of_the_hands(run):
    poses = np.tile(np.eye(4), (60, 1, 1))
    poses[:, :3, 3] = [0.0, 0.2, 0.9]
    poses[:, 0, 3] = np.arange(60) / 1000
    mesh = run / "box.obj"
    trimesh.creation.box((0.05, 0.05, 0.05)).export(mesh)
    read = geneoh.read("dynhamr", run, obj=mesh, object_pose=poses)
    placed = read.object.translation[:, 0, 0]
    np.testing.assert_allclose(placed, np.arange(43, 43 + FRAMES) / 1000, atol=1e-6)


def test_tracks_of_other_frames_are_left_out_and_told(run):
    change_info(run, lambda info: info["meta"].update(seq_interval=[0, FRAMES + 1]))
    (recording,) = CASE.read(run, None)
    assert "track_info.json is left out: it is of other frames" in recording.sequence.source


def test_fingers_may_be_in_rows_and_the_camera_unknown(run):
    (whole,) = CASE.read(run, None)
    with np.load(run / LAST) as file:
        rows = file["pose_body"].reshape(2, FRAMES, 15, 3)
    change(run / LAST, pose_body=rows, cam_R=None, cam_t=None)
    (recording,) = CASE.read(run, None)
    right = recording.sequence.hand("right")
    assert right.camera_ray is None
    assert right.pose.equal(whole.sequence.hand("right").pose)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"is_right": np.ones((2, FRAMES))}, "'is_right' must be of one track at most for each"),
        ({"trans": np.ones((2, FRAMES - 1, 3))}, "'trans' must be of 2 tracks and 9 frames"),
        ({"betas": np.ones((2, 9))}, r"'betas' must be numbers of shape \(2, 10\)"),
        ({"cam_t": np.full((2, FRAMES, 3), np.nan)}, "'cam_t': expected a camera's pose that can"),
        ({"cam_R": np.ones((2, FRAMES, 3, 3))}, "'cam_R' must be rotation matrices"),
        ({"is_right": None}, "'is_right' must be an array of numbers, got none"),
    ],
)
def test_a_wrong_field_is_named(run, fields, words):
    change(run / LAST, **fields)
    with pytest.raises(InputError, match=words):
        CASE.read(run, None)


@pytest.mark.parametrize(
    ("meta", "words"),
    [
        ({"seq_interval": [5, 5]}, "'seq_interval' must be the numbers of the first frame and"),
        ({"data_interval": [0]}, "'data_interval' must be the numbers of the first frame and"),
    ],
)
def test_wrong_intervals_are_named(run, meta, words):
    change_info(run, lambda info: info["meta"].update(meta))
    with pytest.raises(InputError, match=words):
        CASE.read(run, None)


def test_a_mask_that_is_too_short_is_named(run):
    change_info(run, lambda info: info["tracks"]["0"].update(vis_mask=[True] * 4))
    with pytest.raises(InputError, match="'tracks' must be of tracks whose 'vis_mask' has 12"):
        CASE.read(run, None)
