import torch
from made_actions import box_actions

from geneoh.evaluation.generation.measures import posed_actions
from geneoh.streamed import Streamed
from geneoh.synthesis.actions.action import VERBS
from tools.action_sheet import (
    CELL,
    FRAMES,
    WORDS,
    contact_sheet,
    fixed_camera,
    one_per_verb,
    plates,
)


def test_sheet_has_a_row_of_frames_for_each_action():
    actions = box_actions(["lift", "open"], frames=8, hands=(True, True), jointed=True)
    picture = contact_sheet(actions, ["box", "carton"])
    assert picture.shape[1] == WORDS + FRAMES * CELL
    first, last = picture[:CELL, WORDS : WORDS + CELL], picture[:CELL, -CELL:]
    assert (first != last).any(), "the object rises"


def test_one_clip_of_each_verb_is_chosen_and_its_last_where_there_are_fewer():
    actions = box_actions(["pass", "lift", "lift", "pass", "lift"], frames=4)
    chosen = one_per_verb(Streamed.of([actions]), 2)
    assert [VERBS[int(verb)] for verb in chosen.verb] == ["lift", "pass"]
    assert chosen.name.tolist() == [4, 3]


def test_hands_and_object_stay_in_the_picture():
    actions = box_actions(["lift"], frames=8, hands=(True, True))
    posed, camera = posed_actions(actions), fixed_camera(actions)
    points = torch.cat([posed.joints[0].flatten(0, 2), posed.surface.points[0].flatten(0, 1)])
    at = camera.project(points.numpy(), (CELL, CELL))[..., :2]
    assert at.min() > 0
    assert at.max() < CELL


def test_plates_lie_in_the_surface():
    actions = box_actions(["lift"], frames=4)
    points, normals = actions.points[0], actions.normals[0]
    mesh = plates(points, normals)
    verts = mesh.verts.reshape(len(points), -1, 3)
    off = ((verts - points[:, None]) * normals[:, None]).sum(-1)
    assert off.abs().max() < 1e-6
    assert len(mesh.faces) == 4 * len(points)
