import math

import pytest
import torch

from geneoh.errors import InputError
from geneoh.geometry.joint import Joint

HINGE = "hinge:0,0.05,0.07:-2,0,0:110"


def test_a_hinge_is_read_with_a_unit_axis_and_its_range_in_radians():
    joint = Joint.read(HINGE)
    assert not joint.slides
    assert joint.axis.tolist() == [-1, 0, 0]
    assert joint.pivot.tolist() == pytest.approx([0, 0.05, 0.07])
    assert joint.most == pytest.approx(math.radians(110))


def test_a_slide_is_read_with_its_range_in_metres_and_may_have_none():
    assert Joint.read("slide:0,-1,0:12").most == pytest.approx(0.12)
    assert Joint.read("slide:0,-1,0").most is None


@pytest.mark.parametrize("text", ["hinge:0,0.05,0.07:-1,0,0:110", "slide:0,-1,0:12", "slide:1,0,0"])
def test_the_text_of_a_joint_is_read_as_the_same_joint(text):
    assert str(Joint.read(text)) == text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("lid", "expected hinge:X,Y,Z:AX,AY,AZ"),
        ("hinge:0,0,0", "expected hinge:X,Y,Z:AX,AY,AZ"),
        ("slide:0,0,0", "expected an axis with a direction, got zeros"),
        ("hinge:0,0,0:0,0,0:90", "expected an axis with a direction, got zeros"),
        ("slide:1,0", "expected three numbers X,Y,Z, got '1,0'"),
        ("slide:nan,0,1", "expected three numbers X,Y,Z"),
        ("slide:1,0,0:-5", "above 0 and up to 50 centimetres, got '-5'"),
        ("hinge:0,0,0:1,0,0:360", "above 0 and up to 180 degrees, got '360'"),
        ("hinge:0,0,0:1,0,0:wide", "above 0 and up to 180 degrees, got 'wide'"),
    ],
)
def test_what_is_no_joint_is_refused_in_a_sentence(text, said):
    with pytest.raises(InputError) as refused:
        Joint.read(text)
    assert said in str(refused.value)


def test_a_hinge_turns_by_the_right_hand_rule_about_its_pivot():
    pose = Joint.read(HINGE).pose(torch.tensor([0.0, math.pi / 2]))
    points = torch.tensor([[0.0, 0.05, 0.07], [0.0, -0.05, 0.07]])
    closed, opened = pose.apply(points)
    assert torch.allclose(closed, points, atol=1e-6)
    assert torch.allclose(opened, torch.tensor([[0.0, 0.05, 0.07], [0.0, 0.05, 0.17]]), atol=1e-6)


def test_a_joint_in_another_frame_moves_the_same_points():
    joint, turn = Joint.read(HINGE), torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    shift, states = torch.tensor([0.1, 0.2, 0.3]), torch.tensor([0.7])
    points = torch.rand(5, 3)
    there = joint.pose(states).apply(points) @ turn.T + shift
    assert torch.allclose(
        joint.moved(turn, shift).pose(states).apply(points @ turn.T + shift), there, atol=1e-6
    )
