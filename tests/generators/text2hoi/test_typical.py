"""The draw that is most like the others is the one that is kept."""

from dataclasses import replace

import torch
from made_actions import made_actions

from geneoh.bundle import concatenated
from geneoh.generators.text2hoi.typical import ARM, compared_points, most_typical
from geneoh.geometry.rotations import axis_angle_to_matrix

UP = torch.tensor([0.0, 0.0, 1.0])


def one():
    """A clip of a left hand, which ends before its last frame."""
    return made_actions(count=2).take(slice(1, 2), "B")


def drawn(changes: list[float], field: str = "translation"):
    """The same clip again and again, with its object or its hands higher by so many metres."""
    clip = one()
    return concatenated(
        [replace(clip, **{field: getattr(clip, field) + change * UP}) for change in changes], "B"
    )


def test_of_each_group_the_one_between_the_others_is_kept():
    assert most_typical(drawn([0.0, 0.3, 0.04, 0.2, 0.02, 0.0]), 3).tolist() == [2, 4]
    assert most_typical(drawn([0.0, 0.3, 0.04, 0.05, 0.2]), 5).tolist() == [3]


def test_of_draws_that_fit_the_one_between_those_is_kept_and_any_where_none_fits():
    actions = drawn([0.0, 0.3, 0.04, 0.1, 0.33])
    fits = torch.tensor([False, True, False, True, True])
    assert most_typical(actions, 5, fits).tolist() == [1]
    assert most_typical(actions, 5, torch.zeros(5, dtype=torch.bool)).tolist() == [3]


def test_hands_count_as_well_as_the_object():
    assert most_typical(drawn([0.5, 0.0, 0.02], "wrist"), 3).tolist() == [2]


def test_distances_are_those_of_hands_that_take_part_and_of_the_object_over_their_frames():
    clip = one()
    places, weight = compared_points(clip)
    torch.testing.assert_close(weight.sum(), torch.tensor(2.0))
    assert weight[0, int(clip.length) :].eq(0).all()
    assert weight[0, 0, 21:42].eq(0).all()  # there is no right hand
    higher, _ = compared_points(drawn([0.07]))
    apart = ((places - higher).norm(dim=-1) * weight).sum()
    torch.testing.assert_close(apart, torch.tensor(0.07))
    half_turn = axis_angle_to_matrix(torch.pi * UP)
    turned, _ = compared_points(replace(clip, rotation=half_turn @ clip.rotation))
    apart = ((places - turned).norm(dim=-1) * weight).sum()
    torch.testing.assert_close(apart, torch.tensor(2 * ARM * 2 / 3))
