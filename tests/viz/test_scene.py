from dataclasses import replace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from pages import page_scene

from geneoh.errors import InputError
from geneoh.geometry.mirror import mirror_points
from geneoh.hand.library import load_hand
from geneoh.sequence.sequence import HandTrack
from geneoh.viz.camera import cameras
from geneoh.viz.look import LARGEST_DEPTH, SKIN_COLOUR, Look, ramp_colours, ramp_position
from geneoh.viz.outputs import refuse_colouring, write
from geneoh.viz.scene import make_scene


def test_the_mesh_is_that_of_the_tracks_own_parameters(scene, track):
    hand = scene.versions[0].hands[0]
    expected = load_hand("right").shaped(track.betas).posed(track.pose, track.wrist)
    torch.testing.assert_close(hand.verts, expected.verts, atol=1e-5, rtol=0)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_mesh_has_its_own_wrist_where_that_of_the_keypoints_lies_elsewhere(scene, track, side):
    hand = load_hand("right").shaped(track.betas).posed(track.pose, track.wrist)
    joints = hand.joints.clone()
    joints[:, 0, 0] += 0.01  # as in the skeleton of another tracker
    valid = torch.arange(len(joints)) != 2
    result = replace(track, joints=joints, valid=valid)
    sequence = replace_hands(scene, result if side == "right" else result.mirrored())
    (seen,) = make_scene({"result": sequence}).versions[0].hands
    verts = seen.verts if side == "right" else mirror_points(seen.verts)
    torch.testing.assert_close(verts[valid], hand.verts[valid], atol=1e-5, rtol=0)


def test_a_wrist_far_from_the_keypoints_does_not_move_the_mesh(scene, track):
    hand = load_hand("right").shaped(track.betas).posed(track.pose, track.wrist)
    odd = replace(track, joints=hand.joints, wrist=track.wrist + 0.09)
    (seen,) = make_scene({"odd": replace_hands(scene, odd)}).versions[0].hands
    torch.testing.assert_close(seen.verts, hand.verts, atol=1e-5, rtol=0)


def test_a_left_hand_is_the_mirror_image_of_the_right_one(scene):
    right, left = scene.versions[0].hands
    flip = torch.tensor([-1.0, 1.0, 1.0])
    # the left hand is not there in the first frame
    torch.testing.assert_close(left.verts[1:], right.verts[1:] * flip, atol=1e-5, rtol=0)
    assert left.model.faces.equal(right.model.faces[:, [0, 2, 1]])


def test_a_part_in_no_frame_is_not_drawn(scene, track, tmp_path):
    whole = replace_hands(scene, track)
    valid = torch.ones(whole.object.rotation.shape[:2], dtype=torch.bool)
    valid[:, 0] = False
    shown = make_scene({"box": replace(whole, object=replace(whole.object, valid=valid))})
    assert len(shown.drawn_object(0).verts) == len(shown.sharp_parts[1].verts)
    write(shown, tmp_path / "box.html")
    assert len(page_scene(tmp_path / "box.html")["parts"]) == 1
    files = write(shown, tmp_path / "box.ply").iterdir()
    assert {file.name.split("_")[0] for file in files} == {"right", "object2"}


def test_a_hand_in_no_frame_is_not_shown(scene, track):
    unseen = replace(track.mirrored(), valid=torch.zeros_like(track.valid))
    whole = replace_hands(scene, track)
    (hand,) = make_scene({"part": replace(whole, hands=(unseen, track))}).versions[0].hands
    assert hand.side == "right"
    with pytest.raises(InputError, match=r"must hold the left hand, got .*; choose frames with it"):
        make_scene({"part": replace(whole, hands=(unseen,))})


def test_depth_is_that_of_the_deepest_vertex_and_zero_outside(scene):
    before, after = (version.hands[0] for version in scene.versions)
    depth = before.measures.depth
    assert float(depth.min()) > 0.005
    torch.testing.assert_close(depth, -before.distance.amin(-1))
    assert float(after.measures.depth.max()) < float(depth.min())


def test_the_mesh_of_keypoints_alone_passes_through_them(scene):
    hand = scene.versions[0].hands[0]
    bare = HandTrack(side="right", valid=hand.valid, joints=hand.joints)
    sequence = replace_hands(scene, bare)
    seen = make_scene({"bare": sequence}).versions[0].hands[0]
    assert float((seen.verts - hand.verts).norm(dim=-1).mean()) < 0.004


@pytest.mark.parametrize("parameters", [("pose", "wrist"), ()])
def test_a_keypoint_that_was_never_seen_is_measured_where_the_hand_has_it(scene, parameters):
    hand = scene.versions[0].hands[0]
    own = {name: getattr(hand, name) for name in parameters}
    joints, confidence = hand.joints.clone(), torch.ones(hand.joints.shape[:2])
    joints[:, 8], confidence[:, 8] = torch.nan, 0.0
    seen = HandTrack("right", hand.valid, joints, confidence=confidence, **own)
    (shown,) = make_scene({"input": replace_hands(scene, seen)}).versions[0].hands
    assert float((shown.joints - hand.joints).norm(dim=-1).max()) < 0.02
    torch.testing.assert_close(shown.measures.fingers, hand.measures.fingers)
    assert float(shown.measures.acceleration[1:-1].max()) < 0.1


def replace_hands(scene, *hands):
    from geneoh.sequence.sequence import Sequence

    return Sequence(hands, scene.object, scene.fps)


def test_spread_over_the_skin_is_the_keypoints_where_they_agree(scene):
    spread = scene.versions[0].hands[0].spread
    torch.testing.assert_close(spread, torch.full_like(spread, 0.004))


def test_spread_over_the_skin_is_the_same_far_from_the_origin(scene):
    hand = scene.versions[0].hands[0]
    hand = replace(hand, joint_spread=torch.linspace(0, 0.02, 21).expand(scene.frames, 21))
    there = replace(hand, verts=hand.verts + 80, joints=hand.joints + 80)
    torch.testing.assert_close(there.spread, hand.spread, atol=1e-5, rtol=0)


def test_nothing_is_measured_against_a_part_that_was_never_seen(scene, track):
    seen = torch.tensor([False, True]).expand(len(track.pose), 2)
    moving = replace_hands(scene, track)
    hidden = replace(moving, object=replace(moving.object, valid=seen))
    both, one = (make_scene({"clip": each}).versions[0].measures for each in (moving, hidden))
    assert float(both.depth.min()) > 0.005  # the hand sinks into the first part
    assert float(one.depth.max()) == 0


def test_the_camera_does_not_look_for_a_part_that_was_never_seen(scene, track):
    moving = replace_hands(scene, track)
    seen = torch.tensor([True, False]).expand(len(track.pose), 2)
    hidden = replace(moving, object=replace(moving.object, valid=seen))
    alone = replace(moving, object=moving.object.of_parts([0]))
    up = Look().upward
    one, other = (cameras(make_scene({"clip": each}), up)[0] for each in (hidden, alone))
    assert (one.target.tolist(), one.radius) == (other.target.tolist(), other.radius)


def test_poses_that_the_object_lacks_are_filled_in(scene, track):
    moving = replace_hands(scene, track)
    lacking = moving.object.translation.clone()
    lacking[2:4] = torch.nan
    shown = make_scene(
        {"clip": replace(moving, object=replace(moving.object, translation=lacking))}
    )
    torch.testing.assert_close(shown.object.translation, moving.object.translation)
    assert shown.object.observed[:, 0].tolist() == [True, True, False, False, True, True]
    assert bool(shown.versions[0].measures.depth.isfinite().all())


def test_an_object_that_is_lost_at_a_cut_rests_in_either_shot(scene, track):
    away = 5.0 * (torch.arange(len(track.pose)) >= 3)[:, None]
    moved = replace(track, wrist=track.wrist + away)
    video = replace(replace_hands(scene, moved), fps=3.0)
    places = video.object.translation + away[:, None]
    lost = torch.isin(torch.arange(len(places)), torch.tensor([2, 3]))
    motion = replace(video.object, translation=places, valid=~lost[:, None].expand(-1, 2))
    shown = make_scene({"video": replace(video, object=motion)}).object.translation
    assert shown.equal(places[[0, 1, 1, 4, 4, 5]])


def test_an_object_of_which_no_part_was_seen_is_as_none(scene, track, tmp_path):
    moving = replace_hands(scene, track)
    lost = replace(moving.object, valid=torch.zeros(len(track.pose), 2, dtype=torch.bool))
    shown = make_scene({"clip": replace(moving, object=lost)})
    assert not shown.has_object
    (version,) = page_scene(write(shown, tmp_path / "clip.html"))["versions"]
    assert version["curves"].keys() == {"acceleration"}
    with pytest.raises(InputError, match="the colour contact needs an object"):
        refuse_colouring(shown, "contact")


def test_samples_of_a_hand_that_is_not_shown_are_left_out(scene, track):
    drawn = torch.zeros(2, len(track.pose), 21, 3)
    alone = replace_hands(scene, track)
    found = make_scene({"clip": alone}, samples={"left": drawn, "right": drawn})
    assert list(found.samples) == ["right"]


def test_means_are_over_the_frames_that_the_input_has(scene):
    version = scene.versions[0]
    filled = torch.tensor([0, 0, 0, 0, 0, 1]).bool()
    found, every = replace(scene, filled=filled).means(version), scene.means(version)
    measures = version.measures
    assert every == measures.means()
    depth = 1000 * float(measures.depth[:5].mean())
    assert found["penetration_mean_mm"] == pytest.approx(depth)
    kept = measures.counted(~filled)
    assert kept.valid.tolist() == [True] * 5 + [False]
    assert kept.acceleration.isfinite().tolist() == [False, True, True, True, False, False]


def test_means_do_not_count_the_leap_at_a_cut_of_the_video(scene):
    away = 5.0 * (torch.arange(scene.frames) >= 3)[:, None, None]
    versions = tuple(
        replace(v, hands=tuple(replace(hand, joints=hand.joints + away) for hand in v.hands))
        for v in scene.versions
    )
    moved = replace(scene, versions=versions, fps=3.0)
    assert moved.cuts == [3]
    for version in versions:
        assert float(version.measures.acceleration[2:4].min()) > 1000
        assert moved.means(version)["acceleration_mm"] < 0.01


def test_versions_of_different_length_are_refused(scene, track):
    long = replace_hands(scene, track)
    with pytest.raises(InputError, match="same frames, got 6 against 3"):
        make_scene({"before": long, "after": long[:3]})


def penetration_colours(*distance):
    position = ramp_position("penetration", torch.tensor(distance), None)
    return ramp_colours("penetration", position.numpy())


@given(st.floats(0, 0.02))
def test_skin_outside_keeps_its_colour(distance):
    colour = penetration_colours(distance)
    assert colour[0].tolist() == pytest.approx(SKIN_COLOUR, abs=1e-6)


def test_penetration_beyond_the_scale_has_the_last_colour():
    deep = penetration_colours(-LARGEST_DEPTH, -1.0)
    assert (deep[0] == deep[1]).all()
