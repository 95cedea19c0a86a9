from dataclasses import replace

import pytest
import torch
from made_actions import box_actions

from geneoh.evaluation.generation import refined as module
from geneoh.evaluation.generation.measures import measure_clip
from geneoh.evaluation.generation.refined import joint_rests, part_meshes, refined, refined_clip
from geneoh.generators.text2hoi.resting import eased, finished


def test_parts_have_closed_meshes_as_large_as_their_points():
    actions = box_actions(["open"], frames=4, points=1024, jointed=True)
    meshes = part_meshes(actions)
    assert len(meshes) == 2
    whole = torch.cat([mesh.verts for mesh in meshes])
    size = actions.points[0].amax(0) - actions.points[0].amin(0)
    assert torch.allclose(whole.amax(0) - whole.amin(0), size, atol=0.01)


def test_an_object_whose_joint_stands_still_is_one_mesh_in_that_state(monkeypatch):
    actions = box_actions(["open"], frames=8, length=6, points=1024, jointed=True)
    still = replace(actions, joint=torch.full_like(actions.joint, 0.5))
    assert not joint_rests(actions)
    assert joint_rests(still)
    asked = []
    monkeypatch.setattr(module, "refined_parts", lambda clip, seed: asked.append(clip) or clip)
    assert refined_clip(actions, 0) is actions
    found = refined_clip(still, 0)
    assert len(part_meshes(asked[0])) == 2
    assert len(part_meshes(asked[1])) == 1
    torch.testing.assert_close(asked[1].points, still.posed_points()[:, 0])
    for name in ("points", "part", "axis", "joint"):
        torch.testing.assert_close(getattr(found, name), getattr(still, name))


@pytest.mark.slow
def test_processes_refine_clips_to_the_bits_of_one():
    actions = box_actions(["press", "inspect"], frames=6, points=256)
    told: list[tuple[int, int]] = []
    shared = refined(actions, seed=0, jobs=2, on_step=lambda *at: told.append(at))
    assert told == [(1, 2), (2, 2)]
    alone = refined(actions.take(slice(1), "B"), seed=0, jobs=1)
    for name, value in vars(alone).items():
        assert torch.equal(getattr(shared, name)[:1], value), name


@pytest.mark.slow
def test_refined_hands_are_less_deep_and_the_object_moves_as_before_but_from_rest_to_rest():
    actions = box_actions(["lift"], frames=16, length=12, points=1024)
    shift = torch.tensor([0.07, 0.0, 0.0])
    actions = replace(actions, wrist=actions.wrist + shift * actions.hands[:, :, None, None])
    found = refined(actions, seed=0)
    assert measure_clip(found).depth_mm < 0.8 * measure_clip(actions).depth_mm
    assert torch.equal(found.translation, eased(finished(actions)).translation)
    assert torch.equal(found.wrist[:, 1, 11], found.wrist[:, 1, 15]), "the last frame is repeated"
    assert (found.wrist[:, 0] == 0).all()
