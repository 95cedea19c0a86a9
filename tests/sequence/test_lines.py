"""Frames that a program filled in on straight lines."""

import pytest
import torch

from geneoh.geometry.mesh import Mesh
from geneoh.sequence.lines import FEWEST, on_lines, without_lines
from geneoh.sequence.sequence import ObjectTrack

FRAMES, LOST = 60, slice(20, 28)
SEEN = torch.ones(FRAMES, dtype=torch.bool)
TIME = torch.linspace(0, 3, FRAMES)
PATH = 0.3 * torch.stack([TIME.sin(), TIME.cos(), (2 * TIME).sin()], dim=-1)


def filled(path: torch.Tensor, lost: slice = LOST) -> torch.Tensor:
    """The path with a straight line in the place of some frames."""
    path, count = path.clone(), lost.stop - lost.start
    share = (torch.arange(count) + 1)[:, None] / (count + 1)
    path[lost] = torch.lerp(path[lost.start - 1], path[lost.stop], share)
    return path


@pytest.mark.parametrize("away", [0.0, 3.0])
def test_frames_on_a_line_are_found_wherever_it_is(away):
    found = on_lines(filled(PATH) + away, SEEN)
    assert found.nonzero()[:, 0].tolist() == list(range(LOST.start, LOST.stop))


def test_measured_motion_is_on_no_line():
    noise = torch.randn(FRAMES, 3, generator=torch.Generator().manual_seed(0))
    even = 0.005 * torch.arange(FRAMES)[:, None] * torch.tensor([1.0, 2.0, -1.0])
    for path in (PATH, even + 0.0001 * noise):
        assert not on_lines(path, SEEN).any()


def test_what_rests_or_hardly_moves_is_on_no_line():
    slow = 0.0005 * torch.arange(FRAMES)[:, None] * torch.tensor([1.0, 0.0, 0.0])
    for path in (slow, 0 * slow):
        both = torch.cat([path[:20], path[19] + PATH])
        assert not on_lines(both, torch.ones(len(both), dtype=torch.bool)).any()


def keyed(every: int) -> torch.Tensor:
    """The path on straight lines between every so many frames."""
    keys, ahead = PATH[::every], PATH[::every].roll(-1, 0)
    share = (torch.arange(FRAMES) % every)[:, None] / every
    start, end = (each.repeat_interleave(every, dim=0)[:FRAMES] for each in (keys, ahead))
    return torch.lerp(start, end, share)


def test_motion_that_is_made_of_lines_is_left_as_it_is():
    assert not on_lines(keyed(10), SEEN).any()


@pytest.mark.parametrize("every", [3, 5, 6])
def test_a_slower_sensor_that_was_brought_to_the_rate_is_found(every):
    found, between = on_lines(keyed(every), SEEN), torch.arange(FRAMES) % every > 0
    assert found[:-every].equal(between[:-every])


@pytest.mark.parametrize("count", [FEWEST - 1, FEWEST])
def test_a_few_frames_may_be_on_a_line_by_chance(count):
    found = on_lines(filled(PATH, slice(20, 20 + count)), SEEN)
    assert int(found.sum()) == (count if count == FEWEST else 0)


def test_frames_that_are_marked_already_are_no_part_of_a_line():
    seen = SEEN.clone()
    seen[LOST] = False
    assert not on_lines(filled(PATH), seen).any()
    assert not on_lines(PATH[: FEWEST + 1], SEEN[: FEWEST + 1]).any()


def test_the_part_that_was_filled_is_marked_and_told():
    ball = Mesh(torch.eye(3), torch.tensor([[0, 1, 2]]))
    place = torch.stack([PATH, filled(PATH)], dim=1)
    motion = ObjectTrack((ball, ball), torch.eye(3).expand(FRAMES, 2, 3, 3), place)
    found, notes = without_lines(motion)
    assert found.observed[:, 0].all()
    assert (~found.observed[:, 1]).nonzero()[:, 0].tolist() == list(range(LOST.start, LOST.stop))
    assert found.translation is motion.translation
    (said,) = notes
    assert said.startswith("the pose of part 2 of the object moves on straight lines")
    assert said.endswith("in 8 frames, as where a program filled in lost ones: taken as missing")
    assert without_lines(found) == (found, ())
