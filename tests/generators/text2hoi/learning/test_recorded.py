"""Actions out of miniature trees of H2O, GRAB and ARCTIC, in each data set's own layout."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from trees import scene, write_mano
from trees.interaction import Scene, opened
from trees.mocap import arctic, grab
from trees.videos import h2o

from geneoh.errors import ConfigError, InputError
from geneoh.generators.text2hoi.learning.action_data import recorded_actions
from geneoh.generators.text2hoi.learning.recorded import RecordedConfig, surface_of
from geneoh.readers.base import ReaderOptions
from geneoh.readers.meshes import read_mesh
from geneoh.readers.sources.arctic import read_parts

POINTS = 200
CONFIG = RecordedConfig(points=POINTS)
FACE = np.array([0.03, 0.0, 0.0])
"""A place on the object's surface, which is a box."""
TIP = 8  # of the index finger


def touched(s: Scene, *sides: str) -> Scene:
    """The scene with the index fingers of some hands on the object, the other one away from it."""
    wrist, joints = {}, {}
    for side in ("left", "right"):
        face = s.rotation @ FACE + s.shift
        away = 0.0 if side in sides else 0.6
        move = face - s.joints[side][:, TIP] + away
        wrist[side] = s.wrist[side] + move
        joints[side] = s.joints[side] + move[:, None]
    return replace(s, wrist=wrist, joints=joints)


def grab_tree(root: Path, s: Scene, intent: str = "lift") -> None:
    grab(root, s, False)
    path = root / "grab/s1/mug_drink_1.npz"
    with np.load(path, allow_pickle=True) as file:
        fields = dict(file)
    contact = np.zeros((s.frames, len(s.verts)), np.int8)
    contact[4:, 0] = 30
    fields["contact"] = np.array({"object": contact}, dtype=object)
    fields["motion_intent"] = np.array(intent, dtype=object)
    np.savez(path, **fields)


def h2o_tree(root: Path, s: Scene, number: int = 23) -> None:
    h2o(root, s, False)
    folder = root / "subject1/h1/0/cam4/action_label"
    folder.mkdir()
    for frame in range(s.frames):
        (folder / f"{frame:06d}.txt").write_text(str(number if frame >= 3 else 0))


def arctic_tree(root: Path, s: Scene, hands: str = "both") -> None:
    arctic(root, s, False)
    file = root / "description/s01/box_grab_01/description.txt"
    file.parent.mkdir(parents=True)
    file.write_text(f"3-{s.frames} open {hands} box\n")


TREES = {"grab": (grab_tree, 120), "h2o": (h2o_tree, 30), "arctic": (arctic_tree, 30)}


@pytest.fixture
def mano(tmp_path):
    return write_mano(tmp_path / "mano")


def read(source, root, tmp_path, mano, config=CONFIG):
    options = ReaderOptions(mano_dir=mano)
    split = recorded_actions(source, root, tmp_path / "cache", config, options)
    return split.training, split.validation, split.notes


def built(source, root, *sides, **how):
    """The scene of a tree of a data set that is written to a folder."""
    build, frames = TREES[source]
    s = touched(scene(frames=frames), *sides)
    build(root, s, **how)
    return s


def made(source, tmp_path, mano, *sides, config=CONFIG, **how):
    """The only action of a tree of a data set, the data and the recording's scene."""
    s = built(source, tmp_path / "data", *sides, **how)
    found, _, _ = read(source, tmp_path / "data", tmp_path, mano, config)
    return found.actions.take(slice(None)), found, s


def frames_of(source, s):
    """The frames of the scene that the action of a tree holds."""
    first, step = {"grab": (4, 4), "h2o": (3, 1), "arctic": (2, 1)}[source]
    return np.arange(first, s.frames, step)


@pytest.mark.parametrize("source", TREES)
def test_verb_object_hands_and_length_are_those_of_the_data_set(source, tmp_path, mano):
    actions, found, s = made(source, tmp_path, mano, "left", "right")
    words = {"grab": ("lift", "mug"), "h2o": ("pour", "milk"), "arctic": ("open", "box")}
    assert (found.verbs[0], found.names[0]) == words[source]
    assert actions.hands.tolist() == [[True, True]]
    assert actions.length.tolist() == [len(frames_of(source, s))]


@pytest.mark.parametrize("source", TREES)
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_hand_that_stays_away_takes_no_part(source, side, tmp_path, mano):
    how = {"hands": side} if source == "arctic" else {}
    actions, _, _ = made(source, tmp_path, mano, side, **how)
    assert actions.hands.tolist() == [[side == "left", side == "right"]]
    absent = 1 if side == "left" else 0
    assert not actions.wrist[0, absent].any()
    assert not actions.pose[0, absent].any()


def test_arctic_leaves_out_a_hand_that_its_label_does_not_name(tmp_path, mano):
    actions, _, _ = made("arctic", tmp_path, mano, "left", "right", hands="right")
    assert actions.hands.tolist() == [[False, True]]


def recorded_points(source, root, s, frames):
    """(T, P, 3) the points of an action in the world of the recording."""
    folder = root / "meta/object_vtemplates/box"
    meshes = {
        "grab": lambda: (read_mesh(root / "tools/object_meshes/contact_meshes/mug.ply"),),
        "h2o": lambda: (read_mesh(root / "object/milk/milk.obj"),),
        "arctic": lambda: tuple(read_parts(folder.parent / "box")[0].values()),
    }[source]()
    surface = surface_of(meshes, POINTS)
    points, part = surface.points.double().numpy(), surface.part.numpy()
    whole = points @ s.rotation[frames].transpose(0, 2, 1) + s.shift[frames, None]
    lids = points @ opened(s)[frames, :3, :3].transpose(0, 2, 1) + s.shift[frames, None]
    return np.where((part == 1)[None, :, None], lids, whole)


@pytest.mark.parametrize("source", TREES)
def test_hands_and_object_move_as_they_did_up_to_the_place_of_the_table(source, tmp_path, mano):
    actions, _, s = made(source, tmp_path, mano, "left", "right")
    frames = frames_of(source, s)
    count = len(frames)
    world = actions.posed_points()[0, :count] @ actions.rotation[0, :count].mT
    world = world + actions.translation[0, :count, None]
    recorded = torch.tensor(recorded_points(source, tmp_path / "data", s, frames)).float()
    moved = recorded - world
    origin = moved[0, 0]
    torch.testing.assert_close(moved, origin.expand_as(moved), atol=3e-5, rtol=0)
    for number, side in enumerate(("left", "right")):
        wrist = torch.tensor(s.wrist[side][frames]).float() - origin
        torch.testing.assert_close(actions.wrist[0, number, :count], wrist, atol=3e-5, rtol=0)


@pytest.mark.parametrize("source", TREES)
def test_keypoints_are_the_recorded_ones_up_to_the_shape_of_the_hand(source, tmp_path, mano):
    actions, _, s = made(source, tmp_path, mano, "left", "right")
    frames = frames_of(source, s)
    count = len(frames)
    local = (actions.keypoints()[0, 1] - actions.translation[0, :, None])[:count]
    local = local @ actions.rotation[0, :count]
    recorded = (s.joints["right"][frames] - s.shift[frames, None]) @ s.rotation[frames]
    upright = torch.tensor(recorded @ s.rotation[0].T).float()
    spread = (local - upright).reshape(-1, 3)
    assert float((spread - spread.mean(0)).norm(dim=-1).mean()) < 0.02


@pytest.mark.parametrize("source", TREES)
def test_the_object_stands_upright_on_the_table_as_it_did_at_first(source, tmp_path, mano):
    how = {"hands": "right"} if source == "arctic" else {}
    actions, _, s = made(source, tmp_path, mano, "right", **how)
    first = frames_of(source, s)[0]
    assert float(actions.points[0, :, 2].min()) == pytest.approx(0.0, abs=1e-6)
    turned = torch.tensor(s.rotation[first] @ s.rotation[0].T).float()
    torch.testing.assert_close(actions.rotation[0, 0], turned, atol=1e-5, rtol=1e-4)
    torch.testing.assert_close(actions.translation[0, 0, :2], torch.zeros(2), atol=1e-6, rtol=0)


def test_arctic_lids_open_by_the_recorded_angle_about_the_hinge(tmp_path, mano):
    actions, _, s = made("arctic", tmp_path, mano, "left", "right")
    frames = frames_of("arctic", s)
    count = len(frames)
    torch.testing.assert_close(
        actions.joint[0, :count], torch.tensor(s.angle[frames]).float(), atol=1e-5, rtol=1e-4
    )
    assert set(actions.part[0].tolist()) == {0, 1}


def test_rigid_objects_have_no_joint(tmp_path, mano):
    actions, _, _ = made("grab", tmp_path, mano, "right")
    assert not actions.axis.any()
    assert not actions.joint.any()
    assert not actions.part.any()


def test_another_axis_may_point_up(tmp_path, mano):
    config = RecordedConfig(points=POINTS, up="x")
    actions, _, s = made("grab", tmp_path, mano, "right", config=config)
    recorded = recorded_points("grab", tmp_path / "data", s, frames_of("grab", s))
    world = actions.points[0] @ actions.rotation[0].mT
    world = world + actions.translation[0, :, None]
    risen = (world - world[:1])[: len(recorded), :, 2]
    expected = torch.tensor(recorded - recorded[:1])[..., 0].float()
    torch.testing.assert_close(risen, expected, atol=3e-5, rtol=0)


@pytest.mark.parametrize("source", TREES)
def test_validation_is_on_a_subject_of_its_own(source, tmp_path, mano):
    root = tmp_path / "data"
    built(source, root, "left", "right")
    one, other, folder = {
        "grab": ("s1", "s10", root / "grab"),
        "h2o": ("subject1", "subject2", root),
        "arctic": ("s01", "s02", root / "raw_seqs"),
    }[source]
    shutil.copytree(folder / one, folder / other)
    if source == "arctic":
        shutil.copytree(root / "description/s01", root / "description/s02")
    training, validation, notes = read(source, root, tmp_path, mano)
    assert (len(training.actions), len(validation.actions)) == (1, 1)
    assert f"1 of {other} held out for validation" in notes[0]
    named = RecordedConfig(points=POINTS, held_out=one)
    assert f"1 of {one} held out" in read(source, root, tmp_path, mano, named)[2][0]
    with pytest.raises(ConfigError, match=rf"expected one of {one}, {other}, got 'nobody'"):
        read(source, root, tmp_path, mano, RecordedConfig(points=POINTS, held_out="nobody"))


def test_what_was_made_is_kept_until_its_files_change(tmp_path, mano):
    root = tmp_path / "data"
    built("arctic", root, "left", "right")
    first = read("arctic", root, tmp_path, mano)[0]
    (shard,) = (tmp_path / "cache").glob("*.safetensors")
    before = shard.stat().st_mtime_ns
    again = read("arctic", root, tmp_path, mano)[0]
    assert shard.stat().st_mtime_ns == before
    one, two = (found.actions.take(slice(None)) for found in (first, again))
    assert torch.equal(one.wrist, two.wrist)
    file = root / "description/s01/box_grab_01/description.txt"
    file.write_text(file.read_text().replace("open", "close"))
    assert read("arctic", root, tmp_path, mano)[0].verbs == ("close",)


def test_a_label_whose_hands_touch_nothing_is_left_out_and_counted(tmp_path, mano):
    built("grab", tmp_path / "data")
    with pytest.raises(InputError, match=r"found none \(1 in which no hand touches the object\)"):
        read("grab", tmp_path / "data", tmp_path, mano)


def test_short_stretches_are_left_out(tmp_path, mano):
    grab_tree(tmp_path / "data", touched(scene(frames=60), "right"))
    with pytest.raises(InputError, match="1 of fewer than 20 frames"):
        read("grab", tmp_path / "data", tmp_path, mano)


def test_h2o_without_labels_is_refused(tmp_path, mano):
    h2o(tmp_path / "data", scene(frames=9), False)
    with pytest.raises(InputError, match="expected labels of actions in action_label of camera 4"):
        read("h2o", tmp_path / "data", tmp_path, mano)
