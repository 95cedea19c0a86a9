"""Shape, keypoints and start of a track."""

from dataclasses import replace

import torch

from geneoh.fitting.subject import subject_of
from geneoh.hand.library import load_hand
from geneoh.sequence.sequence import HandTrack

MODEL = load_hand("right")


def track_of(betas: torch.Tensor, frames: int = 8) -> HandTrack:
    generator = torch.Generator().manual_seed(3)
    pose = MODEL.pose_mean + 0.2 * torch.randn(frames, 16, 3, generator=generator)
    wrist = 0.1 * torch.randn(frames, 3, generator=generator)
    joints = MODEL.shaped(betas).posed(pose, wrist).joints
    valid = torch.ones(frames, dtype=torch.bool)
    return HandTrack("right", valid, joints=joints, pose=pose, wrist=wrist)


def test_pose_and_joints_give_the_persons_shape():
    betas = torch.linspace(-1.5, 1.5, 10)
    subject = subject_of(track_of(betas), MODEL)
    assert (subject.shaped.offsets - MODEL.shaped(betas).offsets).norm(dim=-1).max() < 5e-4
    assert subject.start is not None


def test_joints_alone_give_the_persons_bone_lengths():
    betas = torch.linspace(1.0, -1.0, 10)
    track = replace(track_of(betas), pose=None, wrist=None)
    subject = subject_of(track, MODEL)
    wanted = MODEL.shaped(betas).offsets.norm(dim=-1)
    assert (subject.shaped.offsets.norm(dim=-1) - wanted).abs().mean() < 1e-3
    assert subject.start is None


def test_pose_alone_takes_the_mean_hand_and_says_so():
    track = replace(track_of(torch.zeros(10)), joints=None, hand_model="mano", betas=torch.ones(10))
    subject = subject_of(track, MODEL)
    assert torch.equal(subject.betas, torch.zeros(10))
    assert "mean hand" in subject.notes[0]


def test_betas_of_this_model_are_used_as_they_are():
    betas = torch.linspace(-2, 2, 10)
    track = replace(track_of(betas), hand_model="embedded", betas=betas)
    assert torch.equal(subject_of(track, MODEL).betas, betas)


def test_a_pose_that_misses_the_joints_is_dropped():
    track = track_of(torch.zeros(10))
    subject = subject_of(replace(track, pose=track.pose.flip(0) + 0.5), MODEL)
    assert subject.start is None
    assert "joints are used" in subject.notes[0]


def test_trust_is_confidence_where_observed_and_zero_elsewhere():
    track = track_of(torch.zeros(10))
    valid = track.valid.clone()
    valid[2] = False
    subject = subject_of(replace(track, valid=valid, confidence=torch.full((8, 21), 0.5)), MODEL)
    assert subject.trust[2].eq(0).all()
    assert subject.trust[0].eq(0.5).all()
