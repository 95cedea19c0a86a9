"""Finger poses that are turned about their bones, though their keypoints are right."""

from dataclasses import replace
from typing import get_args

import pytest
import torch
from torch import Tensor

from geneoh.choices import Noise
from geneoh.fitting.subject import Subject, subject_of
from geneoh.fitting.twist import TOLD, turned_about_bones, untwisted
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.noise import corrupt
from geneoh.sequence.sequence import HandTrack


@pytest.fixture
def natural(hand, shaped, make_state) -> Subject:
    """A hand that moves through natural poses."""
    return subject_of(track_of(shaped, make_state(frames=40, spread=0.3)), hand)


def track_of(shaped, state) -> HandTrack:
    pose, wrist = state.pose[0], state.wrist[0]
    joints = shaped.posed(pose, wrist).joints
    valid = torch.ones(len(pose), dtype=torch.bool)
    return HandTrack("right", valid, joints=joints, pose=pose, wrist=wrist)


def twisted(subject: Subject, degrees: Tensor) -> Subject:
    """The subject with joints turned about their bones, (5, T, 3)."""
    rotations = subject.start.rotations[0]
    twist = torch.deg2rad(degrees).expand(5, len(rotations), 3)
    moved = turned_about_bones(rotations, subject.offsets[0], twist)
    return replace(subject, start=replace(subject.start, rotations=moved[None]))


def keypoints(subject: Subject) -> Tensor:
    start = subject.start
    return forward_kinematics(start.rotations[0], start.wrist[0], subject.offsets)[0]


def apart(one: Subject, other: Subject) -> float:
    """Mean angle between the rotations of two poses, degrees."""
    turn = one.start.rotations.mT @ other.start.rotations
    cosine = (turn.diagonal(dim1=-2, dim2=-1).sum(-1) - 1) / 2
    return float(cosine.clamp(-1, 1).acos().rad2deg().mean())


def draw(size: tuple[float, float], seed: int) -> Tensor:
    """Constant twists of each joint, degrees, between two sizes and of either sign."""
    generator = torch.Generator().manual_seed(seed)
    sign = 2 * torch.randint(0, 2, (5, 1, 3), generator=generator) - 1
    return sign * (size[0] + (size[1] - size[0]) * torch.rand(5, 1, 3, generator=generator))


@pytest.mark.parametrize(("size", "seed"), [((15, 60), 0), ((15, 60), 1), ((60, 170), 2)])
def test_twisted_poses_become_natural_and_keypoints_stay(natural, size, seed):
    given = twisted(natural, draw(size, seed))
    found = untwisted(given)
    assert (keypoints(found) - keypoints(given)).norm(dim=-1).max() < 1e-5
    assert apart(given, natural) > 25
    assert apart(found, natural) < 8
    assert found.notes == (TOLD,)


def test_twists_that_change_slowly_are_found(natural):
    phase = torch.linspace(0, 3, 40)[:, None] + torch.arange(15.0).reshape(5, 1, 3)
    given = twisted(natural, draw((30, 50), 3) + 15 * phase.sin())
    assert apart(untwisted(given), natural) < 8


def test_twisted_noisy_poses_keep_their_noise(natural):
    noise = 0.3 * torch.randn(1, 40, 16, 3, generator=torch.Generator().manual_seed(5))
    start = replace(natural.start, rotations=natural.start.rotations @ axis_angle_to_matrix(noise))
    noisy = replace(natural, start=start)
    assert apart(untwisted(twisted(noisy, draw((30, 60), 4))), noisy) < 12


@pytest.mark.parametrize("noise", ["clean", *get_args(Noise)])
@pytest.mark.parametrize("frames", [15, 40])
def test_poses_that_are_not_twisted_stay(hand, shaped, make_state, noise, frames):
    for seed in range(4):
        track = track_of(shaped, make_state(frames=frames, seed=seed, spread=0.3))
        if noise != "clean":
            track = corrupt(track, noise, generator=torch.Generator().manual_seed(seed))
        subject = subject_of(fill_gaps(track), hand)
        assert untwisted(subject) is subject


def test_a_moment_shows_nothing_that_lasts(natural):
    short = twisted(natural, draw((30, 60), 4))
    short = replace(short, start=short.start[:10], joints=short.joints[:10], trust=short.trust[:10])
    assert untwisted(short) is short


def test_keypoints_alone_have_no_twist(natural):
    alone = replace(natural, start=None)
    assert untwisted(alone) is alone
