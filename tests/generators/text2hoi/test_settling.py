from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from actions import made_actions

from geneoh.generators.text2hoi.settling import settled, solid_of
from geneoh.generators.text2hoi.standing import stand
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.synthesis.pose_prior import FINGER_MEAN

RADIUS, HEIGHT = 0.03, 0.16


@pytest.fixture(scope="module")
def rod():
    """A rod that stands on the table."""
    made = trimesh.creation.cylinder(RADIUS, HEIGHT, sections=48)
    mesh = Mesh(
        torch.tensor(np.asarray(made.vertices), dtype=torch.float32),
        torch.tensor(np.asarray(made.faces)),
    )
    return stand(mesh, generator=torch.Generator().manual_seed(0))


def sunk(rod, side: int):
    """An action whose hand goes around the rod, 12 mm too deep, and rises with it."""
    actions = made_actions(["lift"], frames=24, hands=(side == 0, side == 1))
    actions = replace(
        actions,
        points=rod.points[None],
        normals=rod.normals[None],
        part=torch.zeros(1, len(rod.points), dtype=torch.long),
        rotation=torch.eye(3).expand(1, 24, 3, 3),
    )
    # the right hand's fingers point along -x and its palm to -y: the rod is below the palm
    place = torch.tensor([0.08, RADIUS + 0.006, 0.09])
    pose = torch.cat([torch.zeros(1, 3), FINGER_MEAN])
    if side == 0:
        place, pose = place * torch.tensor([-1.0, 1, 1]), pose * torch.tensor([1.0, -1, -1])
    wrist = torch.zeros(1, 2, 24, 3)
    wrist[:, side] = place + actions.translation
    poses = torch.zeros(1, 2, 24, 16, 3)
    poses[:, side] = pose
    return replace(actions, wrist=wrist, pose=poses)


def depth_of(actions, rod, side: int) -> float:
    """Depth of the deepest keypoint, metres, over all frames."""
    apart = actions.keypoints()[0, side] - actions.translation[0, :, None]
    verts = rod.mesh.verts @ rod.rotation.T + rod.shift
    field = SurfaceDistance(Mesh(verts, rod.mesh.faces))
    return float(-field.query(apart.flatten(0, 1)).distance.min())


def test_the_grid_is_the_standing_object(rod):
    solids, middle = solid_of(rod)
    distance = solids.signed_distance((rod.points - middle)[None])
    assert distance.abs().amax() < 1e-3
    assert solids.signed_distance(torch.zeros(1, 1, 3))[0, 0] < -0.02


@pytest.mark.parametrize("side", [0, 1])
def test_a_hand_that_sinks_in_comes_out_and_holds(rod, side):
    before = sunk(rod, side)
    after = settled(before, rod)
    assert depth_of(before, rod, side) > 0
    assert depth_of(after, rod, side) < 0
    apart = after.keypoints()[0, side] - after.translation[0, :, None]
    verts = rod.mesh.verts @ rod.rotation.T + rod.shift
    gap = SurfaceDistance(Mesh(verts, rod.mesh.faces)).query(apart.flatten(0, 1)).distance
    assert gap.min() < 0.015
    held = apart - apart[:1]
    assert held.abs().amax() < 1e-4  # still at rest at the object, as it was drawn


def test_a_hand_that_never_touches_stays_as_it_is(rod):
    actions = sunk(rod, 1)
    away = replace(actions, wrist=actions.wrist + torch.tensor([0.5, 0.0, 0.0]))
    assert torch.equal(settled(away, rod).pose, away.pose)
