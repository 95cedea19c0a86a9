"""The whole way of the data, on the example recording with the shipped weights."""

import math
from dataclasses import replace

import numpy as np
import pytest
import quick_presets
import torch
import trees

import geneoh
from geneoh.denoisers.library import SHIPPED
from geneoh.errors import CheckpointError, InputError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.metrics.smoothness import finite_difference, valid_differences
from geneoh.nn.checkpoint import load_checkpoint, save_checkpoint
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.pipeline.presets import preset
from geneoh.pipeline.results import Denoised
from geneoh.sequence.resample import at_rate
from geneoh.sequence.sequence import HandTrack, ObjectTrack
from geneoh.sequence.windows import WINDOW, window_starts

FAST = Options(preset="fast")


def joints_of(result: Denoised) -> torch.Tensor:
    """Keypoints of the first cleaned hand."""
    joints = result.sequence.hands[0].joints
    assert joints is not None
    return joints


def acceleration(joints: torch.Tensor) -> torch.Tensor:
    """Mean acceleration of each inner frame, metres per frame squared."""
    return joints.diff(n=2, dim=0).norm(dim=-1).mean(-1)


@pytest.fixture(scope="module")
def whole(noisy) -> Denoised:
    """All 146 frames cleaned by the default preset: three windows and a bit."""
    return denoise(noisy)


def test_the_result_tells_how_far_keypoints_moved_on_average_and_at_most(noisy, whole):
    (hand,) = whole.hands.values()
    apart = (hand.track.joints - noisy.hands[0].joints).norm(dim=-1)[~hand.filled]
    assert hand.moved == pytest.approx(float(apart.mean()), rel=1e-3)
    assert hand.moved_most == pytest.approx(float(apart.mean(-1).max()), rel=1e-3)


def test_a_hand_in_no_frame_of_a_part_is_left_out_in_words(noisy):
    part, hand = noisy[:10], noisy.hands[0][:10]
    unseen = replace(hand.mirrored(), valid=torch.zeros_like(hand.valid))
    found = denoise(replace(part, hands=(unseen, hand)), FAST)
    assert found.doubts[0] == "the right hand is in no frame and was left out"
    assert found.sequence == denoise(part, FAST).sequence


def test_a_pose_with_manos_betas_in_memory_gets_its_keypoints_by_mano(noisy, tmp_path):
    folder = trees.write_mano(tmp_path / "mano")
    short = noisy[:20]
    bare = replace(
        short.hands[0], joints=None, confidence=None, betas=torch.ones(10), hand_model="mano"
    )
    shaped = load_hand("left", source="mano", mano_dir=folder).shaped(bare.betas)
    joints = shaped.joints_from_rotations(axis_angle_to_matrix(bare.pose), bare.wrist)
    options = Options(preset="fast", mano_dir=folder)
    found, told = (
        denoise(replace(short, hands=(hand,)), options).sequence.hands[0].joints
        for hand in (bare, replace(bare, joints=joints))
    )
    assert torch.equal(found, told)
    alone = denoise(replace(short, hands=(bare,)), preset="fast").sequence.hands[0].joints
    assert float((alone - told).norm(dim=-1).mean()) > 0.002


def test_a_file_of_someone_else_is_replaced_only_on_demand(noisy, tmp_path):
    np.savez(tmp_path / "mine.npz", mine=np.ones(3))
    with pytest.raises(InputError, match="was not written by geneoh; pass overwrite=True"):
        geneoh.save(noisy, tmp_path / "mine.npz")
    geneoh.save(noisy, tmp_path / "mine.npz", overwrite=True)
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(InputError, match="expected the name of a file, got a folder"):
        geneoh.save(noisy, tmp_path / "folder.npz")
    geneoh.save(noisy, tmp_path / "mine.npz")


def test_every_second_frame_of_a_result_comes_at_half_the_rate(noisy):
    assert Denoised(noisy, {}, ())[::2].sequence.fps == 15


@pytest.mark.slow
def test_noisy_recording_gets_nearer_to_the_truth_smoother_and_shallower(whole, noisy, clean):
    truth, before = clean.hands[0].joints, noisy.hands[0].joints
    error = (joints_of(whole) - truth).norm(dim=-1).mean()
    assert error < 0.75 * (before - truth).norm(dim=-1).mean()
    hand = whole.hands["left"]
    assert hand.after.acceleration_mm < 0.5 * hand.before.acceleration_mm
    assert hand.after.penetration_mean_mm < hand.before.penetration_mean_mm


def test_windows_leave_no_seam(whole):
    jerky = acceleration(joints_of(whole))
    borders = torch.zeros(len(jerky), dtype=torch.bool)
    starts = window_starts(146)
    assert len(starts) > 2
    for border in [*starts[1:], *(start + WINDOW for start in starts[:-1])]:
        borders[border - 3 : border + 2] = True
    assert jerky[borders].mean() < 1.5 * jerky[~borders].mean()


def test_result_is_one_hand_that_its_parameters_make(whole):
    from geneoh.hand.library import load_hand

    hand = whole.sequence.hands[0]
    assert hand.hand_model == "embedded"
    posed = load_hand("left").shaped(hand.betas).posed(hand.pose, hand.wrist)
    assert torch.allclose(posed.joints, hand.joints, atol=1e-5)
    assert torch.isfinite(posed.verts).all()


def test_spread_over_samples_is_reported_per_joint_and_frame(whole):
    spread = whole.sequence.hands[0].joint_spread
    assert spread.shape == (146, 21)
    assert (spread > 0).all()
    assert spread.mean() < 0.03


def test_mirrored_input_gives_mirrored_output(noisy):
    left = noisy[40:60]
    right = replace(
        left,
        hands=tuple(hand.mirrored() for hand in left.hands),
        object=left.object.mirrored(),
    )
    a, b = denoise(left, FAST), denoise(right, FAST)
    assert b.sequence.hands[0].side == "right"
    mirrored = b.sequence.hands[0].mirrored()
    assert torch.allclose(a.sequence.hands[0].joints, mirrored.joints, atol=1e-5)
    assert torch.allclose(a.sequence.hands[0].pose, mirrored.pose, atol=1e-3)


@pytest.mark.parametrize("start", [30, 60, 90])
def test_rigidly_moved_scene_gives_the_rigidly_moved_result(noisy, start):
    from geneoh.geometry.rotations import axis_angle_to_matrix

    short = noisy[start : start + 20]
    turn, shift = axis_angle_to_matrix(torch.tensor([0.3, -0.8, 0.5])), torch.tensor([0.4, 1, -0.2])
    hand, moving = short.hands[0], short.object
    moved = replace(
        short,
        hands=(HandTrack(hand.side, hand.valid, joints=hand.joints @ turn.T + shift),),
        object=ObjectTrack(
            moving.meshes, turn @ moving.rotation, moving.translation @ turn.T + shift
        ),
    )
    still = replace(short, hands=(HandTrack(hand.side, hand.valid, joints=hand.joints),))
    a, b = denoise(still, FAST), denoise(moved, FAST)
    stages = [result.hands["left"].samples[0] for result in (a, b)]
    # where gradients cancel, the steps of the alignment's Adam are as large as rounding makes them:
    # without TemporalDiff the stages agree within 1e-6, but for one shift of the whole hand by some
    # micrometres: SpatialDiff's density is steep, and rounding moves its mean. Rounding decides on
    # the last steps of the fit to the keypoints, too
    apart = ((stages[0] @ turn.T + shift) - stages[1]).norm(dim=-1)
    assert apart.median() < 3e-5
    assert (apart > 1e-4).float().mean() < 0.01
    assert apart.max() < 5e-4
    # a vertex as deep under one face as under another may leave by either, and rounding decides: in
    # half of such pieces a few keypoints then differ by millimetres
    apart = ((joints_of(a) @ turn.T + shift) - joints_of(b)).norm(dim=-1)
    assert apart.median() < 1e-4
    assert (apart > 1e-3).float().mean() < 0.1
    assert apart.max() < 0.015


def test_keypoints_alone_are_enough(noisy, clean):
    short, truth = noisy[40:70], clean[40:70].hands[0].joints
    hand = short.hands[0]
    bare = replace(short, hands=(HandTrack(hand.side, hand.valid, joints=hand.joints),))
    result = denoise(bare, FAST)
    before = (hand.joints - truth).norm(dim=-1).mean()
    assert (joints_of(result) - truth).norm(dim=-1).mean() < before
    assert result.sequence.hands[0].pose is not None


def test_a_vertex_of_no_face_changes_nothing(noisy):
    short, (mesh,) = noisy[40:70], noisy.object.meshes
    far = torch.cat([mesh.verts, torch.tensor([[5.0, 5.0, 5.0]])])
    more = replace(short, object=replace(short.object, meshes=(geneoh.Mesh(far, mesh.faces),)))
    assert torch.equal(joints_of(denoise(short, FAST)), joints_of(denoise(more, FAST)))


@pytest.mark.parametrize("frames", [1, 2, 20])
def test_short_tracks_work(noisy, frames):
    result = denoise(noisy[60 : 60 + frames], FAST)
    assert joints_of(result).shape == (frames, 21, 3)
    assert torch.isfinite(joints_of(result)).all()


def test_same_seed_gives_the_same_result_and_another_seed_does_not(noisy):
    short = noisy[50:62]
    a, b = denoise(short, FAST), denoise(short, FAST)
    c = denoise(short, replace(FAST, seed=1))
    assert a == b
    assert a != c
    assert not torch.allclose(joints_of(a), joints_of(c), atol=1e-4)


def test_missing_frames_are_filled_and_marked(noisy):
    short = noisy[40:70]
    hand = short.hands[0]
    valid = hand.valid.clone()
    valid[10:15] = False
    holes = replace(
        hand,
        valid=valid,
        joints=hand.joints.masked_fill(~valid[:, None, None], torch.nan),
        pose=hand.pose.masked_fill(~valid[:, None, None], torch.nan),
        wrist=hand.wrist.masked_fill(~valid[:, None], torch.nan),
    )
    result = denoise(replace(short, hands=(holes,)), FAST)
    assert torch.isfinite(joints_of(result)).all()
    assert result.hands["left"].filled.tolist() == (~valid).tolist()


def test_other_frame_rates_come_back_as_they_were(noisy):
    short = replace(noisy[40:70], fps=60.0)
    result = denoise(short, FAST)
    assert result.sequence.fps == 60.0
    assert result.sequence.frames == 30
    assert joints_of(result).shape == (30, 21, 3)
    assert any("averaged from 60 to 30" in note for note in result.notes)


def test_closest_sample_is_the_one_nearest_to_the_input(noisy):
    short = noisy[50:62]
    result = denoise(short, replace(FAST, samples=3, selection="closest"))
    samples, hand = result.hands["left"].samples, short.hands[0]
    apart = (samples - hand.joints).norm(dim=-1).mean((1, 2))
    assert result.hands["left"].chosen == int(apart.argmin())


def test_two_parts_and_two_hands_are_cleaned_together(noisy):
    short = noisy[50:60]
    moving = short.object
    two = ObjectTrack(
        moving.meshes * 2,
        moving.rotation.expand(-1, 2, -1, -1).contiguous(),
        (moving.translation + torch.tensor([[[0.0, 0, 0]], [[0, 0, 0.3]]]).transpose(0, 1)),
    )
    other = replace(short.hands[0].mirrored(), joints=short.hands[0].joints, pose=None, wrist=None)
    result = denoise(replace(short, object=two, hands=(short.hands[0], other)), FAST)
    assert set(result.hands) == {"left", "right"}


def test_a_part_that_was_never_seen_is_as_none(noisy):
    clip = noisy[:40]
    motion = replace(clip.object, meshes=clip.object.meshes * 2)
    lost = torch.full_like(clip.object.translation, torch.nan)
    both = replace(
        motion,
        rotation=clip.object.rotation.repeat(1, 2, 1, 1),
        translation=torch.cat([clip.object.translation, lost], dim=1),
    )
    alone, found = denoise(clip, FAST), denoise(replace(clip, object=both), FAST)
    side = clip.hands[0].side
    assert torch.equal(found.hands[side].evidence, alone.hands[side].evidence)
    assert torch.equal(joints_of(found), joints_of(alone))
    assert found.sequence.object.rotation.shape[1] == 2
    assert "part 2 of the object was never seen" in found.notes[0]
    trusted = denoise(replace(clip, object=both), FAST, trust_object=True)
    assert trusted.notes == found.notes[:1]


def test_paper_preset_has_the_papers_schedule_and_no_observation():
    chosen = preset("paper")
    plans = [chosen.motion, chosen.spatial, chosen.temporal]
    assert [plan.level for plan in plans] == [400, 200, 100]
    assert [plan.steps for plan in plans] == [400, 200, 100]
    assert all(plan.sampler == "ancestral" for plan in plans)
    assert not chosen.observed


def test_paper_preset_runs(noisy, monkeypatch):
    quick_presets.use(monkeypatch)
    result = denoise(noisy[50:52], Options(preset="paper", steps=3))
    assert torch.isfinite(joints_of(result)).all()
    assert result.sequence.hands[0].joint_spread is None


@pytest.mark.parametrize(
    ("damaged", "number"),
    [("motion", math.nan), ("spatial", math.nan), ("temporal", math.nan), ("motion", 1e5)],
)
def test_weights_that_give_no_hand_are_named_as_damaged(noisy, tmp_path, damaged, number):
    for stage in ("motion", "spatial", "temporal"):
        saved = load_checkpoint(SHIPPED / f"{stage}.safetensors")
        if stage == damaged:
            for tensor in saved.tensors.values():
                tensor.fill_(number)
        save_checkpoint(tmp_path / f"{stage}.safetensors", saved)
    with pytest.raises(CheckpointError, match="their weights are damaged"):
        denoise(noisy, Options(preset="fast", weights=tmp_path))


def test_lost_frames_at_60_frames_a_second_are_marked_one_by_one(noisy):
    short = replace(noisy[40:70], fps=60.0)
    hand = short.hands[0]
    valid = ~torch.isin(torch.arange(30), torch.tensor([7, 14, 15, 22]))
    joints = hand.joints.masked_fill(~valid[:, None, None], torch.nan)
    track = HandTrack(hand.side, valid, joints=joints)
    (found,) = denoise(replace(short, hands=(track,)), FAST).hands.values()
    assert found.filled.tolist() == (~valid).tolist()


def test_the_report_is_about_the_frames_that_the_input_has(noisy):
    short = noisy[40:70]
    hand = short.hands[0]
    valid = (torch.arange(30) < 10) | (torch.arange(30) >= 20)
    (found,) = denoise(replace(short, hands=(replace(hand, valid=valid),)), FAST).hands.values()
    assert found.before.frames == found.after.frames == 20
    shaken = finite_difference(hand.joints, 2).norm(dim=-1).mean(-1)[valid_differences(valid, 2)]
    assert found.before.acceleration_mm == pytest.approx(1000 * float(shaken.mean()), rel=1e-3)


def test_frames_of_a_higher_rate_all_count(clean):
    """White noise at 120 frames a second is averaged, not left out with three of four frames."""
    truth = at_rate(clean[50:80], 120.0)
    noise = 0.012 * torch.randn(truth.frames, 21, 3, generator=torch.Generator().manual_seed(0))
    hand = truth.hands[0]
    noisy = HandTrack(hand.side, hand.valid, joints=hand.joints + noise)
    lost = replace(truth[::4], hands=(noisy[::4],), fps=30.0)
    full, every = (
        joints_of(denoise(case, FAST)) for case in (replace(truth, hands=(noisy,)), lost)
    )
    errors = [(full[::4] - hand.joints[::4]), every - hand.joints[::4]]
    all_frames, few = (float(error.norm(dim=-1).mean()) for error in errors)
    assert all_frames < 0.85 * few


def test_hands_in_one_point_count_as_missing(noisy):
    short = noisy[40:70]
    hand = short.hands[0]
    lost = (torch.arange(30) > 9) & (torch.arange(30) < 15)
    keys = HandTrack(hand.side, hand.valid, hand.joints)
    zeros = replace(keys, joints=hand.joints.masked_fill(lost[:, None, None], 0.0))
    found = denoise(replace(short, hands=(zeros,)), FAST)
    wanted = denoise(replace(short, hands=(replace(keys, valid=~lost),)), FAST)
    assert found.hands["left"].filled.tolist() == lost.tolist()
    assert torch.equal(joints_of(found), joints_of(wanted))
    assert "5 frames" in found.doubts[0]


def test_a_mesh_that_is_taken_for_a_sheet_is_told(noisy):
    assert not any("sheet" in note for note in denoise(noisy[:20], FAST).notes)
    (mesh,) = noisy.object.meshes
    height = mesh.corners().mean(1)[:, 2]
    opened = replace(mesh, faces=mesh.faces[height > height.quantile(0.3)])
    sequence = replace(noisy[:20], object=replace(noisy[:20].object, meshes=(opened,)))
    told = "the mesh of the object is open and taken for a sheet with a wall of 2 mm"
    assert any(told in note for note in denoise(sequence, FAST).notes)


def test_the_rate_of_the_measures_is_told_where_it_is_not_that_of_the_file(noisy):
    slow = denoise(noisy[:40:2], FAST)
    told = "resampled from 15 to 30 frames a second and back: measures, and how far keypoints moved"
    assert any(note.startswith(told) and "page at 15" in note for note in slow.notes)
    assert not any("measures" in note for note in denoise(noisy[:20], FAST).notes)
