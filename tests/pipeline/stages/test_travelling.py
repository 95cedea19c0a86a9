"""A hand alone that covers metres, as of someone who walks, is cleaned as one that stays."""

from dataclasses import replace

import pytest
import torch

import geneoh
from geneoh.geometry.rigid import Rigid
from geneoh.pipeline.stages.alone import travelled
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.placing import placed
from geneoh.sequence.sequence import ObjectTrack, Sequence


def walking(sequence: Sequence, speed: float) -> Sequence:
    """The hands alone, of someone who walks at `speed`, metres a second."""
    time = torch.arange(sequence.frames) / sequence.fps
    still = torch.eye(3).expand(sequence.frames, 3, 3)
    alone = replace(sequence, object=ObjectTrack.resting((), sequence.frames))
    return placed(alone, Rigid(still, speed * time[:, None] * torch.tensor([0.6, 0.8, 0.0])))


def error(noisy: Sequence, truth: Sequence) -> float:
    """Mean keypoint error of the cleaned hand in mm."""
    joints = geneoh.denoise(noisy, preset="fast").sequence.hands[0].joints
    return 1000 * float((joints - truth.hands[0].joints).norm(dim=-1).mean())


@pytest.mark.parametrize("speed", [0.8, 1.4, 2.5])
def test_a_hand_of_someone_who_walks_is_cleaned_as_one_that_stays(clean, speed):
    def noisy(truth: Sequence) -> Sequence:
        return corrupt_sequence(truth, "gauss", generator=torch.Generator().manual_seed(3))

    stays, walks = (walking(clean, each) for each in (0.0, speed))
    assert error(noisy(walks), walks) < 1.05 * error(noisy(stays), stays)


def test_a_clean_hand_of_someone_who_walks_stays_where_it_is(clean):
    walks = walking(clean, 1.4)
    assert error(walks, walks) < 1.5


@pytest.mark.parametrize("frames", [1, 2, 3, 90])
def test_a_hand_within_reach_keeps_the_given_frame(clean, frames):
    joints = clean.hands[0].joints[:frames]
    noise = 0.03 * torch.randn(frames, 1, 3, generator=torch.Generator().manual_seed(0))
    assert not travelled(joints + noise, clean.fps).any()


def test_the_frame_moves_only_while_the_hand_travels(clean):
    joints = clean.hands[0].joints[:1].expand(400, -1, -1)
    way = 1.4 * (torch.arange(400) / 30 - 6).clamp(0, 3)
    along = travelled(joints + way[:, None, None] * torch.eye(3)[0], 30.0)
    assert torch.allclose(along[:90], torch.zeros(3), atol=1e-3)
    assert along[135:].diff(dim=0)[180:].abs().max() < 1e-3
    assert (along[-1] - along[0]).norm() == pytest.approx(4.2, abs=0.3)
