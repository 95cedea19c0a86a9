from itertools import pairwise

import pytest
import torch

from geneoh.generators.both2hands.windows import FRAMES, OVERLAP, ClipWindows


@pytest.mark.parametrize("frames", [150, 151, 270, 271, 700])
def test_windows_cover_a_clip_and_overlap(frames):
    starts = ClipWindows.of(frames).starts
    assert starts[0] == 0
    assert starts[-1] == frames - FRAMES
    assert all(0 < b - a <= FRAMES - OVERLAP for a, b in pairwise(starts))


def test_what_is_cut_is_joined_again():
    windows = ClipWindows.of(321)
    clips = torch.randn(2, 321, 5, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(windows.join(windows.cut(clips)), clips)


def test_windows_that_differ_are_blended_without_a_jump():
    windows = ClipWindows.of(2 * FRAMES - OVERLAP)
    parts = torch.stack([torch.zeros(FRAMES, 1), torch.ones(FRAMES, 1)])
    joined = windows.join(parts)[0, :, 0]
    assert joined.diff().abs().max() < 0.05
    assert joined[0] == 0
    assert joined[-1] == 1


def test_items_are_repeated_as_windows_are_cut():
    windows = ClipWindows.of(300)
    items = torch.arange(3.0)
    clips = items[:, None, None].expand(3, 300, 1)
    torch.testing.assert_close(windows.repeat(items), windows.cut(clips)[:, 0, 0])
