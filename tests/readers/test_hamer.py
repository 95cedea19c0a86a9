"""Dumps of HaMeR and WiLoR: fields that the demos change in place, containers, names of files."""

import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from trees import FRAMES, case_of, scene
from trees.writers import write_mesh

import geneoh
from geneoh.errors import ConfigError, InputError
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points
from geneoh.readers.transforms import axis_angles

Image = dict[str, Any]

CASE = case_of("hamer")
FOCAL = 600.0


def images(root: Path) -> list[Image]:
    """The detections of each image of the known interaction, right and left, as arrays."""
    CASE.write(root)
    value = torch.load(root / "video.pt")
    (root / "video.pt").unlink()
    frame, params = value.pop("frame"), value.pop("pred_mano_params")
    made = []
    for t in range(FRAMES):
        rows = torch.nonzero(frame == t)[:, 0]
        arrays = {name: part[rows].numpy() for name, part in value.items()}
        arrays["pred_mano_params"] = {name: part[rows].numpy() for name, part in params.items()}
        made.append(arrays)
    return made


def assert_right(path: Path, tolerance: float = 1e-4) -> Any:
    """Both hands are read as they are; returns the sequence."""
    sequence, s = geneoh.read("hamer", path, focal=FOCAL), scene(CASE.left)
    for side in ("right", "left"):
        hand = sequence.hand(side)
        np.testing.assert_allclose(hand.joints, s.joints[side], atol=tolerance)
        np.testing.assert_allclose(hand.pose, s.pose[side], atol=tolerance)
    return sequence


def numbered(root: Path, made: list[Any], name: str = "{:06d}.pt") -> None:
    """A file for each image."""
    for t, image in enumerate(made):
        torch.save(image, root / name.format(t))


def left(image: Image) -> np.ndarray:
    return image["right"] < 0.5


def with_demo_camera(image: Image) -> None:
    """As the demos do in place: the camera of left hands has its sign turned."""
    image["pred_cam"][:, 1] *= 2 * image["right"] - 1


def with_demo_keypoints(image: Image) -> None:
    """As WiLoR's demo does in place on a CPU, after the camera."""
    with_demo_camera(image)
    points = image["pred_keypoints_3d"]
    points[left(image)] = mirror_points(points[left(image)])


def with_whole_place(image: Image) -> None:
    """With the place that the demos make of the camera, beside it."""
    with_demo_camera(image)
    cam, size = image["pred_cam"], image["img_size"]
    spread = image["box_size"] * cam[:, 0]
    shift = 2 * (image["box_center"] - size / 2) / spread[:, None]
    focal = 5000 / 256 * size.max(1)
    place = [cam[:, 1] + shift[:, 0], cam[:, 2] + shift[:, 1], 2 * focal / spread]
    image["pred_cam_t_full"] = np.stack(place, axis=1)


@pytest.mark.parametrize("change", [with_demo_camera, with_demo_keypoints, with_whole_place])
def test_what_the_demos_change_in_place_is_found(tmp_path, change: Callable[[Image], None]):
    made = images(tmp_path)
    for image in made:
        change(image)
    numbered(tmp_path, made)
    sequence = assert_right(tmp_path)
    told = "some fields of left hands were mirrored back already" in sequence.source
    assert told == (change is not with_whole_place)


def wilor_mini(image: Image) -> list[dict[str, Any]]:
    """What WiLoR-mini gives for the image: a dict for each hand, left ones mirrored back."""
    with_whole_place(image)
    found = []
    for row, right in enumerate(image["right"]):
        params = {name: part[[row]] for name, part in image["pred_mano_params"].items()}
        turns = {n: axis_angles(params[n]) for n in ("global_orient", "hand_pose")}
        points = image["pred_keypoints_3d"][[row]]
        if not right:
            turns = {name: mirror_axis_angle(part) for name, part in turns.items()}
            points = mirror_points(points)
        preds = {**turns, "betas": params["betas"], "pred_keypoints_3d": points}
        preds["pred_cam_t_full"] = image["pred_cam_t_full"][[row]]
        preds["scaled_focal_length"] = 5000 / 256 * 640
        found.append({"hand_bbox": [1, 2, 3, 4], "is_right": float(right), "wilor_preds": preds})
    return found


@pytest.mark.parametrize("whole", [True, False], ids=["one file", "a file an image"])
def test_results_of_wilor_mini_are_read(tmp_path, whole):
    made = [wilor_mini(image) for image in images(tmp_path)]
    if whole:
        (tmp_path / "video.pkl").write_bytes(pickle.dumps(made))
    else:
        for t, image in enumerate(made):
            (tmp_path / f"{t:04d}.pkl").write_bytes(pickle.dumps(image))
    assert_right(tmp_path)


def test_an_image_without_hands_is_an_empty_list_of_wilor_mini(tmp_path):
    made = [wilor_mini(image) for image in images(tmp_path)]
    made[2] = []
    (tmp_path / "video.pkl").write_bytes(pickle.dumps(made))
    sequence = geneoh.read("hamer", tmp_path, focal=FOCAL)
    for hand in sequence.hands:
        assert hand.valid.tolist() == [t != 2 for t in range(FRAMES)]


@pytest.mark.parametrize("nothing", [None, [], {}])
def test_an_image_without_hands_may_hold_nothing(tmp_path, nothing):
    made: list[Any] = images(tmp_path)
    made[2] = nothing
    (tmp_path / "video.pkl").write_bytes(pickle.dumps(made))
    for hand in geneoh.read("hamer", tmp_path, focal=FOCAL).hands:
        assert hand.valid.tolist() == [t != 2 for t in range(FRAMES)]


def test_a_list_that_may_lack_images_is_told(tmp_path):
    made: list[Any] = images(tmp_path)
    numbered = [{**image, "img_path": f"{t:06d}.jpg"} for t, image in enumerate(made)]
    for entries, told in ((made[:2] + made[3:], True), ([made[0], {}, *made[2:]], False)):
        (tmp_path / "video.pkl").write_bytes(pickle.dumps(entries))
        source = geneoh.read("hamer", tmp_path, focal=FOCAL).source
        assert ("list {} for them" in source) is told
    (tmp_path / "video.pkl").write_bytes(pickle.dumps(numbered))
    assert "list {} for them" not in geneoh.read("hamer", tmp_path, focal=FOCAL).source


@pytest.mark.parametrize("name", ["frame_id", "img_path"])
def test_images_of_a_list_may_be_numbered_by_other_names(tmp_path, name):
    made: list[Any] = images(tmp_path)
    for t, image in enumerate(made):
        image[name] = f"video/{t + 5:06d}.jpg" if name == "img_path" else [t + 5] * 2
    (tmp_path / "video.pkl").write_bytes(pickle.dumps(made[:2] + made[3:]))
    for hand in geneoh.read("hamer", tmp_path, focal=FOCAL).hands:
        assert hand.valid.tolist() == [t != 2 for t in range(FRAMES)]


def as_list(root: Path, made: list[Image]) -> None:
    torch.save(made, root / "video.pt")


def as_dict(root: Path, made: list[Image]) -> None:
    torch.save({f"cam2_{t:05d}.jpg": image for t, image in enumerate(made)}, root / "video.pt")


def as_npz(root: Path, made: list[Image]) -> None:
    for t, image in enumerate(made):
        flat = {**image.pop("pred_mano_params"), **image}
        np.savez(root / f"{t:06d}.npz", **flat)


def as_json(root: Path, made: list[Image]) -> None:
    for t, image in enumerate(made):
        text = json.dumps(image, default=lambda array: array.tolist())
        (root / f"{t:06d}.json").write_text(text)


@pytest.mark.parametrize("save", [as_list, as_dict, as_npz, as_json])
def test_dumps_in_other_containers_are_read(tmp_path, save: Callable[[Path, list[Image]], None]):
    save(tmp_path, images(tmp_path))
    assert_right(tmp_path)


@pytest.mark.parametrize("name", ["cam1_{:06d}.pt", "P01_02_frame_{:d}.pt", "{:06d}_0.pt"])
def test_images_are_numbered_by_what_differs_in_their_names(tmp_path, name):
    numbered(tmp_path, images(tmp_path), name)
    torch.save({"note": "of the user"}, tmp_path / "meta.pt")
    assert "not read: meta.pt" in assert_right(tmp_path).source


def test_hands_of_one_image_may_have_files_of_their_own(tmp_path):
    for t, image in enumerate(images(tmp_path)):
        params = image.pop("pred_mano_params")
        for row in range(2):
            held = {name: part[[row]] for name, part in image.items()}
            held["pred_mano_params"] = {name: part[[row]] for name, part in params.items()}
            torch.save(held, tmp_path / f"{t:06d}_{row}.pt")
    assert_right(tmp_path)


def test_a_second_person_is_left_out_with_a_note(tmp_path):
    made = [wilor_mini(image) for image in images(tmp_path)]
    for hands in made[2:4]:
        (own,) = (hand for hand in hands if hand["is_right"])
        place = own["wilor_preds"]["pred_cam_t_full"] + [0.5, 0.0, 0.0]
        hands.insert(0, own | {"wilor_preds": own["wilor_preds"] | {"pred_cam_t_full": place}})
    (tmp_path / "video.pkl").write_bytes(pickle.dumps(made))
    source = assert_right(tmp_path).source
    assert "in 2 images more than one right hand: the one nearest to that" in source
    assert "one left hand" not in source


def test_names_that_may_mean_several_recordings_are_refused(tmp_path):
    made = images(tmp_path)
    numbered(tmp_path, made, "cam1_{:06d}.pt")
    numbered(tmp_path, made, "cam2_{:06d}.pt")
    with pytest.raises(InputError, match=r"expected names that differ in one number, .* of their"):
        geneoh.read("hamer", tmp_path)
    for path in tmp_path.glob("cam2_*"):
        path.rename(tmp_path / path.name.replace("cam2", "other"))
    with pytest.raises(InputError, match=r"expected files of one recording, .* got 2 sets"):
        geneoh.read("hamer", tmp_path)


def test_images_of_one_file_named_by_more_numbers_or_fewer_are_refused(tmp_path):
    names = ("000001.png", "000002_0.png", "000003.png")
    held = dict(zip(names, images(tmp_path), strict=False))
    (tmp_path / "video.pkl").write_bytes(pickle.dumps(held))
    with pytest.raises(InputError, match="expected names that differ in one number"):
        geneoh.read("hamer", tmp_path)


@pytest.mark.parametrize("held", [[1, 2], {"a1": 3}, "text", {}, [], None])
def test_other_values_are_refused(tmp_path, held):
    (tmp_path / "video.pkl").write_bytes(pickle.dumps(held))
    with pytest.raises(InputError, match="expected detections"):
        geneoh.read("hamer", tmp_path)


def test_hands_that_are_too_far_for_want_of_a_focal_length_are_told_its_option(tmp_path):
    CASE.write(tmp_path)
    s = scene(CASE.left)
    write_mesh(tmp_path / "object.obj", s.verts, s.faces)
    how = {"obj": tmp_path / "object.obj", "object_pose": s.matrices()}
    geneoh.read("hamer", tmp_path, focal=FOCAL, **how)
    with pytest.raises(InputError, match=r"must come near the object.* too deep, pass --focal$"):
        geneoh.read("hamer", tmp_path, **how)


@pytest.mark.parametrize("focal", [-5.0, 0.0, np.nan, np.inf])
def test_a_focal_length_of_no_camera_is_refused(tmp_path, focal):
    CASE.write(tmp_path)
    with pytest.raises(ConfigError, match="--focal: expected a length in pixels above 0, got"):
        geneoh.read("hamer", tmp_path, focal=focal)
