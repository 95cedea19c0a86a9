from dataclasses import fields

import numpy as np
import pytest
import torch
from made_actions import made_actions
from made_gestures import made_gestures

from geneoh.bundle import Bundle, concatenated
from geneoh.streamed import Streamed

SHARDS = [made_gestures(count, seed=count) for count in (5, 1, 3)]
"""Clips with tensors and with texts."""


def assert_equal(found: Bundle, wanted: Bundle) -> None:
    """Fields of equal values."""
    for field in fields(wanted):
        assert np.array_equal(getattr(found, field.name), getattr(wanted, field.name)), field.name


@pytest.mark.parametrize(
    "index",
    [torch.tensor([8, 0, 5, 5, 2]), torch.arange(9) % 2 == 0, slice(4, 7), slice(None)],
    ids=["numbers", "mask", "slice", "all"],
)
def test_clips_that_are_taken_are_those_of_the_shards_in_one(index):
    streamed, together = Streamed.of(SHARDS), concatenated(SHARDS, "B")
    assert len(streamed) == len(together.length)
    assert_equal(streamed.take(index), together.take(index, "B"))
    assert_equal(streamed.only(index).take(slice(None)), together.take(index, "B"))


def test_clips_of_several_follow_one_another():
    first, *rest = SHARDS
    some = Streamed.of(rest).only(torch.tensor([3, 0]))
    joined = Streamed.joined([some, Streamed.of([first])])
    wanted = concatenated([*(some.take(slice(i, i + 1)) for i in (0, 1)), first], "B")
    assert_equal(joined.take(slice(None)), wanted)


def test_every_clip_is_told_of_in_its_order():
    some = Streamed.of(SHARDS).only(torch.tensor([8, 0, 5]))
    told = some.each(lambda clips: clips.pose[:, -1])
    assert torch.equal(told, some.take(slice(None)).pose[:, -1])


def test_clips_of_other_shapes_are_fitted():
    short = made_actions(frames=10)
    streamed = Streamed.of([made_actions(frames=20), short])
    fitted = Streamed(streamed.shards, streamed.places, lambda clips: clips[:10])
    assert_equal(fitted.take(torch.tensor([6, 11])), short.take(torch.tensor([0, 5]), "B"))
    assert fitted.take(torch.tensor([0, 11])).joint.shape == (2, 10)
