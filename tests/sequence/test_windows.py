import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from geneoh.sequence.windows import (
    blend_weights,
    fold,
    spread_frames,
    unfold,
    widened,
    window_starts,
)

CUTS = st.tuples(st.integers(1, 200), st.integers(1, 60), st.floats(0.05, 1)).map(
    lambda cut: (cut[0], cut[1], max(1, round(cut[2] * cut[1])))
)


@given(CUTS)
def test_windows_hold_every_frame_and_end_with_the_track(cut):
    frames, size, stride = cut
    starts = window_starts(frames, size, stride)
    held = {frame for start in starts for frame in range(start, min(start + size, frames))}
    assert held == set(range(frames))
    assert all(0 < step <= stride for step in map(int, torch.tensor(starts).diff()))
    assert starts[-1] == max(frames - size, 0)


def test_a_track_not_longer_than_a_window_is_one_window():
    assert window_starts(60) == window_starts(1) == [0]
    assert window_starts(61) == [0, 1]
    assert window_starts(120) == [0, 30, 60]
    assert window_starts(146) == [0, 28, 57, 86]


@given(CUTS)
def test_folding_undoes_unfolding(cut):
    frames, size, stride = cut
    starts = window_starts(frames, size, stride)
    x = torch.randn(2, frames, 3, generator=torch.Generator().manual_seed(frames))
    windows = unfold(x, starts, size)
    assert windows.shape == (2, len(starts), size, 3)
    torch.testing.assert_close(fold(windows, starts, frames), x, rtol=0, atol=2e-6)


@given(CUTS)
def test_weights_of_each_frame_sum_to_one(cut):
    frames, size, stride = cut
    starts = window_starts(frames, size, stride)
    total = fold(torch.ones(len(starts), size, 1), starts, frames)
    torch.testing.assert_close(total, torch.ones(frames, 1), rtol=0, atol=1e-6)
    assert bool((blend_weights(starts, size, frames) >= 0).all())


def test_a_short_track_is_held_still_after_its_end():
    x = torch.arange(4.0)[:, None]
    assert unfold(x, [0], 6)[0, :, 0].tolist() == [0, 1, 2, 3, 3, 3]


@pytest.mark.parametrize("frames", [61, 90, 146, 200])
def test_windows_that_disagree_are_crossed_without_a_seam(frames):
    starts = window_starts(frames)
    levels = torch.arange(len(starts), dtype=torch.float32) % 2  # neighbours differ by one
    blended = fold(levels[:, None, None].expand(-1, 60, 1), starts, frames)
    # A raised cosine over the 30 or more frames that two windows share climbs by pi / 60 a frame
    # at most; up to four frames belong to three windows.
    assert float(blended.diff(dim=0).abs().max()) < 1.1 * torch.pi / 60
    assert float(blended.min()) >= 0
    assert float(blended.max()) <= 1


def test_fold_lets_gradients_through():
    windows = torch.ones(2, 60, 1, requires_grad=True)
    fold(windows, [0, 20], 80).sum().backward()
    assert windows.grad is not None
    torch.testing.assert_close(windows.grad.sum(), torch.tensor(80.0))


def test_frames_are_spread_over_the_track_and_never_more_than_it_has():
    assert spread_frames(20, 4) == [2, 7, 12, 17]
    assert spread_frames(3, 30) == [0, 1, 2]


def test_a_block_is_widened_up_to_the_ends_of_the_track():
    assert widened(slice(600, 900), 2, 1000) == (slice(598, 902), slice(2, 302))
    assert widened(slice(0, 600), 2, 600) == (slice(0, 600), slice(0, 600))
