"""A hand cleaned against an object whose poses are relied on in part."""

import pytest
import torch

from geneoh.objects.evidence import blended

FRAMES = 90


def samples(shift: torch.Tensor, count: int = 2) -> torch.Tensor:
    """Samples of a hand of which every keypoint is at `shift`, (T, 3) metres."""
    return shift[None, :, None].expand(count, FRAMES, 21, 3)


ALONE = samples(torch.zeros(FRAMES, 3))
ASIDE = torch.tensor([0.03, 0.0, 0.0]).expand(FRAMES, 3)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_poses_that_count_fully_or_not_at_all_choose_one_of_both(share):
    found = blended(ALONE, samples(ASIDE), torch.full((FRAMES,), share), 1.0, 30.0)
    torch.testing.assert_close(found, share * samples(ASIDE), atol=2e-5, rtol=0)


def test_a_large_shift_that_lasts_is_kept_where_single_frames_are_hardly_relied_on():
    found = blended(ALONE, samples(ASIDE), torch.full((FRAMES,), 0.2), 1.0, 30.0)
    assert (found[:, 20:70, :, 0] > 0.7 * 0.03).all()


def test_a_shift_that_is_smaller_than_the_noise_of_the_poses_counts_as_a_frame_does():
    found = blended(ALONE, samples(0.1 * ASIDE), torch.full((FRAMES,), 0.2), 1.0, 30.0)
    torch.testing.assert_close(found, 0.2 * samples(0.1 * ASIDE))


def test_what_does_not_last_counts_as_a_frame_does():
    shaking = ASIDE * torch.tensor([1.0, -1.0]).repeat(FRAMES // 2)[:, None]
    found = blended(ALONE, samples(shaking), torch.full((FRAMES,), 0.2), 1.0, 30.0)
    torch.testing.assert_close(found, 0.2 * samples(shaking), atol=1e-5, rtol=0)


def test_a_shift_of_frames_that_are_relied_on_lasts_through_those_that_are_not():
    poses = torch.ones(FRAMES)
    poses[40:50] = 0.0
    found = blended(ALONE, samples(ASIDE), poses, 1.0, 30.0)
    assert (found[..., 0] > 0.99 * 0.03).all()


def test_a_hand_that_hardly_deals_with_its_object_hardly_follows_it():
    poses = torch.full((FRAMES,), 0.2)
    whole, part = (blended(ALONE, samples(ASIDE), poses, near, 30.0) for near in (1.0, 0.1))
    torch.testing.assert_close(part, 0.1 * whole)


def test_time_is_in_seconds():
    poses = torch.full((FRAMES,), 0.2)
    slow = blended(ALONE, samples(ASIDE), poses, 1.0, 30.0)
    fast = blended(
        *(v.repeat_interleave(2, dim=1) for v in (ALONE, samples(ASIDE))),
        poses.repeat_interleave(2),
        1.0,
        60.0,
    )
    torch.testing.assert_close(fast[:, ::2], slow, atol=2e-4, rtol=0)
