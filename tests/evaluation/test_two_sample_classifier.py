import numpy as np
import pytest
import torch

from geneoh.evaluation.two_sample_classifier import (
    BLOCK,
    SNIPPET,
    VIEWS,
    block_snippets,
    cross_validate,
    features,
    fit_logistic,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand


def noise(seed: int, *shape: int) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def snippets(seed: int, count: int, shift: float = 0.0, shake: float = 0.002) -> torch.Tensor:
    """A relaxed hand at random places that shakes; `shift` metres off along x."""
    hand = load_hand("right")
    joints = hand.shaped(torch.zeros(10)).posed(hand.pose_mean, torch.zeros(3)).joints
    place = 0.02 * noise(seed, count, 1, 1, 3) + torch.tensor([shift, 0.0, 0.0])
    return joints + place + shake * noise(seed + 100, count, SNIPPET, 21, 3)


def test_the_same_source_cannot_be_told_apart():
    for view in VIEWS:
        told = cross_validate([snippets(i, 40) for i in range(4)], snippets(9, 160), view, 30.0)
        assert 0.4 < told < 0.6, view


def test_a_shift_of_five_deviations_is_told_by_place_alone():
    blocks = [snippets(i, 40, shift=0.1) for i in range(4)]
    told = {view: cross_validate(blocks, snippets(9, 160), view, 30.0) for view in VIEWS}
    # the best line is right for Phi(2.5) = 99.4 %
    assert told["place"] > 0.96
    assert told["hand"] < 0.6
    assert told["motion"] < 0.6


def test_a_shakier_hand_is_told_by_its_motion():
    blocks = [snippets(i, 40, shake=0.004) for i in range(4)]
    assert cross_validate(blocks, snippets(9, 160), "motion", 30.0) > 0.99


def test_what_marks_a_single_block_does_not_help_on_another():
    """Each block has a place of its own: learned on others, it is no better than chance."""
    places = (0.3, -0.3, 0.6, -0.6)
    blocks = [snippets(i, 30, shift=at) for i, at in enumerate(places)]
    wide = torch.cat([snippets(20 + i, 30, shift=at) for i, at in enumerate(places)])
    wide = wide[torch.randperm(120, generator=torch.Generator().manual_seed(0))]
    assert cross_validate(blocks, wide, "place", 30.0) < 0.6


def test_classes_weigh_the_same_whatever_their_numbers():
    generator = np.random.default_rng(0)
    few, many = generator.normal(1, 1, (300, 1)), generator.normal(-1, 1, (6000, 1))
    weights, bias = fit_logistic(few, many)
    assert float(-bias / weights[0]) == pytest.approx(0, abs=0.15)
    assert float(2.0 * weights[0] + bias) > 0


def test_snippets_stay_within_blocks_and_usable_frames():
    frames = torch.arange(3 * BLOCK + 5.0)
    joints = frames[:, None, None].expand(-1, 21, 3)
    usable = torch.ones(len(frames), dtype=torch.bool)
    usable[BLOCK + 10] = False
    first, third = block_snippets(joints, usable)
    assert first.shape == (BLOCK - SNIPPET + 1, SNIPPET, 21, 3)
    assert float(first.min()) == 0
    assert float(first.max()) == BLOCK - 1
    assert float(third[0, 0, 0, 0]) == 2 * BLOCK
    assert float(third.max()) == 3 * BLOCK - 1


def test_hand_and_motion_do_not_tell_where_on_the_object():
    some = snippets(0, 3)
    turn = axis_angle_to_matrix(torch.tensor([0.4, -1.0, 2.0]))
    moved = some @ turn.T + torch.tensor([0.1, 0.2, -0.3])
    for view in ("hand", "motion"):
        torch.testing.assert_close(
            features(moved, view, 30.0), features(some, view, 30.0), atol=1e-3, rtol=0
        )
    assert not torch.allclose(features(moved, "place", 30.0), features(some, "place", 30.0))
