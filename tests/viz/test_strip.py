from dataclasses import replace

import numpy as np
import pytest
import torch

from geneoh.errors import InputError
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.viz.camera import cameras
from geneoh.viz.canvas import (
    CAPTION_HEIGHT,
    LEAST_COLUMN,
    SCALE_HEIGHT,
    STRIP_GAP,
    TITLE_HEIGHT,
    depth_words,
    filmstrip,
)
from geneoh.viz.look import Look
from geneoh.viz.scene import make_scene

UP = Look().upward


def test_a_strip_has_a_row_for_each_version_and_a_cell_for_each_frame(scene):
    strip = filmstrip(scene, Look(frames=(0, 5), cell=64))
    assert strip.shape == (
        2 * (TITLE_HEIGHT + 64 + CAPTION_HEIGHT) + SCALE_HEIGHT,
        2 * LEAST_COLUMN + STRIP_GAP,
        3,
    )
    assert strip.dtype == np.uint8


def test_the_words_of_a_narrow_strip_are_whole(scene):
    for title in ("noisy", "a title that is longer than its picture"):
        first = replace(scene.versions[0], title=title)
        strip = filmstrip(replace(scene, versions=(first,)), Look(frames=(2,), cell=64))
        # nothing is drawn at the right edge
        assert (strip[:, -8:] == strip[0, -1]).all()


def test_the_hand_that_sank_is_redder_than_the_one_that_did_not(scene):
    strip = filmstrip(scene, Look(frames=(2,), cell=96)).astype(int)
    tops = (TITLE_HEIGHT, 2 * TITLE_HEIGHT + 96 + CAPTION_HEIGHT)
    rows = [strip[top : top + 96] for top in tops]
    red = [int(((row[..., 0] - row[..., 1]) > 48).sum()) for row in rows]
    assert red[0] > 20
    assert red[0] > 4 * red[1]


def test_frames_without_a_hand_say_so(scene):
    left = replace(scene.versions[1], hands=scene.versions[1].hands[1:])  # from the second frame on
    assert [depth_words(scene, left, frame) for frame in (0, 1)] == ["no hand", "3.0 mm deep"]
    alone = replace(scene, object=ObjectTrack.resting((), scene.frames))
    assert [depth_words(alone, left, frame) for frame in (0, 1)] == ["no hand", ""]


def test_the_same_scene_gives_the_same_picture(scene):
    a, b = (filmstrip(scene, Look(frames=(1,), cell=64)) for _ in range(2))
    assert (a == b).all()


@pytest.mark.parametrize(("more", "below"), [(1.1, False), (1.3, True)])
def test_the_camera_is_below_only_where_it_sees_much_more(scene, monkeypatch, more, below):
    def seen(hands, camera):
        return more if camera.axes[2] @ UP < -0.1 else 1.0

    monkeypatch.setattr("geneoh.viz.camera._seen_pixels", seen)
    assert (cameras(scene, UP)[0].axes[2] @ UP < -0.1) == below


def test_the_axes_are_a_rotation_with_up_upwards(scene):
    axes = cameras(scene, UP)[0].axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert axes[1] @ UP > 0.5


def test_the_camera_keeps_its_direction_and_size_over_the_clip(scene):
    first, *rest = cameras(scene, UP)
    assert len(rest) == scene.frames - 1
    assert all((camera.axes == first.axes).all() for camera in rest)
    assert {camera.radius for camera in rest} == {first.radius}


def test_every_hand_is_whole_in_the_picture_wrist_included(scene):
    for frame, camera in enumerate(cameras(scene, UP)):
        for hand in (hand for version in scene.versions for hand in version.hands):
            seen = camera.project(hand.verts[frame].numpy().astype(float), (200, 200))[:, :2]
            assert not hand.valid[frame] or (seen.min() > 0 and seen.max() < 200)


def trembling(version, amount):
    """The version with every second frame moved aside, and no hand in the first."""
    hands = []
    for hand in version.hands:
        aside = amount * (torch.arange(len(hand.joints)) % 2)[:, None, None]
        valid = torch.arange(len(hand.joints)) > 0
        joints = torch.where(valid[:, None, None], hand.joints + aside, torch.nan)
        hands.append(replace(hand, joints=joints, valid=valid))
    return replace(version, hands=tuple(hands))


def test_the_camera_does_not_tremble_with_the_hand_nor_lose_it(scene):
    shaken = replace(scene, versions=tuple(trembling(version, 0.03) for version in scene.versions))
    path = np.stack([camera.target for camera in cameras(shaken, UP)])
    assert np.isfinite(path).all()
    steps = np.linalg.norm(np.diff(path, axis=0), axis=-1)
    assert steps.max() < 0.003


def test_the_camera_leaps_at_a_cut_as_the_hand_does(scene):
    cut = scene.frames // 2
    away = 5.0 * (torch.arange(scene.frames) >= cut)[:, None, None]
    versions = tuple(
        replace(v, hands=tuple(replace(hand, joints=hand.joints + away) for hand in v.hands))
        for v in scene.versions
    )
    moved = replace(scene, versions=versions, fps=3.0)
    path = [camera.target for camera in cameras(moved, UP)]
    steps = np.linalg.norm(np.diff(path, axis=0), axis=-1)
    assert steps[cut - 1] > 8
    assert np.delete(steps, cut - 1).max() < 0.1


def test_a_hand_that_is_rarely_there_is_seen_as_one_that_always_is(track):
    long = track[torch.zeros(200, dtype=torch.long)]
    rare = replace(long, valid=torch.arange(200) == 70)
    seen = []
    for hand in (long, rare):
        alone = Sequence((hand,), ObjectTrack.resting((), 200), 30.0, "alone")
        seen.append(cameras(make_scene({"alone": alone}), UP)[70])
    np.testing.assert_allclose(seen[1].axes, seen[0].axes)
    assert seen[1].radius == pytest.approx(seen[0].radius, rel=1e-4)


@pytest.mark.parametrize(
    ("colouring", "height"), [("spread", SCALE_HEIGHT), ("penetration", 0), ("plain", 0)]
)
def test_of_hands_without_an_object_the_spread_alone_has_a_scale(scene, colouring, height):
    alone = replace(scene, object=ObjectTrack.resting((), scene.frames))
    assert alone.versions[1].hands[0].joint_spread is not None
    strip = filmstrip(alone, Look(colouring=colouring, frames=(0,), cell=64))
    assert strip.shape[0] == 2 * (TITLE_HEIGHT + 64 + CAPTION_HEIGHT) + height


def test_a_frame_that_is_not_there_is_refused(scene):
    with pytest.raises(InputError, match="from 0 to 5, got 6"):
        filmstrip(scene, Look(frames=(6,), cell=64))


def test_an_object_that_is_nearly_whole_is_not_cut(scene):
    far = scene.object.translation.clone()
    far[:, 1, 0] += 0.18
    aside = replace(scene, object=replace(scene.object, translation=far))
    mesh = aside.object.meshes[1]
    for frame, camera in enumerate(cameras(aside, UP)):
        placed = (mesh.verts + far[frame, 1]).numpy().astype(float)
        seen = camera.project(placed, (200, 200))[:, :2]
        assert seen.min() > 0
        assert seen.max() < 200


def test_hands_and_an_object_that_is_whole_are_in_the_middle_of_the_picture(scene):
    motion, hands = scene.object, [hand for version in scene.versions for hand in version.hands]
    for frame, camera in enumerate(cameras(scene, UP)):
        turned = zip(motion.meshes, motion.rotation[frame], motion.translation[frame], strict=True)
        placed = [mesh.verts @ rotation.T + place for mesh, rotation, place in turned]
        placed += [hand.verts[frame] for hand in hands if hand.valid[frame]]
        seen = camera.project(torch.cat(placed).numpy().astype(float), (200, 200))[:, :2]
        np.testing.assert_allclose((seen.min(0) + seen.max(0)) / 2, 100, atol=12)
