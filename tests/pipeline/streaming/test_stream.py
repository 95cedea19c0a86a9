"""A stream: order, lag, gaps, bounded state, the same result each time, and what it is worth."""

import math
import re
from collections import deque
from dataclasses import is_dataclass, replace
from typing import Any

import numpy as np
import pytest
import torch

import geneoh
from geneoh.bundle import concatenated
from geneoh.denoisers.library import Denoisers
from geneoh.errors import ConfigError, InputError
from geneoh.pipeline.streaming import recent
from geneoh.pipeline.streaming import stream as stream_module
from geneoh.pipeline.streaming.recent import RecentHand
from geneoh.pipeline.streaming.recent_place import RecentRun
from geneoh.pipeline.streaming.stream import CleanFrame, Stream
from geneoh.seeds import seeded_generator
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import HandTrack, Sequence
from tools.noisy_objects.clips import hovering


@pytest.fixture
def unmoved(monkeypatch):
    """Stages and a fit that leave the hand as it is, so that only the stream is tested."""

    def same(run, surface, poses, near, chosen, fps, **more):
        return run.subject.joints.expand(2, -1, -1, -1), near

    none = object.__new__(Denoisers)
    monkeypatch.setattr(stream_module, "load_denoisers", lambda *given, **more: none)
    monkeypatch.setattr(RecentRun, "relied_on", same)
    monkeypatch.setattr(recent, "fit_hand", lambda target, trust, shaped, start, **more: start)


def pushed(stream: Stream, sequence: Sequence, lost: tuple[int, ...] = ()) -> list[CleanFrame]:
    """All that comes out of a stream for a sequence, some of whose hands are lost."""
    hand, motion, found = sequence.hands[0], sequence.object, []
    for frame in range(sequence.frames):
        pose = motion.rotation[frame], motion.translation[frame]
        given = None if frame in lost else hand[frame : frame + 1]
        if clean := stream.push(given, pose):
            found.append(clean)
    return found + stream.flush()


def joints_of(frames: list[CleanFrame]) -> torch.Tensor:
    return torch.cat([frame.hand.joints for frame in frames])


@pytest.mark.parametrize("lag", [0.0, 0.1, 0.3, 1.0])
def test_every_frame_comes_out_once_in_order_and_by_the_lag_later(noisy, unmoved, lag):
    stream = Stream((), 30, lag, side="left")
    track, late = noisy.hands[0], round(30 * lag)
    for frame in range(late + 10):
        clean = stream.push(track[frame : frame + 1])
        assert (clean.index if clean else None) == (frame - late if frame >= late else None)
    assert [clean.index for clean in stream.flush()] == list(range(10, late + 10))
    assert stream.flush() == []


def test_unmoved_hands_come_out_where_they_went_in(noisy, unmoved):
    clip = noisy[:40]
    found = pushed(Stream(noisy.object.meshes, side="left"), clip)
    apart = joints_of(found) - clip.hands[0].joints
    assert float(apart.norm(dim=-1).mean()) < 0.004  # the embedded hand has other bones
    assert {frame.hand.side for frame in found} == {"left"}


@pytest.mark.parametrize("fps", [24.0, 60.0])
def test_other_rates_keep_frames_and_place(noisy, unmoved, fps):
    clip = geneoh.Sequence(noisy.hands, noisy.object, fps)[:30]
    found = pushed(Stream((), fps, side="left"), clip)
    assert [frame.index for frame in found] == list(range(30))
    inner = (joints_of(found) - clip.hands[0].joints)[2:-2]
    assert float(inner.norm(dim=-1).mean()) < 0.02  # the noise of frames between is lost at 60


@pytest.mark.parametrize("fps", [25.0, 50.0])
def test_the_last_frames_move_on_at_other_rates(noisy, unmoved, fps):
    """The hand stood still after the last frame of the networks."""
    (hand,), step = noisy.hands, torch.tensor([0.01, 0.0, 0.0])
    path = hand.joints[0] + step * torch.arange(30)[:, None, None]
    moving = HandTrack("left", hand.valid[:30], joints=path)
    found = joints_of(pushed(Stream((), fps, side="left"), replace(noisy[:30], hands=(moving,))))
    steps = found.diff(dim=0).norm(dim=-1).mean(-1)
    assert float(steps[-4:].min()) > 0.005


def test_lost_hands_are_filled_and_marked(noisy, unmoved):
    found = pushed(Stream((), side="left"), noisy[:40], lost=(0, 1, 20, 21, 22))
    assert [frame.index for frame in found if frame.filled] == [0, 1, 20, 21, 22]
    assert bool(joints_of(found).isfinite().all())


@pytest.mark.parametrize("name", ["pose", "wrist"])
def test_a_hand_without_one_of_the_fields_that_place_it_is_lost(noisy, unmoved, name):
    stream, track, found = Stream((), side="left"), noisy.hands[0], []
    for frame in range(20):
        hand = {"joints": None, "pose": track.pose[frame], "wrist": track.wrist[frame]}
        if frame in (0, 10):
            hand |= dict.fromkeys(hand if frame == 0 else (name,))
        found.append(stream.push(hand))
    found = [clean for clean in found if clean] + stream.flush()
    assert [clean.index for clean in found if clean.filled] == [0, 10]


def test_a_hand_that_stays_away_is_none_and_comes_back(noisy, unmoved):
    stream, track = Stream((), side="left"), noisy.hands[0]
    found = []
    for frame in range(120):
        seen = frame < 5 or frame >= 100
        found.append(stream.push(track[frame : frame + 1] if seen else None))
    hands = [clean.hand is not None for clean in found if clean]
    assert hands[:5] == [True] * 5
    assert hands[-3:] == [True] * 3
    assert False in hands


@pytest.mark.parametrize("fps", [30.0, 50.0])
def test_fingers_that_touch_are_told_as_of_a_whole_track(clean, unmoved, fps):
    """`denoise` told them, and a stream did not."""
    clip = replace(clean[:60], fps=fps)
    found = pushed(Stream(clip.object.meshes, fps, side="left"), clip)
    told = torch.stack([frame.contact for frame in found])
    whole = geneoh.denoise(clip, geneoh.Options(preset="fast")).hands["left"].contact
    assert 0.2 < float((whole > 0.5).float().mean()) < 0.9
    assert float(((told > 0.5) == (whole > 0.5)).float().mean()) > 0.9
    assert not told.isnan().any()


def test_a_trusted_object_that_is_lost_says_nothing_of_the_fingers(clean, unmoved):
    motion, lost = clean[20:60].object, torch.arange(40)[:, None, None] >= 20
    places = motion.translation.masked_fill(lost, torch.nan)
    clip = replace(clean[20:60], object=replace(motion, translation=places))
    stream = Stream(motion.meshes, side="left", trust_object=True)
    told = torch.stack([frame.contact for frame in pushed(stream, clip)])
    assert float((told[:15] - 0.5).abs().max()) > 0.4
    assert float((told[-5:] - 0.5).abs().max()) < 0.1


def test_where_there_is_no_object_or_no_hand_no_finger_touches(noisy, unmoved):
    clip = noisy[:10]
    assert all(frame.contact is None for frame in pushed(Stream((), side="left"), clip))
    frames = pushed(Stream(noisy.object.meshes, side="left"), clip, lost=tuple(range(10)))
    assert all(frame.contact is None for frame in frames)


@pytest.mark.parametrize("lag", [0.1, 0.3, 1.0])
def test_a_lost_hand_is_filled_for_two_seconds_less_the_lag(noisy, unmoved, lag):
    stream, track = Stream((), lag=lag, side="left"), noisy.hands[0]
    found = [stream.push(track[frame : frame + 1] if frame < 40 else None) for frame in range(140)]
    found = [frame for frame in found if frame] + stream.flush()
    filled = sum(frame.filled and frame.hand is not None for frame in found)
    assert abs(filled - (60 - stream.lag)) <= recent.HOP  # frames are made in groups


def test_a_stream_without_any_hand_gives_frames_without_one(unmoved):
    stream = Stream(lag=0.1)
    found = [stream.push(None) for _ in range(10)]
    assert [clean and clean.index for clean in found] == [None] * 3 + list(range(7))
    assert all(clean.hand is None and clean.filled for clean in found[3:] + stream.flush())


def numbers_in(value: Any, seen: set[int]) -> int:
    """Numbers that are reachable from a value, networks and hand models apart."""
    if id(value) in seen or isinstance(value, torch.nn.Module):
        return 0
    seen.add(id(value))
    if isinstance(value, torch.Tensor):
        return value.untyped_storage().nbytes()
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, dict):
        return sum(numbers_in(each, seen) for each in value.values())
    if isinstance(value, list | tuple | deque):
        return 8 * len(value) + sum(numbers_in(each, seen) for each in value)
    if is_dataclass(value):
        return numbers_in(vars(value), seen)
    return numbers_in(vars(value), seen) if isinstance(value, Stream | RecentHand) else 0


@pytest.mark.slow
def test_the_state_does_not_grow(noisy, unmoved, monkeypatch):
    monkeypatch.setattr(recent, "HOP", 30)  # as few runs as the lag allows
    stream, track = Stream((), lag=1.0, side="left"), noisy.hands[0]
    sizes = []
    for frame in range(240):
        place = frame % 146
        stream.push(track[place : place + 1])
        if frame % 30 == 29:  # as many frames wait for the next run each time
            sizes.append(numbers_in(stream, set()))
    assert 0 < sizes[-1] == sizes[4]


@pytest.mark.parametrize(
    ("hand", "pose", "words"),
    [
        (np.zeros((20, 3)), None, "'right_joints' must be numbers of shape"),
        (np.random.default_rng(0).normal(size=(21, 3)) * 90, None, "must be in metres"),
        ({"pose": np.zeros((16, 3))}, None, "add the rest"),
        ({"joint": np.zeros((21, 3))}, None, "got 'joint'; did you mean 'joints'?"),
        ({"joints": None, "glow": 1.0, 3: 1.0}, None, "got 'glow', '3'; there are pose, wrist"),
        (None, np.eye(3), "'obj_pose' must be numbers of shape"),
        (None, (2 * np.eye(3), np.zeros(3)), "a scale belongs to the mesh"),
    ],
)
def test_a_frame_that_can_be_none_is_refused_and_not_taken(noisy, unmoved, hand, pose, words):
    stream = Stream(noisy.object.meshes, lag=0.0, source="the tracker")
    with pytest.raises(InputError, match="the tracker, frame 0: .*" + re.escape(words)):
        stream.push(hand, pose)
    assert stream.push(None).index == 0


def test_a_keypoint_that_is_not_found_costs_no_frame(noisy, unmoved):
    stream, joints = Stream(side="left", lag=0), noisy.hands[0].joints[:3].clone()
    joints[1, 8] = math.nan
    joints[2, 12] = 0.0
    made = [stream.push(frame) for frame in joints]
    assert [frame.filled for frame in made] == [False] * 3
    assert made[2].hand.joints[0, 12].norm() > 0.1


def test_a_wrist_at_the_origin_was_not_found(noisy, unmoved):
    stream, joints = Stream(side="left", lag=0), noisy.hands[0].joints[:3].clone()
    joints[1, [0, 4]] = 0.0
    joints[2] = 0.0
    made = [stream.push(frame) for frame in joints]
    assert [frame.filled for frame in made] == [False, False, True]
    assert float((made[1].hand.joints - noisy.hands[0].joints[1]).norm(dim=-1).max()) < 0.1


@pytest.mark.parametrize("every", [2, 4])
def test_frames_between_those_of_the_networks_are_used(clean, unmoved, every):
    clip = geneoh.Sequence(clean.hands, clean.object, 30.0 * every)[:40]
    lost = tuple(frame for frame in range(40) if frame % every != every // 2)
    found = pushed(Stream(clip.object.meshes, clip.fps, side="left"), clip, lost)[every:]
    assert all(frame.hand is not None for frame in found)
    apart = joints_of(found) - clip.hands[0].joints[every:]
    assert float(apart.norm(dim=-1).mean()) < 0.03  # of a hand that moves four times as fast


def test_a_hand_without_confidence_for_long_is_none(noisy, unmoved):
    stream, joints, found = Stream(side="left", lag=0.1), noisy.hands[0].joints, []
    for frame in range(146):
        sure = torch.full((21,), float(not 20 <= frame < 110))
        away = joints[frame] + 0.2 * (1 - sure[0])
        found.append(stream.push({"joints": away, "confidence": sure}))
    made = [frame for frame in found if frame] + stream.flush()
    assert all(frame.hand is None for frame in made[85:100])
    assert made[120].hand is not None


def test_fields_of_a_hand_stay_the_same(noisy, unmoved):
    stream, track = Stream(side="left"), noisy.hands[0]
    stream.push(track[:1])
    with pytest.raises(InputError, match="frame 1: the hand must have the same fields"):
        stream.push(track.joints[1])


@pytest.mark.parametrize(
    "settings",
    [
        *({"lag": 2.0}, {"lag": math.nan}, {"fps": 0.0}),
        *({"preset": "paper"}, {"hand_delay": 2}, {"selection": "closest"}),
    ],
)
def test_settings_that_no_stream_has_are_refused(settings):
    with pytest.raises(ConfigError, match=r"a stream (has|takes|gives)"):
        Stream(**settings)


@pytest.mark.parametrize(
    ("name", "meant"), [("sied", "side"), ("sides", "side"), ("obj", "meshes")]
)
def test_a_setting_that_does_not_exist_is_told_as_one_of_the_stream(name, meant):
    words = f"geneoh.Stream: '{name}' is no setting; did you mean '{meant}'"
    with pytest.raises(ConfigError, match=words):
        Stream(**{name: "left"})


def test_a_pose_may_be_a_list_of_rotation_and_translation(noisy, unmoved):
    turn, place = noisy.object.rotation[0, 0], noisy.object.translation[0, 0]
    pose = torch.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, place
    hand, mesh = noisy.hands[0][:1], noisy.object.meshes
    for given in ([turn, place], [turn.tolist(), place.tolist()], pose.tolist()):
        made = Stream(mesh, side="left", lag=0).push(hand, given)
        expected = Stream(mesh, side="left", lag=0).push(hand, (turn, place))
        assert torch.equal(made.hand.joints, expected.hand.joints)


def test_what_is_doubtful_is_logged_once_and_kept_until_the_next_recording(noisy, unmoved, caplog):
    stream, track = Stream(noisy.object.meshes, side="left", source="the tracker"), noisy.hands[0]
    for frame in range(70):
        stream.push(track[frame : frame + 1])
        assert bool(stream.doubts) == (frame >= 59)
    stream.flush()
    assert stream.doubts[0].startswith("no pose of the object in the first 60 frames")
    assert [record.getMessage()[:15] for record in caplog.records] == ["the tracker: no"]
    stream.push(track[:1])
    assert stream.doubts == ()


def test_poses_without_a_mesh_are_doubtful_once(noisy, unmoved, caplog):
    stream = Stream((), side="left")
    for _ in range(2):
        pushed(stream, noisy[:12])
        assert stream.doubts == (stream_module.POSES_UNREAD,)
    assert len(caplog.records) == 2
    stream.push(noisy.hands[0][:1])
    assert stream.doubts == ()


@pytest.mark.parametrize("frames", [12, 70])
def test_betas_of_another_hand_model_are_doubtful_where_no_keypoints_tell_the_shape(
    noisy, unmoved, frames
):
    stream = Stream((), side="left", betas=np.ones(10), hand_model="mano", lag=0.1)
    hand, words = replace(noisy.hands[0], joints=None), []
    for frame in range(frames):
        stream.push({"pose": hand.pose[frame], "wrist": hand.wrist[frame]})
        words.append(stream.doubts)
    stream.flush()
    (told,) = stream.doubts
    assert told.endswith("its betas belong to another hand model: the mean hand is used")
    assert words[-1] == (stream.doubts if frames > 60 else ())


def test_a_frame_that_shows_no_interaction_is_refused_and_not_taken(noisy, unmoved):
    stream, motion = Stream(noisy.object.meshes, side="left", lag=0.1), noisy.object
    away = 1000 * motion.translation[:60]
    for frame in range(59):
        stream.push(noisy.hands[0].joints[frame], (motion.rotation[frame], away[frame]))
    with pytest.raises(InputError, match="the stream, frame 59: the left hand must come near"):
        stream.push(noisy.hands[0].joints[59], (motion.rotation[59], away[59]))
    mended = motion.rotation[59], motion.translation[59]
    assert stream.push(noisy.hands[0].joints[59], mended).index == 56


@pytest.fixture(scope="module")
def cleaned(noisy, clean) -> tuple[Sequence, list[CleanFrame]]:
    """A short clip of the recording and what a stream makes of it, with all stages."""
    clip = noisy[40:80]
    return clip, pushed(Stream(clip.object.meshes, side="left"), clip)


@pytest.mark.slow
def test_a_stream_is_nearer_to_the_truth_than_its_input(cleaned, clean):
    clip, found = cleaned
    truth = clean.hands[0].joints[40:80]
    before, after = (
        float((joints - truth).norm(dim=-1).mean())
        for joints in (clip.hands[0].joints, joints_of(found))
    )
    assert after < 0.7 * before
    assert all(bool((frame.hand.joint_spread > 0).all()) for frame in found)


@pytest.mark.slow
def test_a_noisy_hand_that_hovers_beside_the_object_is_not_pulled_to_it(clean):
    clip = hovering(clean)[:90]
    noisy = corrupt_sequence(clip, "gauss", generator=seeded_generator(0, "gauss"))
    found = pushed(Stream(noisy.object.meshes, side="right"), noisy)
    assert float((joints_of(found) - clip.hands[0].joints).norm(dim=-1).mean()) < 0.013


@pytest.mark.slow
def test_the_same_frames_and_seed_give_the_same_result(cleaned):
    clip, found = cleaned
    stream = Stream(clip.object.meshes, side="left")
    assert torch.equal(joints_of(pushed(stream, clip)), joints_of(found))
    again = joints_of(pushed(stream, clip[:20]))  # after flush it begins anew
    assert torch.equal(again[:5], joints_of(found)[:5])


def test_fingers_touch_as_probably_in_the_next_recording(noisy, unmoved):
    stream = Stream(noisy.object.meshes, side="left")
    assert pushed(stream, noisy[40:80]) == pushed(stream, noisy[40:80])


@pytest.mark.slow
def test_keypoints_alone_and_lost_objects_are_cleaned(noisy, clean):
    clip = noisy[40:75]
    stream = Stream(clip.object.meshes, side="left")
    found = []
    for frame in range(35):
        motion = clip.object.rotation[frame], clip.object.translation[frame]
        found.append(stream.push(clip.hands[0].joints[frame], None if 10 <= frame < 14 else motion))
    found = [frame for frame in found if frame] + stream.flush()
    truth = clean.hands[0].joints[40:75]
    apart = float((joints_of(found) - truth).norm(dim=-1).mean())
    assert apart < float((clip.hands[0].joints - truth).norm(dim=-1).mean())
    joined = concatenated([frame.hand for frame in found])
    assert joined.frames == 35
    assert replace(clip, hands=(joined,)).frames == 35


@pytest.mark.parametrize(("fps", "apart"), [(30, 0.0), (25, 0.003)])
def test_keypoints_without_confidence_are_a_lost_hand(noisy, fps, apart):
    clip, found = noisy[:40], []
    for lost in (False, True):
        stream, frames = Stream(clip.object.meshes, fps, side="left"), []
        for frame in range(40):
            joints, sure = clip.hands[0].joints[frame], torch.ones(21)
            if 20 <= frame < 26:
                joints, sure = 9 * joints, torch.zeros(21)  # no hand is so large
            hand = None if lost and not bool(sure.any()) else {"joints": joints, "confidence": sure}
            pose = clip.object.rotation[frame], clip.object.translation[frame]
            frames.append(stream.push(hand, pose))
        made = [frame for frame in frames if frame] + stream.flush()
        assert [frame.index for frame in made if frame.filled] == list(range(20, 26))
        found.append(joints_of(made))
    torch.testing.assert_close(*found, atol=apart, rtol=0)


@pytest.mark.parametrize("keys", [False, True])
def test_a_hand_that_is_elsewhere_for_some_frames_leads_no_stream_away(noisy, clean, keys):
    """The faulty frames begin and end in the middle of what a push makes."""
    hand, wrong = noisy.hands[0], slice(70, 76)
    away = hand.joints.clone()
    away[wrong] += torch.tensor([0.3, 0.0, 0.2])
    stream = Stream(noisy.object.meshes, side="left")
    matrix = torch.eye(4).repeat(noisy.frames, 1, 1)
    matrix[:, :3, :3] = noisy.object.rotation[:, 0]
    matrix[:, :3, 3] = noisy.object.translation[:, 0]
    made = []
    for frame in range(40, 100):
        given = {"joints": away[frame]}
        if not keys:
            given |= {"pose": hand.pose[frame], "wrist": away[frame, 0]}
        made.append(stream.push(given, matrix[frame]))
    done = [frame for frame in made if frame is not None] + stream.flush()
    joints = torch.cat([frame.hand.joints for frame in done])
    off = (joints - clean.hands[0].joints[40:100]).norm(dim=-1).mean(-1)
    assert off[30:36].max() < 0.04
    assert off[36:].mean() < 0.03


def test_a_part_that_no_frame_has_a_pose_of_is_as_none(noisy):
    track, motion = noisy.hands[0], noisy.object
    alone, both = (Stream(motion.meshes * parts, side="left") for parts in (1, 2))
    for frame in range(12):
        turn, place = motion.rotation[frame], motion.translation[frame]
        lost = torch.full_like(place, torch.nan)
        alone.push(track[frame : frame + 1], (turn, place))
        both.push(track[frame : frame + 1], (turn.repeat(2, 1, 1), torch.cat([place, lost])))
    assert torch.equal(joints_of(both.flush()), joints_of(alone.flush()))


def test_a_recording_that_is_refused_at_its_end_is_ended(noisy, unmoved):
    stream, motion = Stream(noisy.object.meshes, side="left", lag=0.1), noisy.object
    for frame in range(8):
        away = motion.rotation[frame], 1000 * motion.translation[frame]
        stream.push(noisy.hands[0].joints[frame], away)
    with pytest.raises(InputError, match="the stream: the left hand must come near"):
        stream.flush()
    assert [frame.index for frame in pushed(stream, noisy[:5])] == [0, 1, 2, 3, 4]


def test_a_push_that_was_interrupted_ends_the_recording(noisy, unmoved, monkeypatch):
    def interrupt(*given, **more):
        raise KeyboardInterrupt

    stream, hand = Stream((), 30, 0.1, side="left"), noisy.hands[0]
    stream.push(hand[:1])
    with monkeypatch.context() as patched:
        patched.setattr(recent, "fit_hand", interrupt)
        with pytest.raises(KeyboardInterrupt):
            [stream.push(hand[frame : frame + 1]) for frame in range(1, 9)]
    with pytest.raises(InputError, match="was interrupted amid its work"):
        stream.push(hand[9:10])
    assert stream.flush() == []
    assert len(pushed(stream, noisy[:5])) == 5


def test_frames_that_are_alike_are_equal(noisy, unmoved):
    first, again = (pushed(Stream((), 30, side="left"), noisy[:2]) for _ in range(2))
    assert first == again
    assert first[0] != first[1]
