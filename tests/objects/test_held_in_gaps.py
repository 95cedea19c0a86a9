"""Poses of an object in frames in which its tracker lost it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial.transform import Rotation

from geneoh.geometry.mesh_files import from_trimesh
from geneoh.objects.held_in_gaps import held_in_gaps
from geneoh.objects.palms import RigidMotion
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import ObjectTrack

FRAMES, LOST = 60, slice(25, 37)
MESH = from_trimesh(trimesh.creation.box((0.05, 0.1, 0.2)).apply_translation((0.3, 0.0, 0.0)))
IN_PALM = np.array([0.02, 0.05, 0.08])  # of the object's centre, metres
TIME = np.linspace(0, 2 * np.pi, FRAMES)
PLACES = 0.2 * np.stack([np.sin(TIME), np.cos(TIME), 0.3 * np.sin(2 * TIME)], axis=1)
TURNS = Rotation.from_rotvec(np.stack([np.sin(TIME), 0 * TIME, np.cos(2 * TIME)], axis=1))


def palm(noise: float = 0.0, turned: float = 0.0) -> RigidMotion:
    """A palm on its way, with white noise in metres and radians per axis."""
    generator = np.random.default_rng(0)
    shift, turn = generator.normal(size=(2, FRAMES, 3))
    turns = TURNS * Rotation.from_rotvec(turned * turn)
    return RigidMotion(turns, PLACES + noise * shift, np.ones(FRAMES, dtype=bool))


AT_REST = replace(palm(), turns=Rotation.identity(FRAMES), places=0 * PLACES)


def track(turns: Rotation, places: np.ndarray) -> ObjectTrack:
    """The object with its centre at these places."""
    rotation = torch.from_numpy(turns.as_matrix()).float()[:, None]
    translation = torch.from_numpy(places).float()[:, None] - rotation @ MESH.center()
    return ObjectTrack((MESH,), rotation, translation)


def lost(motion: ObjectTrack, frames: slice = LOST) -> ObjectTrack:
    """The same without poses in some frames, filled on straight lines as they are read."""
    valid = torch.ones(FRAMES, 1, dtype=torch.bool)
    valid[frames] = False
    return fill_object(motion, valid)


def off(motion: ObjectTrack, truth: ObjectTrack, frames: slice = LOST) -> float:
    """Mean distance of the vertices from the true ones, metres."""
    placed = (
        MESH.verts @ each.rotation[frames, 0].mT + each.translation[frames]
        for each in (motion, truth)
    )
    one, other = placed
    return float((one - other).norm(dim=-1).mean())


HELD = track(TURNS, PLACES + TURNS.apply(IN_PALM))


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


def passed(first: ObjectTrack, last: ObjectTrack, frame: int) -> ObjectTrack:
    """The object moves as the first track up to a frame, and as the last one from there on."""
    both = zip((first.rotation, first.translation), (last.rotation, last.translation), strict=True)
    rotation, translation = (torch.cat([one[:frame], other[frame:]]) for one, other in both)
    return replace(first, rotation=rotation, translation=translation)


def resting(frame: int) -> ObjectTrack:
    """The object at rest where the palm has it in a frame."""
    return HELD[torch.full((FRAMES,), frame)]


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
