from dataclasses import replace

import numpy as np
import pytest
import torch

from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

T = 4
FLIP = torch.tensor([-1.0, 1.0, 1.0])
GENERATOR = torch.Generator().manual_seed(0)
VALID = torch.ones(T, dtype=torch.bool)


def normal(*shape: int) -> torch.Tensor:
    return torch.randn(*shape, generator=GENERATOR)


SKELETON = normal(20, 3).expand(T, 20, 3)
POSE, WRIST = normal(T, 16, 3), normal(T, 3)
JOINTS, _ = forward_kinematics(axis_angle_to_matrix(POSE), WRIST, SKELETON)
HAND = HandTrack("left", VALID, joints=JOINTS, pose=POSE, wrist=WRIST)


def test_the_mirrored_pose_moves_the_mirrored_skeleton_to_the_mirrored_joints():
    mirrored = HAND.mirrored()
    assert mirrored.side == "right"
    assert mirrored.pose is not None
    assert mirrored.wrist is not None
    joints, _ = forward_kinematics(
        axis_angle_to_matrix(mirrored.pose), mirrored.wrist, SKELETON * FLIP
    )
    torch.testing.assert_close(joints, JOINTS * FLIP, rtol=0, atol=1e-5)
    torch.testing.assert_close(joints, mirrored.joints, rtol=0, atol=1e-5)


def test_mirroring_twice_changes_nothing():
    twice = HAND.mirrored().mirrored()
    assert twice.side == "left"
    for name in ("joints", "pose", "wrist"):
        assert torch.equal(getattr(twice, name), getattr(HAND, name))


def test_the_mirrored_object_takes_mirrored_points_to_the_mirrored_place():
    mesh = Mesh(normal(5, 3), torch.tensor([[0, 1, 2], [2, 3, 4]]))
    motion = ObjectTrack((mesh,), axis_angle_to_matrix(normal(T, 1, 3)), normal(T, 1, 3))
    mirrored = motion.mirrored()
    moved = motion.rotation[:, 0] @ mesh.verts.T + motion.translation[:, 0, :, None]
    other = mirrored.rotation[:, 0] @ mirrored.meshes[0].verts.T
    other = other + mirrored.translation[:, 0, :, None]
    torch.testing.assert_close(other, moved * FLIP[:, None], rtol=0, atol=1e-5)


def test_a_hand_needs_joints_or_pose_with_wrist():
    for fields in ({}, {"pose": POSE}, {"wrist": WRIST}):
        with pytest.raises(InputError, match="'joints', or 'pose' together with 'wrist'"):
            HandTrack("right", VALID, **fields)


def test_a_sequence_gives_the_hand_of_a_side_or_says_that_it_has_none():
    motion = ObjectTrack((), torch.eye(3).repeat(T, 1, 1, 1), torch.zeros(T, 1, 3))
    sequence = Sequence((HAND,), motion, 30.0, "a.npz")
    assert sequence.hand("left") is HAND
    assert sequence.frames == HAND.frames == T
    with pytest.raises(InputError, match=r"a\.npz holds no right hand"):
        sequence.hand("right")
    with pytest.raises(InputError, match="the sequence holds no right hand"):
        replace(sequence, source="").hand("right")


def test_sequences_are_equal_where_all_fields_are_and_show_in_one_line():
    motion = ObjectTrack((), torch.eye(3).repeat(T, 1, 1, 1), torch.zeros(T, 1, 3))
    sequence = Sequence((HAND,), motion, 30.0, "a.npz")
    copy = sequence.map(torch.clone)
    assert sequence == copy
    assert copy.hands[0].joints is not None
    copy.hands[0].joints[0, 0, 0] += 1
    assert sequence != copy
    assert sequence != replace(sequence, fps=25.0)
    assert sequence != "a.npz"
    assert repr(sequence) == "Sequence(left hand, 4 frames, 30 fps, source='a.npz')"
    assert str(sequence) == "a.npz: 4 frames at 30 frames a second, no object"
    assert str(replace(sequence, source="")).startswith("sequence: 4 frames")


def test_tracks_and_meshes_are_equal_where_all_fields_are():
    mesh = Mesh(torch.eye(3), torch.tensor([[0, 1, 2]]))
    motion = ObjectTrack((mesh,), torch.eye(3).repeat(T, 1, 1, 1), torch.zeros(T, 1, 3))
    for value, other in (
        (HAND, replace(HAND, side="right")),
        (motion, motion[:2]),
        (mesh, replace(mesh, verts=2 * mesh.verts)),
    ):
        copy = value.map(torch.clone)
        assert value == copy
        assert copy in [value]
        assert value != other
        assert len({value, copy, other}) == 2


@pytest.mark.parametrize(
    ("frames", "fps"),
    [
        (slice(1, 3), 30),
        (slice(None, None, 2), 15),
        ([0, 2], 15),
        (torch.tensor([0, 3]), 10),
        (np.array([False, True, False, True]), 15),
        (np.array([2, 1]), 30),
    ],
)
def test_every_second_frame_comes_at_half_the_rate(frames, fps):
    sequence = Sequence((HAND,), ObjectTrack.resting((), T), 30.0)
    assert sequence[frames].fps == fps
    assert sequence[frames].frames == 2


@pytest.mark.parametrize("scale", [1.0, 0.1, 0.003])
def test_the_scale_of_confidences_does_not_matter(scale):
    sure = torch.linspace(0.2, 1.0, 21).expand(T, 21).clone()
    sure[:, -2:] = 1.0
    sure[2, 5] = 0.0  # not seen
    hand = replace(HAND, valid=torch.arange(T) != 1, confidence=scale * sure)
    expected = torch.where(hand.valid[:, None], sure, 0.0)
    torch.testing.assert_close(hand.trust, expected)
    assert torch.equal(replace(hand, confidence=hand.trust).trust, hand.trust)
    even = replace(HAND, valid=hand.valid, confidence=torch.full((T, 21), scale))
    assert torch.equal(even.trust, replace(even, confidence=None).trust)
    one = torch.full((T, 21), 0.1)
    one[0, 0] = 1.0  # a single value does not set the scale
    assert float(replace(HAND, confidence=scale * one).trust.min()) == 1.0
