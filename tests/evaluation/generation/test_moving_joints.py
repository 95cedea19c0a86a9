from dataclasses import fields, replace

import torch
from made_actions import box_actions

from geneoh.evaluation.generation.measures import ClipMeasures
from geneoh.evaluation.generation.runner import REAL, about_moving_joints


def opened_and_lifted():
    """An object that is opened, and one whose joint rests."""
    actions = box_actions(["open", "lift"], frames=6, points=256, jointed=True)
    resting = torch.tensor([[False], [True]])
    return replace(actions, joint=actions.joint.masked_fill(resting, 0.5))


def test_clips_whose_joint_moves_are_told_by_themselves():
    values = {field.name: torch.tensor([0.25, 1.0]) for field in fields(ClipMeasures)}
    measured = {name: (opened_and_lifted(), ClipMeasures(**values)) for name in (REAL, "text2hoi")}
    (said,) = about_moving_joints(measured)
    assert said.startswith("Of 1 clips whose joint moves: real 25.0% alone, 0.25 mm deep, ")
    assert "; text2hoi 25.0% alone" in said


def test_nothing_is_told_where_all_joints_rest():
    actions = opened_and_lifted().take([1], "B")
    values = {field.name: torch.ones(1) for field in fields(ClipMeasures)}
    assert about_moving_joints({REAL: (actions, ClipMeasures(**values))}) == ()
