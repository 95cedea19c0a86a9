"""Poses of an object in frames in which its tracker lost it."""

from dataclasses import replace

import numpy as np
import pytest
from carried_box import (
    AT_REST,
    FRAMES,
    HELD,
    IN_PALM,
    LOST,
    PLACES,
    TURNS,
    lost,
    off,
    palm,
    passed,
    resting,
    track,
)
from scipy.spatial.transform import Rotation

from geneoh.objects.held_in_gaps import held_in_gaps
from geneoh.objects.palms import RigidMotion


@pytest.mark.parametrize(("noise", "turned", "left"), [(0.0, 0.0, 0.01), (0.005, 0.05, 0.25)])
def test_an_object_that_is_carried_moves_with_the_palm_in_a_gap(noise, turned, left):
    given = lost(HELD)
    found = held_in_gaps(given, [palm(noise, turned)])
    assert off(found, HELD) < left * off(given, HELD)
    seen = given.observed[:, 0]
    assert found.rotation[seen].equal(given.rotation[seen])
    assert found.translation[seen].equal(given.translation[seen])
    assert found.valid.equal(given.valid)


@pytest.mark.parametrize("frames", [slice(0, 12), slice(48, 60)])
def test_so_it_does_before_it_is_found_and_after_it_is_lost(frames):
    given = lost(HELD, frames)
    assert off(held_in_gaps(given, [palm()]), HELD, frames) < 0.01 * off(given, HELD, frames)


def test_an_object_that_is_gripped_anew_changes_its_pose_in_the_palm_evenly():
    moved = np.clip((np.arange(FRAMES) - LOST.start) / 12, 0, 1)[:, None] * [0.0, 0.03, 0.0]
    slides = track(TURNS, PLACES + TURNS.apply(IN_PALM + moved))
    given = lost(slides)
    assert off(held_in_gaps(given, [palm()]), slides) < 0.1 * off(given, slides)


@pytest.mark.parametrize(("noise", "turned", "left"), [(0.0, 0.0, 0.1), (0.003, 0.03, 0.25)])
@pytest.mark.parametrize("taken", [True, False])
def test_an_object_that_is_taken_or_put_down_in_a_gap_rests_and_moves(taken, noise, turned, left):
    frame = LOST.start + 5
    ways = (resting(frame), HELD) if taken else (HELD, resting(frame))
    truth = passed(*ways, frame)
    given = lost(truth)
    found = held_in_gaps(given, [palm(noise, turned), AT_REST])
    assert off(found, truth) < left * off(given, truth)


def test_an_object_that_is_passed_in_a_gap_goes_from_palm_to_palm():
    frame = LOST.start + 5
    turns, places = TURNS.inv(), PLACES[:, [1, 0, 2]]
    other_palm = replace(palm(), turns=turns, places=places)
    grip = turns[frame].inv() * TURNS[frame]
    there = PLACES[frame] + TURNS[frame].apply(IN_PALM)
    in_other = turns[frame].inv().apply(there - places[frame])
    other = track(turns * grip, places + turns.apply(in_other))
    truth = passed(HELD, other, frame)
    given = lost(truth)
    for palms in ([palm(), other_palm], [other_palm, palm()]):
        assert off(held_in_gaps(given, palms), truth) < 0.25 * off(given, truth)


@pytest.mark.parametrize(("noise", "turned", "left"), [(0.0, 0.0, 0.1), (0.003, 0.03, 0.25)])
def test_an_object_that_is_taken_and_put_down_in_a_gap_was_carried_by_the_palm(noise, turned, left):
    gap, taken, put = slice(12, 48), 16, 42
    truth = passed(passed(resting(taken), HELD, taken), resting(put), put)
    given = lost(truth, gap)
    found = held_in_gaps(given, [AT_REST, palm(noise, turned)])
    assert off(found, truth, gap) < left * off(given, truth, gap)
    moved = replace(resting(taken), translation=resting(taken).translation - 0.2)
    given = lost(passed(resting(taken), moved, put), gap)
    assert off(held_in_gaps(given, [palm(noise, turned)]), given, gap) < 1e-6


def test_an_object_that_rests_elsewhere_than_the_palm_comes_by_stays_on_its_line():
    rest = resting(LOST.start + 5)
    elsewhere = replace(rest, translation=rest.translation + 0.1)
    given = lost(passed(elsewhere, HELD, LOST.start + 5))
    assert off(held_in_gaps(given, [palm()]), given) < 1e-6


def test_an_object_that_is_gripped_far_from_before_in_a_gap_stays_on_its_line():
    reached = np.where(np.arange(FRAMES) < LOST.start + 6, 0.08, 0.0)[:, None] * [0.0, 1.0, 0.0]
    given = lost(track(TURNS, PLACES + TURNS.apply(IN_PALM + reached)))
    assert off(held_in_gaps(given, [palm()]), given) < 1e-6


def test_what_rests_or_moves_by_itself_stays_on_its_line():
    still = track(Rotation.from_matrix(np.tile(np.eye(3), (FRAMES, 1, 1))), 0 * PLACES)
    elsewhere = track(TURNS.inv(), 0.5 - PLACES[:, [1, 2, 0]])
    for motion in (still, elsewhere):
        given = lost(motion)
        assert off(held_in_gaps(given, [palm()]), given) < 1e-6


def test_a_palm_that_rests_moves_nothing():
    given = lost(HELD)
    assert off(held_in_gaps(given, [AT_REST]), given) < 1e-6


def test_the_palm_that_carries_it_counts_among_two():
    given, other = lost(HELD), replace(palm(), places=-PLACES)
    for palms in ([palm(), AT_REST], [AT_REST, palm()], [palm(), other], [other, palm()]):
        assert off(held_in_gaps(given, palms), HELD) < 0.01 * off(given, HELD)


def test_a_gap_that_a_noisy_palm_knows_less_about_than_the_line_keeps_the_line():
    brief = slice(30, 31)
    given = lost(HELD, brief)
    found = held_in_gaps(given, [palm(0.01, 0.1)])
    assert off(found, HELD, brief) < 0.005


def test_nothing_changes_without_gaps_or_with_a_palm_that_is_hardly_seen():
    assert held_in_gaps(HELD, [palm()]) is HELD
    brief = replace(palm(), seen=np.arange(FRAMES) % 8 > 0)
    given = lost(HELD)
    assert held_in_gaps(given, [brief]) is given
    short = slice(30, 44)
    few = RigidMotion(TURNS[short], PLACES[short], np.ones(14, dtype=bool))
    assert held_in_gaps(given[short], [few]).translation.equal(given.translation[short])
