from dataclasses import replace

import pytest
import torch

from geneoh.denoisers.base import HAND_SCALE, NOISE_SCALE, OBSERVATION_FEATURES
from geneoh.geometry.rotations import axis_angle_to_matrix


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_features_have_their_width_for_any_number_of_frames(make_observation, frames):
    assert make_observation(frames=frames).features().shape == (2, frames, OBSERVATION_FEATURES)


def test_a_withheld_observation_says_nothing(make_observation):
    seen = make_observation()
    withheld = make_observation(given=0.0)
    assert not bool(withheld.features().any())
    assert not bool(withheld.anchor.any())
    assert torch.equal(withheld.scale, torch.full((2,), HAND_SCALE))
    assert torch.equal(seen.anchor, seen.joints)
    assert torch.equal(seen.scale, torch.full((2,), NOISE_SCALE))


def test_items_are_withheld_one_by_one(make_observation):
    seen = replace(make_observation(), given=torch.tensor([1.0, 0.0]))
    features = seen.features()
    assert torch.equal(features[0], make_observation().features()[0])
    assert not bool(features[1].any())
    assert seen.scale.tolist() == pytest.approx([NOISE_SCALE, HAND_SCALE])


def test_steady_motion_has_no_jitter_and_a_spike_has(make_observation):
    start = make_observation(frames=1).joints
    joints = start + 0.01 * torch.arange(6.0)[:, None, None]
    steady = replace(make_observation(), joints=joints, trust=torch.ones(2, 6, 21))
    jitter = slice(63 + 60, 63 + 60 + 63)
    assert float(steady.features()[..., jitter].abs().max()) < 1e-4
    spiked = replace(steady, joints=joints + 0.02 * (torch.arange(6) == 3)[:, None, None])
    seen = spiked.features()[..., jitter].abs().amax((0, 2))
    torch.testing.assert_close(seen, torch.tensor([0.0, 0, 1, 2, 1, 0]), atol=1e-4, rtol=0)


def test_bone_lengths_are_those_of_most_frames(make_observation):
    joints = make_observation(frames=1).joints.expand(-1, 5, -1, -1).clone()
    plain = replace(make_observation(), joints=joints, trust=torch.ones(2, 5, 21))
    torn = joints.clone()
    torn[:, 2] *= 3
    bones = slice(OBSERVATION_FEATURES - 21, OBSERVATION_FEATURES - 1)
    assert torch.equal(
        replace(plain, joints=torn).features()[..., bones], plain.features()[..., bones]
    )


def test_the_palms_axes_are_a_rotation_that_turns_with_the_hand(make_observation):
    seen = make_observation()
    axes, turn = seen.palm(), axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
    torch.testing.assert_close(axes @ axes.mT, torch.eye(3).expand(2, 3, 3), atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.linalg.det(axes), torch.ones(2))
    turned = replace(seen, joints=seen.joints @ turn.T)
    torch.testing.assert_close(turned.palm(), turn @ axes, atol=1e-5, rtol=0)
    torch.testing.assert_close(
        turned.turned(turned.palm()).joints, seen.turned(axes).joints, atol=1e-6, rtol=0
    )


def test_in_its_own_axes_the_palm_points_along_the_first_and_second(make_observation):
    seen = make_observation()
    joints = seen.turned(seen.palm()).joints.mean(1)
    middle, across = joints[:, 9] - joints[:, 0], joints[:, 5] - joints[:, 17]
    assert bool((middle[:, 0] > 0).all())
    assert float(middle[:, 1:].abs().max()) < 1e-6
    assert bool((across[:, 1] > 0).all())
    assert float(across[:, 2].abs().max()) < 1e-6


def test_a_withheld_hand_has_no_axes(make_observation):
    assert torch.equal(make_observation(given=0.0).palm(), torch.eye(3).expand(2, 3, 3))
