from dataclasses import replace

import pytest
import torch
from bad_inputs import FRAMES, good_arrays

import geneoh
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.sequence.distance_check import ball_distance
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.validation import check_sequence, check_tracks, collapsed

SHEET = Mesh(torch.tensor([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]), torch.tensor([[0, 1, 2]]))
HAND = HandTrack(
    "right",
    torch.ones(FRAMES, dtype=torch.bool),
    joints=torch.from_numpy(good_arrays()["joints"]),
    pose=torch.zeros(FRAMES, 16, 3),
)
UPRIGHT = torch.eye(3).repeat(FRAMES, 1, 1, 1)
OBJECT = ObjectTrack((SHEET,), UPRIGHT, torch.zeros(FRAMES, 1, 3))
GOOD = Sequence((HAND,), OBJECT, 30.0)


def of_two_parts(second: torch.Tensor) -> ObjectTrack:
    """An object of two parts, with (T, 1, 3, 3) rotations of the second one."""
    rotation, places = torch.cat([UPRIGHT, second], dim=1), torch.zeros(FRAMES, 2, 3)
    return ObjectTrack((SHEET, SHEET), rotation, places)


def test_a_plausible_sequence_passes():
    check_sequence(GOOD)
    check_sequence(replace(GOOD, hands=(HAND, replace(HAND, side="left"))))


def test_angles_of_several_turns_in_a_few_frames_are_no_degrees():
    """A tracker failed there; such files were refused with the advice to convert degrees."""
    assert HAND.pose is not None
    pose = HAND.pose.clone()
    pose[0] = 30.0
    check_sequence(replace(GOOD, hands=(replace(HAND, pose=pose),)))


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (replace(GOOD, hands=()), "one hand or one of each side, got none"),
        (replace(GOOD, hands=(HAND, HAND)), "got right and right"),
        (replace(GOOD, hands=(HAND[1:],)), f"got {FRAMES - 1} for the right hand and {FRAMES}"),
        (replace(GOOD, fps=0.04), "as seconds per frame it is 25, pass that"),
        (
            replace(GOOD, hands=(replace(HAND, pose=HAND.pose + 30 * torch.eye(16, 3)),)),
            "degrees",
        ),
        (
            replace(GOOD, hands=(replace(HAND, joints=HAND.joints + 2e4 * torch.eye(3)[0]),)),
            "the right hand must be within 10000 m of the origin, got a coordinate of 2e",
        ),
        (replace(GOOD, hands=(replace(HAND, valid=~HAND.valid),)), "at least one frame"),
        (
            replace(GOOD, object=replace(OBJECT, rotation=torch.zeros(FRAMES, 1, 3, 3))),
            "got in frame 0 determinant 0; write NaN in frames",
        ),
        (
            replace(GOOD, object=of_two_parts(2 * UPRIGHT)),
            "got in frame 0 a rotation times 2; a scale belongs to the mesh",
        ),
        (
            replace(GOOD, object=of_two_parts(UPRIGHT + 0.3 * torch.ones(3, 3).triu(1))),
            "got in frame 0 columns of unequal length or not at right angles",
        ),
        (replace(GOOD, hands=(replace(HAND, joints=0 * HAND.joints),)), "all its keypoints in one"),
        (
            replace(GOOD, hands=(replace(HAND, wrist=HAND.joints[:, 0] + 1),)),
            "'wrist' of the right hand must be where .* got 1.7 m between them",
        ),
        *(
            (replace(GOOD, hands=(replace(HAND, **{field: values}),)), f"'{field}' .* {words}")
            for field, values, words in (
                ("pose", torch.full((FRAMES, 16, 3), torch.nan), "must be finite wherever"),
                ("confidence", torch.full((FRAMES, 21), torch.nan), "must be finite wherever"),
                ("confidence", torch.full((FRAMES, 21), 2.0), "between 0 and 1, got 2 to 2"),
                ("betas", torch.full((10,), torch.nan), "must be finite, got NaN"),
            )
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_implausible_sequence_is_refused(bad, words):
    with pytest.raises(InputError, match=f"^the sequence: .*{words}"):
        check_sequence(bad)


@pytest.mark.parametrize("faces", [[[0, 1, 3]], [[0, 1, -1]], []])
def test_a_mesh_whose_faces_are_none_is_refused_wherever_it_comes_from(faces, tmp_path):
    mesh = Mesh(SHEET.verts, torch.tensor(faces).reshape(-1, 3).long())
    bad = replace(GOOD, object=replace(OBJECT, meshes=(mesh,)))
    for use in (
        lambda: geneoh.from_arrays(right_joints=HAND.joints, fps=30, meshes=mesh),
        lambda: geneoh.generate("lift the box", mesh),
        lambda: geneoh.save(bad, tmp_path / "a.npz"),
        lambda: geneoh.view(bad, tmp_path / "a.glb"),
    ):
        with pytest.raises(InputError, match=r"faces must index the 3 vertices|no face"):
            use()


def test_a_hand_may_be_zeros_in_most_of_the_frames():
    joints = HAND.joints.clone()
    joints[1:] = 0
    check_sequence(replace(GOOD, hands=(replace(HAND, joints=joints),)))


def test_keypoints_without_confidence_may_be_anywhere():
    confidence, eighth = torch.ones(FRAMES, 21), torch.tensor([8])
    confidence[:, [0, 8]] = 0.0
    joints = HAND.joints.clone()
    joints[:, [0, 8]] += 3.0
    lost = replace(HAND, joints=joints, wrist=HAND.joints[:, 0], confidence=confidence)
    check_sequence(replace(GOOD, hands=(lost,)))
    check_sequence(replace(GOOD, hands=(replace(lost, joints=joints.index_fill(1, eighth, 1e9)),)))
    with pytest.raises(InputError, match="these look like centimetres"):
        check_sequence(replace(GOOD, hands=(replace(lost, confidence=None),)))


def test_points_of_a_picture_with_a_score_are_not_said_to_be_millimetres_only():
    pixels = 1000 * HAND.joints
    pixels[..., 2] = torch.linspace(0.5, 1, 21)
    with pytest.raises(InputError, match="or like pixels, as all lie in a plane"):
        check_sequence(replace(GOOD, hands=(replace(HAND, joints=pixels),)))


@pytest.mark.parametrize("keep", [check_tracks, check_sequence])
def test_a_sequence_without_a_frame_is_refused(keep):
    with pytest.raises(InputError, match="expected at least one frame, got none"):
        keep(GOOD[2:2])


def test_a_hand_far_from_the_object_is_refused_only_where_there_is_a_mesh():
    far = replace(OBJECT, translation=OBJECT.translation + 2)
    with pytest.raises(InputError, match="stays 3"):
        check_sequence(replace(GOOD, object=far))
    check_sequence(replace(GOOD, object=replace(far, meshes=())))


def test_a_frame_of_zero_parameters_holds_no_hand():
    pose, wrist = torch.full((FRAMES, 16, 3), 0.1), torch.zeros(FRAMES, 3)
    pose[2:4] = 0
    hand = HandTrack("left", HAND.valid, pose=pose, wrist=wrist)
    assert collapsed(hand).nonzero().flatten().tolist() == [2, 3]
    flat = replace(hand, wrist=wrist + 1), replace(hand, pose=0 * pose)
    assert not any(bool(collapsed(each).any()) for each in flat)


def test_a_far_object_whose_inverse_poses_are_near_is_said_to_be_inverted():
    shift = torch.tensor([2.0, 0.0, 0.0])
    hand = replace(HAND, joints=HAND.joints + shift)
    with pytest.raises(InputError, match="world to object; invert them"):
        check_sequence(
            replace(
                GOOD, hands=(hand,), object=replace(OBJECT, translation=-shift.expand(FRAMES, 1, 3))
            )
        )
    far = replace(OBJECT, translation=shift.flip(0).expand(FRAMES, 1, 3))
    with pytest.raises(InputError, match="same frame"):
        check_sequence(replace(GOOD, hands=(hand,), object=far))


@pytest.mark.parametrize("scale", [1000.0, 100.0, 0.001])
def test_poses_in_another_unit_are_told_by_what_brings_the_hand_near(scale):
    shift = torch.tensor([0.3, 0.9, 2.0])
    hand = replace(HAND, joints=HAND.joints + shift)
    motion = replace(OBJECT, translation=scale * shift.expand(FRAMES, 1, 3))
    with pytest.raises(InputError, match=f"times {1 / scale:g} it comes near: give them in the"):
        check_sequence(replace(GOOD, hands=(hand,), object=motion))


def test_a_hand_in_the_axes_of_opengl_is_told_as_one():
    shift = torch.tensor([0.0, 0.2, 2.0])
    hand = replace(HAND, joints=(HAND.joints + shift) * torch.tensor([1.0, -1.0, -1.0]))
    motion = replace(OBJECT, translation=shift.expand(FRAMES, 1, 3))
    with pytest.raises(InputError, match=r"inverted, .*; or with y and z negated it comes near"):
        check_sequence(replace(GOOD, hands=(hand,), object=motion))
    turned = replace(motion, rotation=motion.rotation.roll(1, -1))
    with pytest.raises(InputError, match="away from it; with y and z negated it comes near"):
        check_sequence(replace(GOOD, hands=(hand,), object=turned))


def test_one_near_frame_is_near_enough():
    away = OBJECT.translation + torch.linspace(0, 5, FRAMES)[:, None, None]
    check_sequence(replace(GOOD, object=replace(OBJECT, translation=away)))
    unseen = replace(HAND, valid=torch.arange(FRAMES) > 2)
    with pytest.raises(InputError, match="near the object"):
        check_sequence(Sequence((unseen,), replace(OBJECT, translation=away), 30.0))


def test_ball_distance_moves_with_the_object():
    turn = torch.tensor([[[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]])
    verts = torch.tensor([[2.0, -1, 0], [2.0, 1, 0]])  # a ball of radius 1 around (2, 0, 0)
    distance = ball_distance(torch.zeros(1, 3), verts, turn, torch.tensor([[0.0, 3, 0]]))
    torch.testing.assert_close(distance, torch.tensor([4.0]))


def test_one_hand_may_hang_far_from_what_the_other_holds():
    away = replace(HAND, side="left", joints=HAND.joints + 2)
    check_sequence(replace(GOOD, hands=(HAND, away)))
    with pytest.raises(InputError, match="near the object"):
        check_sequence(replace(GOOD, hands=(replace(HAND, joints=HAND.joints - 3), away)))
