import pytest
import torch
from draws import seeded

from geneoh.hand.skeleton import TIP_KEYPOINTS, bone_lengths
from geneoh.representation.parameters import HandParameters
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.pose_prior import FINGER_STD
from geneoh.training.augmentation import AugmentationConfig, augmented


@pytest.fixture(scope="module")
def still(interactions) -> HandParameters:
    """Sixteen hands that do not move at all."""
    pick = torch.arange(16) % 4
    orient = torch.eye(3).expand(16, 30, 3, 3)
    fingers = interactions.pose[pick, :1, 1:].expand(16, 30, 15, 3)
    return HandParameters(torch.zeros(16, 30, 3), orient, fingers, interactions.offsets[pick])


def only(**kept: tuple[float, float]) -> AugmentationConfig:
    """Every hand moves in one way alone."""
    nothing = dict.fromkeys(("turn", "shift", "fingers"), (1e-9, 1.01e-9))
    return AugmentationConfig(share=1.0, style_share=0.0, **(nothing | kept))


def test_bones_keep_their_length(still):
    moved = augmented(still, Draws(16, seeded()))
    torch.testing.assert_close(
        bone_lengths(moved.joints), bone_lengths(still.joints), atol=1e-6, rtol=0
    )
    assert float((moved.joints - still.joints).norm(dim=-1).mean()) > 0.005


def test_a_hand_turns_about_its_fingertips(still):
    moved = augmented(still, Draws(16, seeded()), only(turn=(0.2, 0.201)))
    tips = [hand.joints[:, :, list(TIP_KEYPOINTS)].mean(2) for hand in (still, moved)]
    torch.testing.assert_close(tips[0], tips[1], atol=1e-6, rtol=0)
    assert float((moved.wrist - still.wrist).norm(dim=-1).mean()) > 0.01


def test_the_sizes_are_those_asked_for(still):
    config = only(shift=(0.01, 0.0101))
    shift = torch.cat([augmented(still, Draws(16, seeded(s)), config).wrist for s in range(8)])
    assert float(shift.std()) == pytest.approx(0.01, rel=0.15)
    config = only(fingers=(0.5, 0.501))
    bend = torch.cat(
        [augmented(still, Draws(16, seeded(s)), config).fingers - still.fingers for s in range(8)]
    )
    ratio = bend.std((0, 1)) / FINGER_STD
    assert float(ratio.mean()) == pytest.approx(0.5, rel=0.15)


def test_motion_is_smooth(still):
    wrist = augmented(still, Draws(16, seeded()), only(shift=(0.01, 0.0101))).wrist
    speed = wrist.diff(dim=1).norm(dim=-1).mean()
    assert 0 < float(speed) < 0.5 * float(wrist.norm(dim=-1).mean())


def test_equal_generators_vary_alike_and_some_windows_not_at_all(still):
    first, second = (augmented(still, Draws(16, seeded(3))) for _ in range(2))
    assert torch.equal(first.joints, second.joints)
    kept = (first.wrist - still.wrist).norm(dim=-1).amax(1) < 1e-6
    assert 0 < int(kept.sum()) < 16
