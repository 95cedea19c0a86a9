"""Hands and object in the frame of a moving camera whose poses are known."""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import quick_presets
import torch
from short_clips import EXAMPLES, example

import geneoh
from geneoh.errors import InputError
from geneoh.evaluation import realism
from geneoh.evaluation.cases import Case
from geneoh.evaluation.protocols.clips import Clip
from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.objects.camera_motion import in_steady_world
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.pipeline.preparation import (
    CAMERA_CONTRADICTED,
    CAMERA_REMOVED,
    MOVING_CAMERA,
    OF_OTHER_POSES,
)
from geneoh.pipeline.streaming.stream import Stream
from geneoh.readers.base import ReaderOptions, SourceClip
from geneoh.seeds import seeded_generator
from geneoh.sequence.camera import seen_from
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.placing import camera_of, in_world, placed
from geneoh.sequence.resample import at_rate
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.training import recordings
from geneoh.training.recordings import ClipConfig
from geneoh.viz.scene import make_scene

FAST = Options(preset="fast")


def head(frames: int) -> Rigid:
    """Poses of a camera that turns and sways, camera to world."""
    time = torch.arange(frames) / 30
    waves = torch.stack([torch.sin(pace * time + pace) for pace in (2.1, 2.9, 3.7)], 1)
    return Rigid(axis_angle_to_matrix(math.radians(15) * waves), 0.05 * waves.flip(1))


def seen_by_head(world: Sequence) -> Sequence:
    """A sequence in the frame of the camera, which is known."""
    camera = head(world.frames)
    return replace(placed(world, camera.inverse()), camera_to_world=camera.matrices())


def joints_of(sequence: Sequence) -> torch.Tensor:
    return sequence.hands[0].joints


def in_the_world(sequence: Sequence) -> torch.Tensor:
    return camera_of(sequence.camera_to_world).apply(joints_of(sequence))


@pytest.fixture
def quick(monkeypatch):
    quick_presets.use(monkeypatch)


@pytest.fixture(scope="module")
def shaken() -> Sequence:
    """The recording with Gaussian noise, in its world."""
    return corrupt_sequence(example(), "gauss", generator=seeded_generator("camera poses"))


@pytest.mark.parametrize("with_object", [True, False])
@pytest.mark.parametrize("fps", [30.0, 60.0])
def test_the_result_is_that_of_the_world_in_the_frame_of_the_camera(
    quick, shaken, fps, with_object
):
    world = replace(shaken[40:100], fps=fps)
    if not with_object:
        world = replace(world, object=geneoh.ObjectTrack.resting((), world.frames))
    given = seen_by_head(world)
    found, wanted = denoise(given, FAST), denoise(world, FAST)
    moved = in_the_world(found.sequence) - joints_of(wanted.sequence)
    assert float(moved.norm(dim=-1).max()) < 5e-4
    assert found.sequence.camera_to_world.equal(given.camera_to_world)
    assert found.sequence.object.translation.equal(given.object.translation)
    assert found.sequence.object.rotation.equal(given.object.rotation)
    assert CAMERA_REMOVED in found.notes
    assert CAMERA_CONTRADICTED not in found.notes
    before, after = (result.hands["left"].after.acceleration_mm for result in (found, wanted))
    assert before == pytest.approx(after, abs=0.1)
    samples = found.hands["left"].samples
    assert float((samples[:, 0] - joints_of(found.sequence)[0]).norm(dim=-1).max()) < 0.1


def test_refined_poses_of_the_object_are_in_the_frame_of_the_camera(quick, shaken):
    world = shaken[40:100]
    shift = 0.004 * torch.randn(60, 1, 3, generator=seeded_generator("poses"))
    motion = replace(world.object, translation=world.object.translation + shift)
    world = replace(world, object=motion)
    refining = replace(FAST, refine_object=True)
    wanted = denoise(world, refining).sequence.object.translation
    found = denoise(seen_by_head(world), refining).sequence
    camera = camera_of(found.camera_to_world)
    assert float((wanted - motion.translation).norm(dim=-1).mean()) > 0.002
    assert float((camera.apply(found.object.translation) - wanted).norm(dim=-1).max()) < 1e-3


def test_an_object_that_is_lost_while_it_rests_stays_where_it_is_in_the_world():
    world = example()[:40]
    still = replace(world.object, translation=world.object.translation[:1].expand(40, -1, -1))
    given = seen_by_head(replace(world, object=still))
    seen = torch.ones(40, 1, dtype=torch.bool)
    seen[10:30] = False
    lost = given.object.translation.masked_fill(~seen[..., None], torch.nan)
    given = replace(given, object=replace(given.object, translation=lost, valid=seen))
    found = denoise(given, replace(FAST, samples=1, steps=1)).sequence
    places = camera_of(found.camera_to_world).apply(found.object.translation)
    assert float((places - still.translation).norm(dim=-1).max()) < 1e-4
    assert found.object.translation[seen].equal(given.object.translation[seen])


def test_noise_of_the_camera_does_not_shake_the_hand(shaken):
    world = shaken[40:100]
    generator = seeded_generator("camera noise")
    turn, shift = torch.randn(2, 60, 3, generator=generator)
    noise = Rigid(axis_angle_to_matrix(math.radians(0.3) * turn), 0.003 * shift)
    given = seen_by_head(world)
    tracked = noise.compose(camera_of(given.camera_to_world)).matrices()
    wanted = denoise(world, FAST).hands["left"].after.acceleration_mm
    found = denoise(replace(given, camera_to_world=tracked), FAST).sequence
    joints = camera_of(given.camera_to_world).apply(joints_of(found))
    # twice as large without smooth poses of the camera
    assert float(joints.diff(n=2, dim=0).norm(dim=-1).mean()) < 1.3e-3 * wanted
    assert found.camera_to_world.equal(tracked)


def test_poses_that_the_object_contradicts_are_told(quick):
    world = example()
    given = seen_by_head(world)
    inverted = replace(given, camera_to_world=given.camera_to_world.inverse())
    notes = denoise(inverted, FAST).notes
    assert CAMERA_CONTRADICTED in notes
    assert not any(MOVING_CAMERA in note for note in notes)


def test_a_file_keeps_the_poses_of_the_camera(tmp_path):
    given = seen_by_head(example()[:20])
    geneoh.save(given, tmp_path / "seen.npz")
    found = geneoh.load(tmp_path / "seen.npz")
    assert found.camera_to_world.equal(given.camera_to_world)
    assert found[5:9].camera_to_world.equal(given.camera_to_world[5:9])
    again = at_rate(at_rate(found, 60.0), 30.0)
    torch.testing.assert_close(again.camera_to_world, given.camera_to_world, atol=1e-5, rtol=0)
    assert not np.load(EXAMPLES / "taco_clean.npz").keys() & {"camera_to_world"}


@pytest.mark.parametrize("unit", [None, "mm"])
def test_the_poses_come_from_a_file_beside_the_hands(tmp_path, unit):
    given = seen_by_head(example()[:20])
    scale = 1 if unit is None else 1000
    scaled = given.camera_to_world.clone()
    scaled[:, :3, 3] *= scale
    np.save(tmp_path / "camera.npy", scaled.numpy())
    np.savez(tmp_path / "hand.npz", joints=scale * joints_of(given).numpy(), side="left", fps=30.0)
    np.save(tmp_path / "hand.npy", scale * joints_of(given).numpy())
    about = {"camera_pose": tmp_path / "camera.npy", "keypoint_unit": unit}
    for found in (
        geneoh.load(tmp_path / "hand.npz", **about),
        geneoh.load(tmp_path / "hand.npy", side="left", **about),
        geneoh.read("keypoints", tmp_path / "hand.npy", side="left", **about),
    ):
        torch.testing.assert_close(found.camera_to_world, given.camera_to_world)
        torch.testing.assert_close(joints_of(found), joints_of(given))


def test_the_poses_are_given_once(tmp_path):
    given = seen_by_head(example()[:20])
    geneoh.save(given, tmp_path / "seen.npz")
    with pytest.raises(InputError, match="the camera's motion must be given once, got"):
        geneoh.load(tmp_path / "seen.npz", camera_pose=given.camera_to_world.numpy())


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (
            lambda poses: poses[:-1],
            "the camera's poses must be one for each of the 20 frames, got 19",
        ),
        (lambda poses: poses.index_fill(0, torch.tensor([4]), torch.nan), "finite .* first is 4"),
        (lambda poses: poses.mT, "must be rigid motions from the camera to the world, got in fr"),
        (lambda poses: 1.1 * poses, "must be rigid motions from the camera to the world"),
        (lambda poses: 1e6 * poses, "within 10000 m of the origin"),
    ],
    ids=["fewer", "nan", "transposed", "scaled", "far"],
)
def test_poses_that_are_none_are_refused(spoil, words):
    given = seen_by_head(example()[:20])
    with pytest.raises(InputError, match=words):
        denoise(replace(given, camera_to_world=spoil(given.camera_to_world)), FAST)


def test_pictures_show_the_world(quick, shaken):
    world = shaken[40:60]
    given = seen_by_head(world)
    result = denoise(given, replace(FAST, samples=2))
    samples = {"left": result.hands["left"].samples}
    scene = make_scene({"before": given, "after": result.sequence}, samples=samples)
    still = make_scene({"before": world})
    (seen,), (wanted,) = scene.versions[0].hands, still.versions[0].hands
    assert float((seen.verts - wanted.verts).norm(dim=-1).max()) < 2e-3
    assert float((scene.object.translation - world.object.translation).norm(dim=-1).max()) < 1e-3
    middle = in_the_world(result.sequence).mean(1)
    assert float((scene.samples["left"].mean((0, 2)) - middle).norm(dim=-1).max()) < 0.05
    assert scene.means(scene.versions[1])["acceleration_mm"] == pytest.approx(
        result.hands["left"].after.acceleration_mm, abs=0.5
    )


@pytest.mark.parametrize("fps", [30.0, 50.0])
def test_a_stream_cleans_in_the_world(shaken, fps):
    world = replace(shaken[40:62], fps=fps)
    given = seen_by_head(world)

    def cleaned(clip: Sequence) -> torch.Tensor:
        stream, found = Stream(clip.object.meshes, fps, side="left"), []
        for frame in range(clip.frames):
            pose = clip.object.rotation[frame], clip.object.translation[frame]
            camera = None if clip.camera_to_world is None else clip.camera_to_world[frame]
            clean = stream.push(joints_of(clip)[frame], pose, camera_to_world=camera)
            found += [clean] if clean else []
        found += stream.flush()
        assert [clean.index for clean in found] == list(range(clip.frames))
        return torch.cat([clean.hand.joints for clean in found])

    moved = camera_of(given.camera_to_world).apply(cleaned(given)) - cleaned(world)
    assert float(moved.norm(dim=-1).max()) < 1e-3


def test_a_stream_has_a_camera_in_every_frame_or_in_none():
    stream, joints = Stream(side="left"), joints_of(example())
    with pytest.raises(InputError, match="'camera_to_world' must be numbers of shape"):
        stream.push(joints[0], camera_to_world=np.eye(3)[:2])
    with pytest.raises(InputError, match=r"shape \(T, 4, 4\) or .* got \(1, 2, 4, 4\)"):
        stream.push(joints[0], camera_to_world=np.stack([np.eye(4), np.eye(4)]))
    with pytest.raises(InputError, match="must be finite in every frame"):
        stream.push(joints[0], camera_to_world=np.full((4, 4), np.nan))
    stream.push(joints[0], camera_to_world=np.eye(4))
    with pytest.raises(InputError, match="in every frame or in none, got none after frames with"):
        stream.push(joints[1])
    stream.push(joints[1], camera_to_world=np.eye(4))
    stream.flush()
    stream.push(joints[0])
    with pytest.raises(InputError, match="got one after frames without"):
        stream.push(joints[1], camera_to_world=np.eye(4))


def test_the_world_of_the_camera_is_where_it_was():
    world = example()[:20]
    given = seen_by_head(world)
    found = in_world(given, camera_of(given.camera_to_world))
    assert found.camera_to_world is None
    torch.testing.assert_close(joints_of(found), joints_of(world), atol=1e-6, rtol=0)
    torch.testing.assert_close(
        found.object.translation, world.object.translation, atol=1e-6, rtol=0
    )


def turned_at(frame: int, by: float, frames: int) -> Rigid:
    """The poses of a camera that turns by an angle at once, as at a cut of the video."""
    camera = head(frames)
    turn = axis_angle_to_matrix(torch.tensor([0.0, by, 0.0]))
    return Rigid(
        torch.cat([camera.rotation[:frame], camera.rotation[frame:] @ turn]), camera.translation
    )


@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_a_cut_of_the_video_leaves_the_world_as_it_was(noise):
    world, true = example()[:60], turned_at(30, math.pi / 2, 60)
    turn, shift = noise * torch.randn(2, 60, 3, generator=seeded_generator("cut"))
    tracked = Rigid(axis_angle_to_matrix(turn), shift).compose(true).matrices()
    given = replace(placed(world, true.inverse()), camera_to_world=tracked)
    found = joints_of(in_steady_world(given))
    off = (found - joints_of(world)).norm(dim=-1)
    assert float(off.max()) < 1e-4 + 5 * noise  # 0.4 m beside the cut, smoothed across it


def test_a_track_that_starts_again_elsewhere_is_told(quick):
    given = seen_by_head(example()[:60])
    elsewhere = given.camera_to_world.clone()
    elsewhere[30:, :3, 3] += 0.5
    doubts = denoise(replace(given, camera_to_world=elsewhere), FAST).doubts
    assert any("leaps to another place before frame 30" in words for words in doubts)


def test_a_world_whose_origin_is_far_away_costs_no_digits(quick, shaken):
    given = seen_by_head(shaken[40:100])
    far = given.camera_to_world.clone()
    far[:, :3, 3] += 1000.0
    wanted, found = (
        denoise(replace(given, camera_to_world=poses), FAST)
        for poses in (given.camera_to_world, far)
    )
    assert found.doubts == wanted.doubts  # it was told to be 1732 m away
    off = (joints_of(found.sequence) - joints_of(wanted.sequence)).norm(dim=-1)
    assert float(off.mean()) < 2e-4
    assert found.sequence.camera_to_world.equal(far)


def test_poses_in_millimetres_are_told(quick):
    given = seen_by_head(example()[:20])
    given = replace(given, object=geneoh.ObjectTrack.resting((), 20))
    scaled = given.camera_to_world.clone()
    scaled[:, :3, 3] *= 1000
    notes = denoise(replace(given, camera_to_world=scaled), FAST).notes
    assert any("by its poses the camera moves" in note for note in notes)
    assert not any("the camera moves" in note for note in denoise(given, FAST).notes)


def test_the_rays_of_hands_whose_names_are_exchanged_are_exchanged_too(quick):
    left = HandTrack(
        side="left", valid=torch.ones(60, dtype=torch.bool), joints=joints_of(example()[:60])
    )
    right = left.mirrored()
    apart = joints_of(example()).mean((0, 1)) - right.joints.mean((0, 1))
    right = replace(right, joints=right.joints + apart + torch.tensor([0.15, 0.0, 0.0]))
    amid = (torch.arange(60) >= 20) & (torch.arange(60) < 40)
    one, other = (
        torch.where(amid[:, None, None], theirs, own)
        for own, theirs in ((left.joints, right.joints), (right.joints, left.joints))
    )
    hands = (replace(left, joints=one), replace(right, joints=other))
    world = Sequence(hands, geneoh.ObjectTrack.resting((), 60), 30.0)
    given = seen_from(seen_by_head(world), torch.zeros(1, 3), "the camera")
    for hand in denoise(given, FAST).sequence.hands:
        ahead = torch.nn.functional.normalize(hand.joints[:, 0], dim=-1)
        assert float((ahead * hand.camera_ray).sum(-1).min()) > math.cos(math.radians(5))


def test_poses_of_other_frames_are_not_saved(tmp_path):
    given = seen_by_head(example()[:20])
    other = replace(given, camera_to_world=given.camera_to_world[:19])
    with pytest.raises(InputError, match="one for each of the 20 frames, got 19"):
        geneoh.save(other, tmp_path / "seen.npz")


def test_a_stream_far_from_the_origin_of_the_world_loses_no_digits(shaken):
    given = seen_by_head(shaken[40:60])

    def cleaned(origin: float) -> torch.Tensor:
        stream, found = Stream((), 30.0, side="left"), []
        for joints, pose in zip(joints_of(given), given.camera_to_world.double(), strict=True):
            pose = pose.clone()
            pose[:3, 3] += origin
            clean = stream.push(joints, camera_to_world=pose.numpy())
            found += [clean] if clean else []
        return torch.cat([clean.hand.joints for clean in found + stream.flush()])

    assert float((cleaned(4e3) - cleaned(0.0)).norm(dim=-1).max()) < 1e-5


@pytest.fixture
def seen_file(tmp_path) -> Path:
    geneoh.save(seen_by_head(example()[:20]), tmp_path / "clip_gauss_1.npz")
    return tmp_path / "clip_gauss_1.npz"


def assert_in_world(found: Sequence) -> None:
    torch.testing.assert_close(joints_of(found), joints_of(example()[:20]), atol=1e-4, rtol=0)


def test_predictions_for_a_clip_are_scored_in_its_world(seen_file):
    clip = Clip("clip", partial(example().__getitem__, slice(0, 20)))
    assert_in_world(Case("taco", clip, "gauss", 1, stored=seen_file.parent).noisy)


def test_clips_to_learn_from_are_cut_in_the_world(seen_file, monkeypatch):
    seen: list[Sequence] = []
    monkeypatch.setattr(recordings, "normalised_hands", lambda given: seen.append(given) or [])
    clip = SourceClip("clip", seen_file)
    recordings.cut_clip("sequences", clip, ClipConfig(), ReaderOptions())
    assert_in_world(seen[0])


def test_a_recording_is_compared_with_synthetic_clips_in_the_world(seen_file, monkeypatch):
    monkeypatch.setattr(realism, "recorded_clip", lambda given, _: assert_in_world(given))
    monkeypatch.setattr(realism, "synthetic_clips", lambda *_, **__: None)
    report = realism.RealismReport((), {}, {}, {}, (0, 0), 0)
    monkeypatch.setattr(realism, "compare_clips", lambda *_: report)
    realism.measure_realism(geneoh.load(seen_file), seen_file.parent)


def held(frames: int) -> torch.Tensor:
    """The frame whose pose is taken in each frame, as from a sensor of a third of the rate."""
    return torch.arange(frames) // 3 * 3


def test_poses_of_a_slower_camera_are_interpolated():
    world = example()[:90]
    given = seen_by_head(world)
    slower = replace(given, camera_to_world=given.camera_to_world[held(90)])
    off = (joints_of(in_steady_world(slower)) - joints_of(world)).norm(dim=-1)
    assert float(off[:-3].mean()) < 2e-3  # 12 mm, where they are held and smoothed


def test_poses_of_a_slower_camera_are_not_interpolated_across_a_cut():
    world, true = example()[:90], turned_at(45, math.pi / 2, 90)
    tracked = true.matrices()[held(90)]
    given = replace(placed(world, true.inverse()), camera_to_world=tracked)
    off = (joints_of(in_steady_world(given)) - joints_of(world)).norm(dim=-1).mean(-1)
    assert float(off[40:50].max()) < 0.03  # the last pose before it is held; 0.6 across the cut


def test_poses_of_an_object_that_repeat_in_the_frame_of_the_camera_count_as_missing(quick):
    world = example()[20:110]
    given = seen_by_head(world)
    still, turning = (
        replace(
            clip,
            object=replace(
                clip.object,
                rotation=clip.object.rotation[held(90)],
                translation=clip.object.translation[held(90)],
            ),
        )
        for clip in (world, given)
    )
    wanted, found = denoise(still, FAST), denoise(turning, FAST)
    assert any("repeats the one before" in note for note in found.notes)
    assert not any("without a pose" in note for note in found.notes)
    assert OF_OTHER_POSES in found.notes
    assert not any("the pose of the object shakes" in note for note in found.notes)
    off = (in_the_world(found.sequence) - joints_of(wanted.sequence)).norm(dim=-1)
    assert float(off.mean()) < 1e-3
    assert found.sequence.object == turning.object
    trusted = denoise(turning, replace(FAST, trust_object=True))
    assert not any("repeats the one before" in note for note in trusted.notes)
