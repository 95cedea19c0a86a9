import math
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest
import torch
from draws import seeded

from geneoh.choices import NOISES, Noise
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import bone_lengths, forward_kinematics, rest_offsets
from geneoh.readers.npz.files import load
from geneoh.sequence.noise import SIZES, corrupt, corrupt_sequence, draw_noise, draw_ray
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

EXAMPLES = Path(__file__).parents[2] / "examples"

INPUT_ERROR_MM = {
    "gauss": 24.6,
    "gauss_strong": 33.1,
    "beta": 28.2,
    "bias": 19.1,
    "drift": 20.0,
    "burst": 12.0,
    "drop": 8.0,
    "camera": 31.0,
}
"""Mean keypoint error that each kind puts on the example recording, measured over five seeds
with an independent numpy implementation; "camera" over 400."""

SPREAD_MM = {"bias": 7.0, "drift": 3.0, "burst": 2.5, "camera": 7.0}
"""How far the mean over five draws may lie off: one draw of a bias is one number per clip."""


def drawn(
    noise: Noise, frames: int, count: int, seed: int = 0, rays: torch.Tensor | None = None
) -> tuple[torch.Tensor, torch.Tensor]:
    generator = seeded(seed)
    if noise == "camera" and rays is None:
        rays = torch.stack([draw_ray(generator=generator) for _ in range(count)])
    every = [
        draw_noise(noise, frames, ray=None if rays is None else rays[i], generator=generator)
        for i in range(count)
    ]
    return torch.stack([offsets for offsets, _ in every]), torch.stack([keep for _, keep in every])


def in_units(noise: Noise, values: torch.Tensor) -> torch.Tensor:
    return values / SIZES[noise].scale(torch.ones(51))


def test_every_kind_of_noise_is_listed_once():
    assert set(NOISES) == set(get_args(Noise)) == {*SIZES, "camera"}


@pytest.mark.parametrize("noise", NOISES)
def test_equal_generators_draw_equal_noise(noise):
    first, second = (drawn(noise, 40, 2, seed=3) for _ in range(2))
    assert torch.equal(first[0], second[0])
    assert torch.equal(first[1], second[1])
    other, _ = drawn(noise, 40, 2, seed=4)
    assert not torch.equal(first[0], other)
    assert first[0].shape == (2, 40, 51)
    assert first[1].shape == (2, 40)


@pytest.mark.parametrize(
    ("noise", "mean", "deviation"),
    [
        ("gauss", 0, 1),
        ("gauss_strong", 0, 1),
        # Beta(8, 2): mean 8 / 10, variance 16 / (100 * 11)
        ("beta", 0.8, math.sqrt(16 / 1100)),
        ("bias", 0, 1),
        ("drift", 0, 1),
        # five in a hundred frames have 81 times the variance
        ("burst", 0, math.sqrt(0.95 + 0.05 * 81)),
        ("drop", 0, 1),
    ],
)
def test_noise_has_its_mean_and_deviation(noise, mean, deviation):
    offsets, _ = drawn(noise, 50, 1000)
    unit = in_units(noise, offsets)
    assert float(unit.mean()) == pytest.approx(mean, abs=0.02)
    assert float(unit.std()) == pytest.approx(deviation, rel=0.02)
    parts = [unit[..., part].std() for part in (slice(0, 3), slice(3, 6), slice(6, 51))]
    for part in parts:
        assert float(part) == pytest.approx(deviation, rel=0.08)


def lag_correlation(unit: torch.Tensor, lag: int) -> float:
    unit = unit - unit.mean()
    return float((unit[..., lag:, :] * unit[..., :-lag, :]).mean() / unit.square().mean())


@pytest.mark.parametrize(
    ("noise", "lag_1", "lag_10"),
    [("gauss", 0, 0), ("drift", math.exp(-0.1), math.exp(-1)), ("bias", 1, 1)],
)
def test_noise_is_correlated_over_time_as_its_kind_says(noise, lag_1, lag_10):
    offsets, _ = drawn(noise, 60, 200)
    unit = in_units(noise, offsets)
    assert lag_correlation(unit, 1) == pytest.approx(lag_1, abs=0.02)
    assert lag_correlation(unit, 10) == pytest.approx(lag_10, abs=0.02)


def test_dropped_frames_come_in_runs_of_about_an_eighth():
    _, keep = drawn("drop", 146, 300)
    assert float((~keep).float().mean()) == pytest.approx(0.125, abs=0.015)
    assert bool(keep[:, -2:].all())
    lost = (~keep).int()
    starts = (lost.diff(dim=-1) == 1).sum() + lost[:, 0].sum()
    assert 4.5 < float(lost.sum() / starts) < 6  # mean of 3 to 7, and some runs touch


@pytest.mark.parametrize("frames", [1, 2, 8, 9])
@pytest.mark.parametrize("noise", NOISES)
def test_short_clips_keep_at_least_one_frame(noise, frames):
    offsets, keep = drawn(noise, frames, 50)
    assert offsets.shape == (50, frames, 51)
    assert bool(keep.any(-1).all())


@pytest.fixture(scope="module")
def recording() -> HandTrack:
    return load(EXAMPLES / "taco_clean.npz").hands[0]


@pytest.mark.parametrize("noise", NOISES)
def test_the_recording_gets_the_error_that_was_measured(noise, recording):
    errors = []
    for seed in range(5):
        noisy = corrupt(recording, noise, generator=seeded(seed))
        assert noisy.joints is not None
        error = (noisy.joints - recording.joints).norm(dim=-1)[noisy.valid]
        errors.append(1000 * float(error.mean()))
    off = SPREAD_MM.get(noise, 1.0)
    assert sum(errors) / 5 == pytest.approx(INPUT_ERROR_MM[noise], abs=off)


def test_joints_follow_from_the_noisy_pose_and_the_persons_own_bones(recording):
    noisy = corrupt(recording, "gauss_strong", generator=seeded())
    assert noisy.joints is not None
    assert noisy.pose is not None
    torch.testing.assert_close(noisy.joints[:, 0], noisy.wrist, rtol=0, atol=1e-4)
    torch.testing.assert_close(
        bone_lengths(noisy.joints), bone_lengths(recording.joints), rtol=0, atol=2e-3
    )
    skeleton = rest_offsets(axis_angle_to_matrix(noisy.pose), noisy.joints, noisy.trust)
    again, _ = forward_kinematics(axis_angle_to_matrix(noisy.pose), noisy.joints[:, 0], skeleton)
    torch.testing.assert_close(again, noisy.joints, rtol=0, atol=1e-5)


def test_a_track_of_joints_alone_is_turned_about_its_joints(recording):
    bare = replace(recording, pose=None, wrist=None, betas=None)
    noisy = corrupt(bare, "gauss", generator=seeded())
    assert noisy.pose is None
    torch.testing.assert_close(
        bone_lengths(noisy.joints), bone_lengths(bare.joints), rtol=0, atol=1e-6
    )
    error = 1000 * (noisy.joints - bare.joints).norm(dim=-1).mean()
    assert float(error) == pytest.approx(INPUT_ERROR_MM["gauss"], abs=1.0)


def test_a_camera_errs_along_its_ray_as_an_independent_implementation_does():
    generator = seeded()
    ray = torch.stack([draw_ray(generator=generator) for _ in range(400)])
    offsets, keep = drawn("camera", 146, 400, seed=1, rays=ray)
    depth = (offsets[..., :3] * ray[:, None]).sum(-1)
    across = offsets[..., :3] - depth[..., None] * ray[:, None]
    turn, fingers = offsets[..., 3:6], offsets[..., 6:]
    measured = [1000 * float(x) for x in (depth.std(), depth.mean(1).std(), across.std())]
    measured += [float(x) for x in (turn.std(), turn.mean(1).std(), turn.diff(dim=1).std())]
    measured += [float(x) for x in (fingers.std(), fingers.mean(1).std(), (~keep).float().mean())]
    # The same figures of 400 clips of the numpy implementation: mm, rad, share of lost frames
    wanted = [29.8, 26.5, 3.56, 0.1017, 0.0651, 0.0480, 0.1921, 0.1317, 0.0533]
    assert measured == pytest.approx(wanted, rel=0.06)


def test_both_hands_of_a_sequence_know_the_ray_of_the_one_camera(recording):
    hands = (recording, recording.mirrored())
    still = ObjectTrack((), torch.eye(3).expand(146, 1, 3, 3), torch.zeros(146, 1, 3))
    seen = corrupt_sequence(Sequence(hands, still, 30.0), "camera", generator=seeded()).hands
    assert seen[0].camera_ray.equal(seen[1].camera_ray)
    error = (seen[0].wrist - recording.wrist)[seen[0].valid]
    depth = (error * seen[0].camera_ray[0]).sum(-1)
    assert float(depth.abs().max()) > 0.04  # a blunder
    across = error - depth[:, None] * seen[0].camera_ray[0]
    assert float(across.norm(dim=-1).max()) < 0.02


def test_lost_frames_are_marked_and_hold_nothing(recording):
    noisy = corrupt(recording, "drop", generator=seeded())
    assert noisy.joints is not None
    assert 0 < int((~noisy.valid).sum()) < recording.frames // 4
    assert bool(noisy.joints[~noisy.valid].isnan().all())
    assert bool(noisy.joints[noisy.valid].isfinite().all())
    assert bool(noisy.pose[noisy.valid].isfinite().all())


def test_frames_that_were_not_valid_stay_so(recording):
    hand = replace(recording, valid=torch.arange(recording.frames) != 7)
    assert not bool(corrupt(hand, "gauss", generator=seeded()).valid[7])


def test_the_expected_error_of_the_clean_hand_is_not_kept(recording):
    hand = replace(recording, joint_spread=torch.full((recording.frames, 21), 0.003))
    assert corrupt(hand, "gauss", generator=seeded()).joint_spread is None


def test_frames_of_zeros_get_no_noise():
    joints = torch.rand(6, 21, 3, generator=seeded())
    joints[2] = 0
    hand = HandTrack("right", torch.ones(6, dtype=torch.bool), joints=joints)
    clean = Sequence((hand,), ObjectTrack.resting((), 6), 30.0)
    (noisy,) = corrupt_sequence(clean, "gauss", generator=seeded()).hands
    assert noisy.valid.tolist() == [True, True, False, True, True, True]
