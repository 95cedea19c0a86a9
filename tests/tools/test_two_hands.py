from dataclasses import replace

import pytest

from geneoh.sequence.gaps import filled_keypoints
from geneoh.sequence.sequence import Sequence
from tools.two_hands import (
    DEEPEST,
    FRAMES,
    OVERLAP,
    ROWS,
    clean_pair,
    column,
    made_pairs,
    measured,
    scores,
)


@pytest.fixture(scope="module")
def pair() -> Sequence:
    """A clip without the frames of reaching and leaving."""
    return next(made_pairs(["ycb_030_fork.ply"], at_once=12))[FRAMES // 3 : 2 * FRAMES // 3]


def test_both_hands_hold_the_object_and_are_beside_each_other(pair):
    assert [hand.side for hand in pair.hands] == ["right", "left"]
    found = clean_pair(pair)
    assert bool(found.tips.any(-1).all(-1).any(-1)), "in some frame both hands touch it"
    assert float(found.depth.max()) < DEEPEST
    assert found.overlap < OVERLAP
    perfect = scores(found, found)
    assert perfect[0] == 0
    assert perfect[2] == 100
    assert len(perfect) == len(ROWS)


def test_two_hands_at_one_place_are_deep_in_each_other(pair):
    """The left hand of the clip is put over the right one."""
    right, left = (filled_keypoints(hand) for hand in pair.hands)
    over = left + (right[:, 9] - left[:, 9])[:, None]
    hands = [
        replace(hand, joints=joints, pose=None, wrist=None)
        for hand, joints in zip(pair.hands, (right, over), strict=True)
    ]
    assert measured(hands, pair.object.surface()).overlap > 0.005


@pytest.mark.parametrize("noise", ["gauss", "drop"])
def test_a_column_has_the_input_the_filter_and_geneoh(pair, noise):
    """Also where frames are lost."""
    values = column([pair], noise, "fast")
    assert values.shape == (3, len(ROWS))
    errors = values[:, 0].tolist()
    assert errors[0] > errors[1] > errors[2] > 1
