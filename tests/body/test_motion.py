import torch

from geneoh.body.motion import BodyMotion, body_local_rotations, grounded, pose
from geneoh.body.skeleton import PARENTS, Skeleton, embedded_skeleton
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand


def wild_motion(*shape: int) -> BodyMotion:
    generator = torch.Generator().manual_seed(3)
    turn = axis_angle_to_matrix(torch.randn(*shape, 52, 3, generator=generator))
    return BodyMotion(torch.randn(*shape, 3, generator=generator), turn)


def test_the_rest_pose_adds_up_the_offsets_and_the_root():
    skeleton, root = embedded_skeleton(), torch.tensor([[1.0, 2.0, 3.0]])
    posed = pose(skeleton, BodyMotion(root, torch.eye(3).expand(1, 52, 3, 3)))
    for joint in range(52):
        wanted, above = root[0].clone(), joint
        while above != -1:
            wanted += skeleton.offsets[above]
            above = PARENTS[above]
        torch.testing.assert_close(posed.positions[0, joint], wanted)


def test_the_root_moves_every_joint():
    motion = wild_motion(4)
    shifted = BodyMotion(motion.root + 1, motion.rotations)
    moved = pose(embedded_skeleton(), shifted).positions
    torch.testing.assert_close(moved, pose(embedded_skeleton(), motion).positions + 1)


def test_local_rotations_undo_the_accumulation():
    motion = wild_motion(2, 3)
    skeleton = Skeleton(embedded_skeleton().offsets.expand(2, 52, 3))
    posed = pose(skeleton, motion)
    torch.testing.assert_close(
        body_local_rotations(posed.rotations), motion.rotations, atol=1e-4, rtol=0
    )


def test_fingers_of_the_body_are_where_the_embedded_hand_has_them():
    motion = wild_motion(3)
    posed = pose(embedded_skeleton(), motion)
    for side, wrist, first in (("left", 20, 22), ("right", 21, 37)):
        shaped = load_hand(side).shaped(torch.zeros(10))
        joints = slice(first, first + 15)
        turn = torch.cat([posed.rotations[:, [wrist]], motion.rotations[:, joints]], dim=1)
        hand = shaped.joints_from_rotations(turn, posed.positions[:, wrist])
        mano = hand[:, [5, 6, 7, 9, 10, 11, 17, 18, 19, 13, 14, 15, 1, 2, 3]]
        torch.testing.assert_close(posed.positions[:, joints], mano, atol=1e-5, rtol=0)


def test_a_body_stands_on_the_ground_wherever_its_file_has_it():
    motion = wild_motion(5)
    moved = BodyMotion(motion.root - torch.tensor([1.0, 7.0, 2.0]), motion.rotations)
    found = [grounded(embedded_skeleton(), each) for each in (motion, moved)]
    for each in found:
        lowest = pose(embedded_skeleton(), each).positions[..., 1].amin()
        assert abs(float(lowest) - 0.02) < 1e-5
    torch.testing.assert_close(found[1].root[:, 1], found[0].root[:, 1])
    assert torch.equal(found[1].root[:, ::2], moved.root[:, ::2])
