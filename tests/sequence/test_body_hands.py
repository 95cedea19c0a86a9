import bodies
import torch

from geneoh.body.motion import pose
from geneoh.body.skeleton import Skeleton, embedded_skeleton
from geneoh.hand.library import load_hand
from geneoh.sequence.body_hands import hand_tracks


def test_hands_of_the_embedded_skeleton_are_embedded_hands():
    motion = bodies.swaying()
    for hand in hand_tracks(embedded_skeleton(), motion):
        assert (hand.hand_model, hand.betas.any().item()) == ("embedded", False)
        posed = load_hand(hand.side).shaped(hand.betas).posed(hand.pose, hand.wrist)
        torch.testing.assert_close(posed.joints, hand.joints, atol=1e-5, rtol=0)


def test_hands_of_another_skeleton_have_its_bones():
    skeleton = Skeleton(1.1 * embedded_skeleton().offsets)
    motion = bodies.swaying()
    left, right = hand_tracks(skeleton, motion)
    assert (left.side, right.side) == ("left", "right")
    assert right.betas is None
    posed = pose(skeleton, motion).positions
    torch.testing.assert_close(right.joints[:, 0], posed[:, 21], atol=1e-5, rtol=0)
    torch.testing.assert_close(right.joints[:, 5], posed[:, 37], atol=1e-5, rtol=0)
    small = hand_tracks(embedded_skeleton(), motion)[1].joints
    apart = (right.joints[:, 8] - right.joints[:, 7]).norm(dim=-1)
    torch.testing.assert_close(apart, 1.1 * (small[:, 8] - small[:, 7]).norm(dim=-1))
