"""Shape, keypoints and start of a track."""

from dataclasses import replace

import pytest
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


def test_noise_of_joints_lengthens_no_bone():
    betas = torch.linspace(1.0, -1.0, 10)
    track = track_of(betas, 200)
    noise = 0.008 * torch.randn(200, 21, 3, generator=torch.Generator().manual_seed(0))
    noisy = replace(track, joints=track.joints + noise, pose=None, wrist=None)
    off = subject_of(noisy, MODEL).shaped.offsets.norm(dim=-1) - MODEL.shaped(betas).offsets.norm(
        dim=-1
    )
    assert off.mean().abs() < 1e-3


@pytest.mark.parametrize("hand_model", ["mano", "mano-as-shipped"])
def test_pose_alone_takes_the_mean_hand_and_says_so(hand_model):
    shape = {"hand_model": hand_model, "betas": torch.ones(10)}
    track = replace(track_of(torch.zeros(10)), joints=None, **shape)
    subject = subject_of(track, MODEL)
    assert torch.equal(subject.betas, torch.zeros(10))
    assert subject.notes == (
        "the pose comes without joints and its betas belong to another hand model: the mean hand "
        "is used (--hand mano takes them)",
    )
    unnamed = subject_of(replace(track, hand_model=None), MODEL)
    assert unnamed.notes == (
        "the pose comes without joints and its betas without a hand model: the mean hand is used "
        "('hand_model' names it)",
    )
    unknown = subject_of(replace(track, betas=None), MODEL)
    assert unknown.notes == ("the pose comes without joints and betas: the mean hand is used",)


@pytest.mark.parametrize(("scale", "words"), [(1.1, "10% larger"), (0.9, "10% smaller"), (1, "")])
def test_joints_of_another_size_than_the_betas_are_told(scale, words):
    betas = torch.linspace(-1.0, 1.0, 10)
    track = replace(track_of(betas, 12), betas=betas, hand_model="embedded")
    wrist = track.joints[:, :1]
    subject = subject_of(replace(track, joints=wrist + scale * (track.joints - wrist)), MODEL)
    assert torch.equal(subject.betas, betas)
    assert (f"those of a hand {words} than that of the given betas" in str(subject.notes)) == bool(
        words
    )


def test_betas_of_this_model_are_used_as_they_are():
    betas = torch.linspace(-2, 2, 10)
    track = replace(track_of(betas), hand_model="embedded", betas=betas)
    assert torch.equal(subject_of(track, MODEL).betas, betas)


def test_a_pose_that_misses_the_joints_is_dropped():
    track = track_of(torch.zeros(10))
    subject = subject_of(replace(track, pose=track.pose.flip(0) + 0.5), MODEL)
    assert subject.start is None
    assert "joints are used" in subject.notes[0]


def test_a_wrist_that_is_not_that_of_the_joints_is_told():
    track = track_of(torch.zeros(10))
    subject = subject_of(replace(track, wrist=track.wrist + 0.02), MODEL)
    assert subject.notes == (
        "the given wrist is not that of the given joints: the joints are used",
    )
    assert subject.start is not None
    torch.testing.assert_close(subject.start.wrist[0], track.wrist)


def test_trust_is_confidence_where_observed_and_zero_elsewhere():
    track = track_of(torch.zeros(10))
    valid = track.valid.clone()
    valid[2] = False
    sure = torch.ones(8, 21)
    sure[0] = 0.5
    subject = subject_of(replace(track, valid=valid, confidence=sure), MODEL)
    assert subject.trust[2].eq(0).all()
    assert subject.trust[0].eq(0.5).all()


def doubted(track: HandTrack, keypoints: torch.Tensor) -> HandTrack:
    """The track with some keypoints far off, which no one relies on."""
    assert track.joints is not None
    off = track.joints + 0.3 * torch.randn(8, 21, 3, generator=torch.Generator().manual_seed(1))
    joints = torch.where(keypoints[..., None], off, track.joints)
    return replace(track, joints=joints, confidence=(~keypoints).float())


def some_keypoints(share: float = 0.1) -> torch.Tensor:
    return torch.rand(8, 21, generator=torch.Generator().manual_seed(2)) < share


def test_keypoints_without_confidence_change_neither_skeleton_nor_pose():
    track = track_of(torch.linspace(-1.5, 1.5, 10))
    exact = subject_of(track, MODEL)
    found = subject_of(doubted(track, some_keypoints()), MODEL)
    assert found.start is not None
    torch.testing.assert_close(found.offsets, exact.offsets, atol=1e-5, rtol=0)
    torch.testing.assert_close(found.betas, exact.betas, atol=1e-2, rtol=0)
    whole = found.completed(found.parameters()).joints
    torch.testing.assert_close(whole, track.joints, atol=1e-5, rtol=0)


def test_a_wrist_without_confidence_is_where_the_other_keypoints_have_it():
    track = track_of(torch.zeros(10))
    wrists = torch.zeros(8, 21, dtype=torch.bool)
    wrists[2:4, 0] = True
    for given in (track, replace(track, pose=None, wrist=None)):
        found = subject_of(doubted(given, wrists), MODEL)
        off = (found.parameters().wrist[0] - track.joints[:, 0]).norm(dim=-1)
        assert off.max() < 3e-3


def test_keypoints_alone_without_confidence_are_those_of_the_fit():
    track = replace(track_of(torch.zeros(10)), pose=None, wrist=None)
    given = doubted(track, some_keypoints())
    found = subject_of(given, MODEL)
    whole = found.completed(found.parameters())
    before = (given.joints - track.joints).norm(dim=-1)[some_keypoints()].mean()
    after = (whole.joints - track.joints).norm(dim=-1)[some_keypoints()].mean()
    assert after < 0.05 * before
    assert torch.equal(whole.joints[~some_keypoints()], track.joints[~some_keypoints()])


def test_it_does_not_matter_where_keypoints_without_confidence_are():
    track = replace(track_of(torch.zeros(10)), pose=None, wrist=None)
    given = doubted(track, some_keypoints(0.3))
    far = torch.where(some_keypoints(0.3)[..., None], 0.5, given.joints)
    each = [subject_of(t, MODEL).parameters() for t in (given, replace(given, joints=far))]
    assert torch.equal(each[0].rotations, each[1].rotations)
    assert torch.equal(each[0].wrist, each[1].wrist)


def test_a_keypoint_that_is_never_relied_on_tells_no_bone_length():
    track = replace(track_of(torch.zeros(10)), pose=None, wrist=None)
    thumb = torch.zeros(8, 21, dtype=torch.bool)
    thumb[:, 1] = True
    exact, found = subject_of(track, MODEL), subject_of(doubted(track, thumb), MODEL)
    lengths = [each.offsets.norm(dim=-1) for each in (exact, found)]
    assert (lengths[1] - lengths[0]).abs().max() < 1e-3


def test_a_frame_without_any_confidence_is_a_gap():
    track = track_of(torch.zeros(10))
    lost = torch.zeros(8, 21, dtype=torch.bool)
    lost[3] = True
    found = subject_of(doubted(track, lost), MODEL)
    torch.testing.assert_close(found.joints[3], track.joints[[2, 4]].mean(0))
    assert found.trust[3].eq(0).all()


def test_a_confidence_of_zero_everywhere_is_left_out():
    track = track_of(torch.zeros(10))
    found = subject_of(replace(track, confidence=torch.zeros(8, 21)), MODEL)
    assert torch.equal(found.joints, track.joints)
    assert found.trust.eq(1).all()


def test_a_gap_in_keypoints_alone_holds_the_hand_that_is_around_it():
    fist = MODEL.pose_mean.clone()
    fist[1:, 2] += 0.9
    joints = MODEL.shaped(torch.zeros(10)).posed(fist.expand(12, 16, 3), torch.zeros(12, 3)).joints
    valid = (torch.arange(12) < 4) | (torch.arange(12) > 7)
    track = HandTrack("right", valid, joints=joints.masked_fill(~valid[:, None, None], torch.nan))
    given = subject_of(track, MODEL).parameters()
    made = subject_of(track, MODEL).shaped.joints_from_rotations(given.rotations, given.wrist)[0]
    assert (made - joints).norm(dim=-1).max() < 5e-3


def test_noise_of_keypoints_is_that_of_their_bones():
    given = track_of(torch.zeros(10), frames=60)
    for std in (0.0, 0.004):
        noise = std * torch.randn(60, 21, 3, generator=torch.Generator().manual_seed(2))
        alone = HandTrack("right", given.valid, joints=given.joints + noise)
        found = subject_of(alone, MODEL).keypoint_noise
        assert found == pytest.approx(std, rel=0.2, abs=1e-6)
