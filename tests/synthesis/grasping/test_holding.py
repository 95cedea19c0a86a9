import pytest
import torch

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.synthesis.grasping.grasp_energy import unheld

RIGHT, LEFT, UP = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def left_over(pads, normals, touching=None) -> float:
    """`unheld` of one grip, the same however it is turned."""
    pads, normals = torch.tensor([pads]), torch.tensor([normals])
    touching = torch.ones(pads.shape[:2], dtype=torch.bool) if touching is None else touching
    found = [
        float(unheld(pads @ turn.T, normals @ turn.T, touching))
        for turn in (torch.eye(3), axis_angle_to_matrix(torch.tensor([0.3, 1.0, -0.5])))
    ]
    assert found[0] == pytest.approx(found[1], abs=0.1)
    return found[0]


def test_two_pads_across_an_object_hold_it():
    assert left_over([(0.02, 0.0, 0.0), (-0.02, 0.0, 0.0)], [RIGHT, LEFT]) < 0.1


def test_pads_on_one_side_cannot_pull():
    side = [(0.02, 0.0, 0.0), (0.02, 0.02, 0.0), (0.02, -0.02, 0.0)]
    assert left_over(side, [RIGHT, RIGHT, RIGHT]) > 0.9


def test_pads_on_neighbouring_sides_slip_off():
    assert left_over([(0.02, 0.0, 0.0), (0.0, 0.02, 0.0)], [RIGHT, UP]) > 0.5


def test_a_pad_that_does_not_touch_holds_nothing():
    pads, normals = [(0.02, 0.0, 0.0), (-0.02, 0.0, 0.0)], [RIGHT, LEFT]
    assert left_over(pads, normals, torch.tensor([[True, False]])) > 0.9
    assert left_over(pads, normals, torch.tensor([[False, False]])) == pytest.approx(1.0)
