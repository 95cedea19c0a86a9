import pytest
import torch

from geneoh.generators.text2hoi.physics.part_grips import unmoved

UP, FRONT = torch.tensor([0.0, 0.0, 1.0]), torch.tensor([0.0, -1.0, 0.0])


def left_of_a_push(normals, way):
    """What pads on faces with these normals leave of a push."""
    normals = torch.stack(normals)[None]
    return float(unmoved(normals, torch.ones(normals.shape[:2], dtype=torch.bool), way[None]))


def test_a_palm_on_a_lid_presses_it_shut_but_cannot_lift_it():
    assert left_of_a_push([UP, UP], -UP) < 0.05
    assert left_of_a_push([UP, UP], UP) > 0.95


def test_fingers_below_a_lid_lift_it_and_a_pinch_moves_it_both_ways():
    assert left_of_a_push([-UP], UP) < 0.05
    for way in (UP, -UP, FRONT):
        assert left_of_a_push([UP, -UP], way) < 0.05


def test_a_finger_at_the_front_lifts_by_friction_alone():
    assert left_of_a_push([FRONT], UP) == pytest.approx(0.5**0.5, abs=0.03)


def test_pads_that_do_not_touch_bear_nothing():
    none = torch.zeros(1, 1, dtype=torch.bool)
    assert unmoved(-UP[None, None], none, UP[None]) == 1
