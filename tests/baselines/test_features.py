from dataclasses import replace

import pytest
import torch

from geneoh.baselines.features import OBSERVATION_FEATURES


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_features_have_their_width_for_any_number_of_frames(make_observation, frames):
    assert make_observation(frames=frames).features().shape == (2, frames, OBSERVATION_FEATURES)


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
