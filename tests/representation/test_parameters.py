import torch

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import forward_kinematics
from geneoh.representation.parameters import UNIT, HandParameters


def hands(seed: int, frames: int = 5) -> HandParameters:
    generator = torch.Generator().manual_seed(seed)

    def draw(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator)

    return HandParameters(
        0.2 * draw(2, frames, 3),
        axis_angle_to_matrix(draw(2, frames, 3)),
        0.4 * draw(2, frames, 15, 3),
        load_hand("right").shaped(torch.zeros(2, 10)).offsets,
    )


def test_joints_are_those_of_forward_kinematics():
    hand = hands(0)
    rotations = torch.cat([hand.turn[:, :, None], axis_angle_to_matrix(hand.fingers)], dim=2)
    want, _ = forward_kinematics(rotations, hand.wrist, hand.offsets[:, None])
    assert torch.equal(hand.joints, want)


def test_a_hand_of_a_pose_has_that_pose():
    hand = hands(5)
    made = HandParameters.of_pose(hand.wrist, hand.pose, hand.offsets)
    assert torch.equal(made.fingers, hand.fingers)
    torch.testing.assert_close(made.turn, hand.turn, atol=1e-5, rtol=0)
    torch.testing.assert_close(made.joints, hand.joints, atol=1e-5, rtol=0)


def test_the_change_to_another_hand_makes_that_hand():
    first, second = hands(1), hands(2)
    made = first.moved(first.change_to(second))
    torch.testing.assert_close(made.joints, second.joints, atol=1e-5, rtol=0)
    torch.testing.assert_close(made.turn, second.turn, atol=1e-5, rtol=0)


def test_no_change_leaves_the_hand_as_it_is():
    hand = hands(3)
    assert float(hand.change_to(hand).abs().max()) < 1e-2  # 1e-3 of a radian is float32's acos
    still = hand.moved(torch.zeros(2, 5, 51))
    torch.testing.assert_close(still.joints, hand.joints)


def test_a_change_of_one_is_a_unit_of_its_parameter():
    hand = hands(4)
    for index in (1, 4, 20):
        change = torch.zeros(2, 5, 51)
        change[..., index] = 1
        moved = hand.moved(change)
        shift = (moved.wrist - hand.wrist).norm(dim=-1)
        turn = (hand.turn.mT @ moved.turn).diagonal(dim1=-2, dim2=-1).sum(-1)
        angle = ((turn - 1) / 2).clamp(-1, 1).acos()
        bend = (moved.fingers - hand.fingers).flatten(-2).norm(dim=-1)
        for got, share in ((shift, index < 3), (angle, 3 <= index < 6), (bend, index >= 6)):
            want = torch.full_like(got, UNIT[index] * share)
            torch.testing.assert_close(got, want, atol=1e-3 * (not share) + 1e-4, rtol=0)


def test_hands_of_the_canonical_frame_are_those_of_the_world(make_scene):
    region = make_scene(0, frames=5).region()
    hand = hands(6)
    canon = hand.to_canon(region)
    torch.testing.assert_close(canon.joints, region.to_canon(hand.joints), atol=1e-5, rtol=0)
    back = canon.to_world(region)
    torch.testing.assert_close(back.joints, hand.joints, atol=1e-5, rtol=0)
