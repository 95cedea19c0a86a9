from dataclasses import replace

import pytest

from geneoh.synthesis.gestures.shards import DEFAULTS, synthesize_gestures
from geneoh.synthesis.shards import write_shards
from geneoh.viz.camera import cameras
from geneoh.viz.canvas import CAPTION_HEIGHT, TITLE_HEIGHT, filmstrip
from geneoh.viz.look import Look
from geneoh.viz.picture import hands_from_near
from geneoh.viz.sheet import (
    BODY_CELL,
    TEXT_HEIGHT,
    gesture_scene,
    gesture_sheet,
    one_of_each_gesture,
)

TINY = replace(DEFAULTS, count=6, shard=3, frames=20)


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    write_shards(folder, TINY, seed=0, synthesize=synthesize_gestures)
    return one_of_each_gesture(folder)


def test_each_gesture_is_shown_once_in_the_order_of_their_names(clips):
    numbers = [int(clip.gesture.max()) for clip in clips]
    assert numbers == sorted(set(numbers))
    assert 1 <= len(numbers) <= 6


def test_a_scene_shows_both_hands_and_the_limbs_of_the_middle_frame(clips):
    scene = gesture_scene(clips[0])
    assert [hand.side for hand in scene.versions[0].hands] == ["left", "right"]
    assert scene.frames == 1
    assert len(scene.limbs) > 15


def test_the_sheet_has_a_cell_for_each_clip(clips):
    picture = gesture_sheet(clips[:2])
    assert picture.shape[0] == BODY_CELL + TEXT_HEIGHT
    assert picture.shape[1] > 2 * BODY_CELL
    assert picture[:BODY_CELL, :BODY_CELL].std() > 5  # a body is drawn


def test_a_filmstrip_of_a_body_shows_its_hands_from_near_below_it(clips):
    scene = gesture_scene(clips[0])
    hands = scene.versions[0].hands[::-1]  # in any order
    scene = replace(scene, versions=(replace(scene.versions[0], hands=hands),))
    strip = filmstrip(scene, Look(cell=128, colouring="plain", up=scene.up))
    assert strip.shape[:2] == (TITLE_HEIGHT + 128 + 64 + CAPTION_HEIGHT, 128)
    near = strip[TITLE_HEIGHT + 128 :][:64].astype(int)
    skin = near[..., 0] - near[..., 2] > 20
    assert all(half.mean() > 0.05 for half in (skin[:, :64], skin[:, 64:]))
    camera = cameras(scene, Look(up=scene.up).upward)[0]
    right = next(hand for hand in hands if hand.side == "right")
    alone = replace(scene.versions[0], hands=(right,))
    (picture,) = hands_from_near(scene, alone, 0, camera, 64, "plain")
    shared = skin[:, :64] & (picture[..., 0].astype(int) - picture[..., 2] > 20)
    assert shared.sum() > 0.9 * skin[:, :64].sum() - 64  # the other hand may be seen too
