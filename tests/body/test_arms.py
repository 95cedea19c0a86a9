import pytest
import torch

from geneoh.body.arms import FOREARM_TWIST, reach
from geneoh.body.motion import BodyMotion, PosedBody, pose
from geneoh.body.skeleton import JOINT_NAMES, Skeleton, embedded_skeleton
from geneoh.geometry.mirror import mirror_points, mirror_rotations
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle

WRISTS, ELBOWS = [20, 21], [18, 19]
STANDING = BodyMotion(torch.zeros(1, 3), torch.eye(3).expand(1, 52, 3, 3))


def hands_at(left: tuple, right: tuple) -> torch.Tensor:
    return torch.tensor([[left, right]])


def posed_reaching(positions, rotations=None, motion=STANDING, swivel=None) -> PosedBody:
    upright = torch.eye(3).expand(*positions.shape, 3)
    made = reach(
        embedded_skeleton(), motion, positions, upright if rotations is None else rotations, swivel
    )
    return pose(embedded_skeleton(), made)


def test_wrists_come_where_they_should_on_any_torso():
    generator = torch.Generator().manual_seed(1)
    bent = axis_angle_to_matrix(0.2 * torch.randn(40, 52, 3, generator=generator))
    motion = BodyMotion(torch.randn(40, 3, generator=generator), bent)
    before = pose(embedded_skeleton(), motion)
    chest = before.rotations[:, 9]
    place = torch.tensor([[0.2, 0.0, 0.35], [-0.2, 0.0, 0.35]])
    place = place + 0.05 * torch.randn(40, 2, 3, generator=generator)
    goal = (chest[:, None] @ place[..., None])[..., 0] + before.positions[:, [9, 9]]
    turn = axis_angle_to_matrix(torch.randn(40, 2, 3, generator=generator))
    after = posed_reaching(goal, turn, motion)
    torch.testing.assert_close(after.positions[:, WRISTS], goal, atol=1e-4, rtol=0)
    torch.testing.assert_close(after.rotations[:, WRISTS], turn, atol=1e-4, rtol=0)
    torch.testing.assert_close(after.positions[:, :13], before.positions[:, :13])


def test_a_hand_beyond_reach_stays_on_the_line_to_it():
    posed = posed_reaching(hands_at((3.0, 0.4, 0.2), (-0.3, 0.3, 0.3)))
    shoulder, wrist = posed.positions[0, 16], posed.positions[0, 20]
    away = torch.tensor([3.0, 0.4, 0.2]) - shoulder
    assert torch.linalg.cross((wrist - shoulder), away / away.norm()).norm() < 1e-3
    assert (wrist - shoulder).norm() == pytest.approx(0.5455, abs=2e-3)


def test_elbows_hang_below_hands_before_the_chest():
    posed = posed_reaching(hands_at((0.15, 0.35, 0.35), (-0.15, 0.35, 0.35))).positions[0]
    for elbow, shoulder, wrist, out in ((18, 16, 20, 1), (19, 17, 21, -1)):
        middle = (posed[shoulder] + posed[wrist]) / 2
        assert posed[elbow, 1] < middle[1] - 0.1
        assert out * posed[elbow, 0] > out * middle[0]


def test_elbows_bend_about_their_hinge_and_forwards():
    """In the arm's own frame the forearm of a bent arm leaves the upper arm forwards, not sideways.

    The hand keeps the forearm's own direction, so that no twist is shared out."""
    turned = posed_reaching(hands_at((0.3, 0.1, 0.2), (-0.3, 0.1, 0.2)))
    for shoulder, fore in ((16, 20), (17, 21)):
        bone = turned.positions[0, fore] - turned.positions[0, fore - 2]
        seen = turned.rotations[0, shoulder].T @ (bone / bone.norm())
        assert seen[2] > 0.5
        assert abs(seen[1]) < 0.1


def test_swivel_lifts_both_elbows_outwards():
    goal = hands_at((0.2, 0.3, 0.4), (-0.2, 0.3, 0.4))
    low = posed_reaching(goal).positions[0]
    high = posed_reaching(goal, swivel=torch.full((1, 2), 0.8)).positions[0]
    for elbow, out in ((18, 1), (19, -1)):
        assert high[elbow, 1] > low[elbow, 1] + 0.03
        assert out * high[elbow, 0] > out * low[elbow, 0] + 0.03
    torch.testing.assert_close(high[WRISTS], low[WRISTS], atol=1e-5, rtol=0)


def test_both_arms_are_mirror_images():
    turn = axis_angle_to_matrix(torch.tensor([[[0.3, -0.5, 0.2], [0.0, 0.7, -0.4]]]))
    goal = hands_at((0.25, 0.2, 0.3), (-0.1, 0.4, 0.25))
    posed = posed_reaching(goal, turn, swivel=torch.tensor([[0.3, -0.2]]))
    other = posed_reaching(
        mirror_points(goal).flip(1),
        mirror_rotations(turn).flip(1),
        swivel=torch.tensor([[-0.2, 0.3]]),
    )
    left_first = [JOINT_NAMES.index(f"{s}_elbow") for s in ("right", "left")]
    torch.testing.assert_close(
        mirror_points(other.positions[:, left_first]), posed.positions[:, ELBOWS]
    )


def test_the_forearm_shares_the_turn_of_the_hand():
    """A thumb that turns from forwards to up turns the elbow joint too; no wrist is wrung."""
    goal = hands_at((3.0, 0.44, -0.03), (-3.0, 0.44, -0.03))
    turns = axis_angle_to_matrix(torch.tensor([[0.0, 0.0, 0.0], [-torch.pi / 2, 0.0, 0.0]]))
    wrists = [
        reach(embedded_skeleton(), STANDING, goal, turn.expand(1, 2, 3, 3)).rotations[0, 20]
        for turn in turns
    ]
    taken = matrix_to_axis_angle(wrists[0].T @ wrists[1]).norm()
    assert taken == pytest.approx((1 - FOREARM_TWIST) * torch.pi / 2, abs=0.05)


def test_batches_of_bodies_are_solved_at_once():
    skeleton = Skeleton(embedded_skeleton().offsets * torch.tensor([0.9, 1.1])[:, None, None])
    motion = BodyMotion(torch.zeros(2, 3, 3), torch.eye(3).expand(2, 3, 52, 3, 3))
    goal = torch.tensor([[0.2, 0.2, 0.3], [-0.2, 0.2, 0.3]]).expand(2, 3, 2, 3)
    made = reach(skeleton, motion, goal, torch.eye(3).expand(2, 3, 2, 3, 3))
    torch.testing.assert_close(
        pose(skeleton, made).positions[:, :, WRISTS], goal, atol=1e-4, rtol=0
    )
