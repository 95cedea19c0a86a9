"""No noise of the object makes a hand worse than its input or a filter that ignores the object."""

import pytest
import torch
from torch import Tensor

import geneoh
from geneoh.baselines.filters import TUNED, filtered
from geneoh.choices import NOISES, OBJECT_NOISES
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.object_noise import corrupt_object
from geneoh.sequence.sequence import Sequence
from tools.noisy_objects.clips import beside, shaken


def error_and_acceleration(joints, truth) -> tuple[float, float]:
    """Mean keypoint error in mm, and mean acceleration in mm per frame squared."""
    off, bends = joints - truth, joints.diff(n=2, dim=0)
    return tuple(1000 * float(values.norm(dim=-1).mean()) for values in (off, bends))


def check_no_harm(noisy: Sequence, truth: Tensor) -> None:
    """The result is no worse than the better of the input and the filter, and as smooth."""
    hand = noisy.hands[0]
    result = geneoh.denoise(noisy, preset="fast").sequence.hands[0].joints
    error, acceleration = error_and_acceleration(result, truth)
    smooth = filtered(hand, TUNED["savgol", "parameters"], "parameters", noisy.fps)
    given, filter_ = (error_and_acceleration(j, truth) for j in (fill_gaps(hand).joints, smooth))
    assert error < 1.05 * min(given[0], filter_[0])
    # a filter that is best over all noises smooths the motion of a quiet hand as well
    own = error_and_acceleration(truth, truth)[1]
    assert acceleration < 1.2 * max(filter_[1], own)


@pytest.mark.slow
@pytest.mark.parametrize("kind", OBJECT_NOISES)
@pytest.mark.parametrize("noise", NOISES)
def test_a_noisy_object_does_no_harm(clean, noise, kind):
    clip = clean[30:75]
    generator = torch.Generator().manual_seed(5)
    noisy = corrupt_sequence(clip, noise, generator=generator)
    noisy = corrupt_object(noisy, kind, generator=generator)
    check_no_harm(noisy, clip.hands[0].joints)


@pytest.mark.slow
@pytest.mark.parametrize("noise", NOISES)
def test_shaking_an_object_does_no_harm(clean, noise):
    clip = shaken(clean[30:75])
    noisy = corrupt_sequence(clip, noise, generator=torch.Generator().manual_seed(5))
    check_no_harm(noisy, clip.hands[0].joints)


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "off"), [("gauss", 0.06), ("drop", 0.06), ("gauss", 0.015)])
def test_an_object_that_moves_without_the_hand_does_no_harm(clean, noise, off):
    clip = beside(clean, off)
    noisy = corrupt_sequence(clip, noise, generator=torch.Generator().manual_seed(5))
    check_no_harm(noisy, clip.hands[0].joints)


def test_a_clean_hand_that_shakes_its_object_is_hardly_changed(clean):
    clip = shaken(clean[30:90])
    result = geneoh.denoise(clip, preset="fast")
    assert not result.doubts
    error, _ = error_and_acceleration(result.sequence.hands[0].joints, clip.hands[0].joints)
    assert error < 5.0  # the recording itself is in its object by 2 to 3 mm
