"""Which hand passes an object to the other: in words, and in what hands do."""

from dataclasses import replace

import pytest
import torch
from made_actions import box_actions, passing

from geneoh.bundle import concatenated
from geneoh.choices import Side
from geneoh.generators.text2hoi.physics.resting import touching_hands
from geneoh.generators.text2hoi.sentences.passing import (
    asked_giver,
    givers,
    handed_over,
    leads,
    passed_by,
)
from geneoh.synthesis.actions.action import Actions


@pytest.mark.parametrize(
    ("words", "giver"),
    [
        ("pass the cup from the left hand to the right hand", "left"),
        ("pass the ball from right to left", "right"),
        ("from my right hand pass it to the other one", "right"),
        ("the right hand passes the mug to the other hand", "right"),
        ("hand the mug over to the left hand", "right"),
        ("the left hand gives the cup into the right one", "left"),
        ("pass the cup from the left hand", "left"),
        ("pass the cup from the left side", None),
        ("pass the cup from hand to hand", None),
        ("pass the cup", None),
    ],
)
def test_the_hand_that_gives_is_read_from_either_end_of_the_way(words, giver):
    assert asked_giver(words) == giver


def test_the_hand_that_touches_the_object_earlier_gives_it():
    assert givers(concatenated([passing(0), passing(1)], "B")) == ["left", "right"]
    late = passing(1)
    # the left hand comes first for one frame, but later on average
    late.wrist[0, 0, 0] = late.wrist[0, 0, -1]
    assert givers(late) == ["right"]


def test_a_hand_leads_by_the_difference_of_the_mean_times_of_touch():
    # frames 0 to 9 and 10 to 19
    assert leads(touching_hands(concatenated([passing(0), passing(1)], "B"))).tolist() == [
        10.0,
        -10.0,
    ]


def test_no_hand_gives_what_both_hold_alike_or_one_never_touches():
    both = box_actions(["pass"], hands=(True, True))
    assert givers(both) == [None]
    away = replace(both, wrist=both.wrist + 5.0 * torch.tensor([0.0, 1.0])[:, None, None])
    assert givers(away) == [None]


def test_clips_fit_that_pass_as_asked_or_as_they_like():
    clips = concatenated([passing(0)] * 3, "B")
    assert passed_by(clips, ["left", "right", None]).tolist() == [True, False, True]


def keeping() -> Actions:
    """Passing by a left hand that stays at the object, and leads by 3 frames."""
    faint = passing(0)
    faint.wrist[0, 0, 10:] = faint.wrist[0, 0, :1]
    faint.wrist[0, 1, 6:10] = faint.wrist[0, 1, -1:]
    return faint


def test_an_object_is_handed_over_once_the_other_hand_alone_has_it():
    clips = concatenated([passing(0), passing(0), passing(1), keeping()], "B")
    asked: tuple[Side, ...] = ("left", "right", "right", "left")
    hands = zip(touching_hands(clips), asked, strict=True)
    assert [handed_over(each, side) for each, side in hands] == [True, False, True, False]
    away = replace(passing(0), wrist=passing(0).wrist + 5.0)
    assert not handed_over(touching_hands(away)[0], "left")
    assert passed_by(away, [None]).tolist() == [True]


def test_of_draws_those_fit_that_hand_it_over_or_else_those_that_lead_as_clearly_as_others():
    faint = keeping()
    drawn = concatenated([passing(0), faint, passing(1)] * 2, "B")
    fits = passed_by(drawn, ["left"] * 3 + ["right"] * 3, draws=3)
    assert fits.tolist() == [True, False, False, False, False, True]
    assert passed_by(faint, ["left"]).tolist() == [True]
