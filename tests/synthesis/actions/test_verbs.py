import math

import pytest
import torch
from draws import seeded

from geneoh.synthesis.actions.action import LONGEST, VERBS
from geneoh.synthesis.actions.verbs import MOST_MOVES, SCRIPTS, VerbConfig, moves_of
from geneoh.synthesis.draws import Draws

BATCH, START = 16, 20.0


def path_of(verb: str) -> torch.Tensor:
    """Shift, turn and joint of objects of 10 cm that do what the verb says."""
    draws = Draws(BATCH, seeded())
    which = torch.full((BATCH,), VERBS.index(verb))
    moves = moves_of(which, torch.full((BATCH,), 0.1), VerbConfig(), draws)
    return moves.path(torch.full((BATCH,), START), 2 * LONGEST)


def test_every_verb_has_a_script_that_fits():
    draws = Draws(BATCH, seeded())
    moves = moves_of(
        torch.arange(BATCH) % len(VERBS), torch.full((BATCH,), 0.1), VerbConfig(), draws
    )
    assert set(SCRIPTS) == set(VERBS)
    assert moves.frames.shape == (BATCH, MOST_MOVES)
    assert (moves.duration > 0).all()


@pytest.mark.parametrize("verb", VERBS)
def test_objects_start_and_end_at_rest_and_never_jump(verb):
    path = path_of(verb)
    step = path.diff(dim=1).abs().amax(-1)
    assert (step[:, : int(START)] < 1e-6).all()
    assert (step[:, -40:] < 1e-6).all()
    assert step.amax() < 0.2
    assert (path[..., 2] >= -1e-6).all()  # never under the table


@pytest.mark.parametrize("verb", ["carry", "slide", "pour", "tilt", "shake", "inspect", "put down"])
def test_what_is_not_kept_in_the_air_ends_on_the_table_as_it_stood(verb):
    last = path_of(verb)[:, -1]
    assert last[:, 2].abs().amax() < 1e-6
    assert last[:, 3:].abs().amax() < 1e-6


@pytest.mark.parametrize(
    ("verb", "low", "high"), [("pour", 1.4, 2.1), ("tilt", 0.4, 0.9), ("slide", 0.0, 0.0)]
)
def test_objects_tilt_as_far_as_the_verb_says(verb, low, high):
    turn = path_of(verb)[..., 3:6]
    most = turn.norm(dim=-1).amax(1)
    assert (most >= low - 1e-4).all()
    assert (most <= high + 1e-4).all()
    assert turn[..., 2].abs().amax() < 1e-6


def test_rotating_turns_about_the_vertical_on_the_table():
    path = path_of("rotate")
    assert path[..., :5].abs().amax() == 0
    assert (path[:, -1, 5].abs() > 0.9 - 1e-4).all()


def test_shaking_goes_to_and_fro():
    path = path_of("shake")
    up = path[:, 60:]  # after it was lifted
    along = (up[..., :3] - up[..., :3].mean(1, keepdim=True)).flatten(0, 1)
    assert along.norm(dim=-1).amax() < 0.3
    speed = path[..., :3].diff(dim=1)
    turns = ((speed[:, 1:] * speed[:, :-1]).sum(-1) < -1e-7).sum(1)
    assert (turns + (speed.norm(dim=-1) < 1e-4).diff(dim=1).sum(1) >= 4).all()


def test_opening_and_closing_are_opposite():
    opened, closed = path_of("open")[..., 6], path_of("close")[..., 6]
    assert (opened[:, 0] == 0).all()
    assert (closed[:, 0] == 1).all()
    assert torch.allclose(opened[:, -1], torch.ones(BATCH))
    assert torch.allclose(closed[:, -1], torch.zeros(BATCH), atol=1e-6)


def test_quicker_moves_go_the_same_way():
    draws = Draws(BATCH, seeded())
    which = torch.full((BATCH,), VERBS.index("pour"))
    moves = moves_of(which, torch.full((BATCH,), 0.1), VerbConfig(), draws)
    half = moves.quicker(torch.full((BATCH,), 0.5))
    assert torch.allclose(half.duration, 0.5 * moves.duration)
    assert half.path(torch.zeros(BATCH), 150)[..., 3:6].norm(dim=-1).amax() > 0.4 * math.pi
