"""MediaPipe's hands placed before the camera by their landmarks of the picture."""

import json

import numpy as np
import pytest
import torch

import geneoh
from geneoh.errors import ConfigError, InputError
from geneoh.hand.library import mean_hand

FRAMES, FOCAL, SIZE = 6, 600.0, (640, 480)
SHAPES = ("python", "javascript", "solution", "holistic")


@pytest.fixture(scope="module")
def joints():
    """A right hand of mean size before the camera, metres."""
    hand = mean_hand("right")
    pose = hand.model.pose_mean.expand(FRAMES, 16, 3).clone()
    pose[:, 0] = torch.tensor([1.2, 0.3, -0.4])
    wrist = torch.tensor([0.1, -0.05, 0.6]) + 0.01 * torch.arange(FRAMES)[:, None]
    return hand.posed(pose, wrist).joints.double().numpy()


def pictured(points):
    """Landmarks of the picture, as fractions of its size, with depths relative to the wrist."""
    place = FOCAL * points[:, :2] / points[:, 2:] / SIZE + 0.5
    depth = FOCAL * (points[:, 2] - points[0, 2]) / points[0, 2] / SIZE[0]
    return np.column_stack([place, depth])


def as_dicts(points):
    return [dict(zip("xyz", map(float, point), strict=True)) for point in points]


def result(points, shape="python", side="Right"):
    """The results of one frame as a program of MediaPipe gives them, of a hand whose size it does
    not know."""
    image, world = as_dicts(pictured(points)), as_dicts(0.8 * (points - points.mean(0)))
    label = {"score": 0.9, "categoryName": side, "label": side}
    match shape:
        case "python":
            names = ("hand_landmarks", "hand_world_landmarks", "handedness")
            return dict(zip(names, ([image], [world], [[label]]), strict=True))
        case "javascript":
            names = ("landmarks", "worldLandmarks", "handednesses")
            return dict(zip(names, ([image], [world], [[label]]), strict=True))
        case "solution":
            names = ("multi_hand_landmarks", "multi_hand_world_landmarks", "multi_handedness")
            listed = [{"landmark": image}], [{"landmark": world}], [{"classification": [label]}]
            return dict(zip(names, listed, strict=True))
        case _:
            name = f"{side.lower()}_hand"
            return {f"{name}_landmarks": image, f"{name}_world_landmarks": world}


@pytest.fixture
def read(tmp_path):
    """Writes results as JSON, and reads them with the camera's options."""

    def through_file(frames, **options):
        (tmp_path / "hand.json").write_text(json.dumps(frames))
        given = {"focal": FOCAL, "image_size": SIZE, **options}
        return geneoh.read("landmarks", tmp_path / "hand.json", **given)

    return through_file


def error_of(hand, joints):
    """Mean error in millimetres, in the frames with the hand."""
    seen = hand.valid.numpy()
    return 1e3 * np.linalg.norm(hand.joints.numpy()[seen] - joints[seen], axis=-1).mean()


@pytest.mark.parametrize("shape", SHAPES)
def test_hands_get_their_places_before_the_camera(shape, joints, read):
    frames = [result(points, shape) for points in joints]
    frames[2] = {}
    sequence = read(frames)
    (hand,) = sequence.hands
    assert hand.side == "right"
    assert hand.valid.tolist() == [True, True, False, True, True, True]
    assert error_of(hand, joints) < 10
    rays = torch.nn.functional.normalize(hand.joints[[0, 5], 0], dim=-1)
    assert hand.camera_ray is not None
    assert ((hand.camera_ray[[0, 5]] * rays).sum(-1).abs() > 0.98).all()
    assert "placed before the camera" in sequence.source
    assert "about the centre of each hand" not in sequence.source


def test_the_size_may_be_a_text_and_units_of_poses_do_not_count(joints, read):
    frames = [result(points) for points in joints]
    (hand,) = read(frames, image_size="640x480", keypoint_unit="mm").hands
    assert error_of(hand, joints) < 10


def test_landmarks_of_the_picture_alone_are_enough(joints, read):
    """Their depths, relative to the wrist, shape the hand."""
    frames = [{k: v for k, v in result(p).items() if "world" not in k} for p in joints]
    (hand,) = read(frames).hands
    assert error_of(hand, joints) < 20


def test_two_hands_are_placed_each_on_its_side(joints, read):
    frames = []
    for points in joints:
        frame, other = result(points), result(points * [-1, 1, 1], side="Left")
        frames.append({name: frame[name] + other[name] for name in frame})
    sequence = read(frames)
    assert error_of(sequence.hand("right"), joints) < 10
    assert error_of(sequence.hand("left"), joints * [-1, 1, 1]) < 10


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"image_size": None}, r"--focal: needs --image-size too, to place MediaPipe's hands"),
        ({"focal": None}, r"--image-size: needs --focal too"),
        ({"image_size": "640"}, r"--image-size: expected WIDTHxHEIGHT .* got '640'; correct"),
        ({"image_size": "0x480"}, r"--image-size: expected WIDTHxHEIGHT .* got '0x480'"),
        ({"image_size": (640, 480.5)}, r"--image-size: expected WIDTHxHEIGHT"),
        ({"image_size": 640}, r"--image-size: expected WIDTHxHEIGHT"),
    ],
)
def test_half_of_a_camera_is_refused(given, said, joints, read):
    with pytest.raises(ConfigError, match=said):
        read([result(points) for points in joints], **given)


def test_files_without_landmarks_of_the_picture_are_refused(joints, read):
    frames = [{k: v for k, v in result(p).items() if k != "hand_landmarks"} for p in joints]
    with pytest.raises(InputError, match=r"landmarks of the picture \(hand_landmarks\), got none"):
        read(frames)
    with pytest.raises(InputError, match=r"got none; save them too, or drop the options"):
        read([{"hand": "right", "points": points.tolist()} for points in joints])


@pytest.mark.parametrize("given", [{"image_size": (1, 1)}, {"focal": 1e9}, {"focal": 1e-3}])
def test_a_camera_that_cannot_see_a_hand_so_is_refused(given, joints, read):
    with pytest.raises(InputError, match=r"got points of a size that no hand has; correct --focal"):
        read([result(points) for points in joints], **given)


@pytest.mark.parametrize("wrong", [1e9, 1e300, 0.0])
def test_frames_with_landmarks_of_no_hand_count_as_not_seen(wrong, joints, read):
    frames = [result(points) for points in joints]
    for point in frames[2]["hand_world_landmarks"][0]:
        point["x"] = point["y"] = wrong
    frames[4]["hand_landmarks"][0][8]["y"] = wrong or 1e9
    (hand,) = read(frames).hands
    assert hand.valid.tolist() == [t not in (2, 4) for t in range(FRAMES)]
    assert error_of(hand, joints) < 10


def test_the_picture_alone_without_a_camera_names_the_options(joints, read):
    frames = [{k: v for k, v in result(p).items() if "world" not in k} for p in joints]
    with pytest.raises(InputError, match=r"have no size; .*or pass --focal and --image-size"):
        read(frames, focal=None, image_size=None)


def test_a_hand_with_the_object_is_cleaned_in_the_camera_s_frame(joints, read):
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, 3] = joints[:, 9] + [0, 0, 0.05]
    verts = 0.03 * (2.0 * torch.cartesian_prod(*[torch.arange(2.0)] * 3) - 1)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    box = geneoh.Mesh(verts, torch.tensor(faces))
    noisy = read([result(points) for points in joints], obj=box, object_pose=poses)
    clean = geneoh.denoise(noisy, geneoh.Options(preset="fast"))
    assert error_of(clean.sequence.hands[0], joints) < 40


@pytest.mark.parametrize("camera", [{}, {"focal": None, "image_size": None}])
def test_a_hand_has_the_side_of_its_fingers_unless_the_caller_names_one(joints, read, camera):
    """The older Hands name the other side in a picture that is not mirrored."""
    bent = joints.copy()
    axis = np.cross(joints[:, 5] - joints[:, 0], joints[:, 17] - joints[:, 0])
    bent[:, 4::4] += 0.05 * (axis / np.linalg.norm(axis, axis=-1, keepdims=True))[:, None]
    sequence = read([result(points, side="Left") for points in bent], **camera)
    assert [hand.side for hand in sequence.hands] == ["right"]
    assert "by its fingers it is a right hand" in sequence.source
    assert (
        read([result(points, side="Left") for points in bent], side="left").hands[0].side == "left"
    )


def test_frames_that_name_the_other_side_count_as_not_seen(joints, read):
    """In these, MediaPipe's landmarks were measured to be two to three times as far off."""
    frames = [result(points, side="Left" if t == 3 else "Right") for t, points in enumerate(joints)]
    sequence = read(frames)
    (hand,) = sequence.hands
    assert hand.valid.tolist() == [t != 3 for t in range(FRAMES)]
    assert "right hand counts as not seen in 1 frame, which name the other" in sequence.source
    assert error_of(hand, joints) < 10
