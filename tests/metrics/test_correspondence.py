"""Rays from the object to the hand: closed forms, and a twin that tries every face."""

import math

import numpy as np
import pytest
import torch
import trimesh

from geneoh.geometry.distance import MovingSurface, SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.geometry.openings import capped
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.geometry.sampling import SurfaceSamples
from geneoh.hand.library import load_hand
from geneoh.metrics.contact import contact_agreement
from geneoh.metrics.correspondence import RAY_OFFSET, contact_points, object_contact

STILL = (torch.eye(3).expand(1, 1, 3, 3), torch.zeros(1, 1, 3))


def box(x: float, y: float, z: float, *centre: float) -> Mesh:
    shape = trimesh.creation.box((x, y, z))
    if centre:
        shape.apply_translation(centre)
    return from_trimesh(shape)


def above(gap: float) -> Mesh:
    """A block of 20 x 20 x 10 mm over the top of a cube of 100 mm."""
    return box(0.02, 0.02, 0.01, 0.01, -0.02, 0.055 + gap)


CUBE = SurfaceDistance(box(0.1, 0.1, 0.1))
POINTS = contact_points((CUBE,), generator=torch.Generator().manual_seed(0))


def found(hand: Mesh, field=CUBE, points=POINTS) -> torch.Tensor:
    return object_contact(hand.verts[None], hand.faces, MovingSurface((field,), *STILL), points)[0]


@pytest.mark.parametrize(("gap", "touches"), [(0.0019, True), (0.0021, False), (-0.0019, True)])
def test_points_under_a_block_touch_it_up_to_2_mm_on_either_side(gap, touches):
    points = POINTS[0].points
    under = (points[:, 2] > 0.0499) & (
        (points[:, :2] - torch.tensor([0.01, -0.02])).abs() < 0.01
    ).all(-1)
    assert int(under.sum()) > 20
    assert torch.equal(found(above(gap)), under & touches)


def test_a_block_that_is_sunk_by_3_mm_is_no_contact():
    assert not bool(found(above(-0.003)).any())


def test_share_of_the_surface_in_contact_is_that_of_the_block():
    share = float(found(above(0.001)).float().mean())
    assert share == pytest.approx(0.02**2 / (6 * 0.1**2), rel=0.05)


def test_contact_behind_the_object_itself_does_not_count():
    # the point of the lower plate looks up at the upper one, 0.5 mm away, and the hand behind it
    lower, upper = trimesh.creation.box((0.1, 0.1, 0.01)), trimesh.creation.box((0.1, 0.1, 0.0003))
    upper.apply_translation((0, 0, 0.00565))
    plates = from_trimesh(trimesh.util.concatenate([lower, upper]))
    field = SurfaceDistance(plates)
    start = SurfaceSamples(torch.tensor([[0.0, 0.0, 0.005]]), torch.tensor([[0.0, 0.0, 1.0]]))
    hand = box(0.02, 0.02, 0.01, 0.0, 0.0, 0.0115)
    assert not bool(found(hand, field, (start,)).any())
    alone = SurfaceDistance(from_trimesh(lower))
    assert bool(found(hand, alone, (start,)).all())


def test_parts_share_the_points_by_their_area():
    large = from_trimesh(trimesh.creation.box((0.2, 0.2, 0.2)).subdivide())
    generator = torch.Generator().manual_seed(0)
    parts = contact_points((CUBE, SurfaceDistance(large)), generator=generator, count=1000)
    assert [len(part.points) for part in parts] == [200, 800]


def crossings(mesh: Mesh, start: np.ndarray, ahead: np.ndarray) -> list[float]:
    """How far along a ray every face is that it crosses, one face at a time."""
    found = []
    for a, b, c in mesh.corners().double().numpy():
        system = np.stack([b - a, c - a, -ahead], axis=-1)
        if abs(np.linalg.det(system)) < 1e-18:
            continue
        u, v, reach = np.linalg.solve(system, start - a)
        if u >= 0 and v >= 0 and u + v <= 1 and reach >= 0:
            found.append(float(reach))
    return found


def slow(hand: Mesh, field: SurfaceDistance, points: SurfaceSamples) -> list[bool]:
    """Every ray against every face of hand and object."""
    answers, anywhere = [], np.array([0.36, -0.48, 0.8])
    for start, normal in zip(
        points.points.double().numpy(), points.normals.double().numpy(), strict=True
    ):
        inside = len(crossings(hand, start, anywhere)) % 2 == 1
        ahead = -normal if inside else normal
        reach = min(crossings(hand, start, ahead), default=math.inf)
        before = crossings(field.mesh, start + RAY_OFFSET * ahead, ahead)
        blocked = min(before, default=math.inf) + RAY_OFFSET < reach
        answers.append(reach <= 0.002 and not blocked)
    return answers


def test_rays_agree_with_trying_every_face():
    field = SurfaceDistance(from_trimesh(trimesh.creation.torus(0.03, 0.012, 16, 12)))
    ball = from_trimesh(trimesh.creation.icosphere(2, 0.03))
    hand = Mesh(ball.verts + torch.tensor([0.0702, 0.001, 0.002]), ball.faces)
    (spread,) = contact_points((field,), generator=torch.Generator().manual_seed(1), count=4000)
    near = (spread.points - torch.tensor([0.042, 0.0, 0.0])).norm(dim=-1) < 0.012
    points = SurfaceSamples(spread.points[near], spread.normals[near])
    answers = found(hand, field, (points,)).tolist()
    assert answers == slow(hand, field, points)
    assert 10 < sum(answers) < len(answers) - 10


def test_contact_does_not_change_with_a_rigid_motion_and_follows_the_parts():
    hand = load_hand("right").shaped(torch.zeros(10))
    verts = hand.verts[None] + torch.tensor([0.05, 0.04, 0.0])
    far = torch.tensor([[[0.0, 0, 0], [0.0, 0, 0.5]]])
    points = contact_points((CUBE, CUBE), generator=torch.Generator().manual_seed(0))
    assert sum(len(part.points) for part in points) == 8000
    still = MovingSurface((CUBE, CUBE), torch.eye(3).expand(1, 2, 3, 3), far)
    rest = object_contact(verts, hand.model.faces, still, points)
    assert bool(rest[:, :4000].any())
    assert not bool(rest[:, 4000:].any())
    turn, shift = (
        axis_angle_to_matrix(torch.tensor([0.5, -1.0, 2.0])),
        torch.tensor([0.3, -2.0, 1.0]),
    )
    away = MovingSurface((CUBE, CUBE), turn.expand(1, 2, 3, 3), far @ turn.T + shift)
    moved = object_contact(verts @ turn.T + shift, hand.model.faces, away, points)
    # rounding of float32 two metres away moves a few points over the 2 mm
    assert float(contact_agreement(moved, rest).iou) > 0.98


def test_frames_without_a_hand_have_no_contact_and_the_hand_agrees_with_itself():
    hand = above(0.001)
    verts = torch.stack([hand.verts, torch.full_like(hand.verts, torch.nan)])
    still = MovingSurface((CUBE,), torch.eye(3).expand(2, 1, 3, 3), torch.zeros(2, 1, 3))
    contact = object_contact(verts, hand.faces, still, POINTS)
    assert contact.any(-1).tolist() == [True, False]
    agreement = contact_agreement(contact, contact)
    assert float(agreement.iou) == float(agreement.f_score) == 1.0


def test_a_hand_that_is_open_where_the_ray_would_meet_it_is_closed_first():
    block = above(0.001)
    opened = block.faces[block.face_normals()[:, 2] > -0.5]
    assert torch.equal(found(Mesh(block.verts, opened)), found(block))


def test_fans_close_every_opening_and_face_outward():
    shape = trimesh.creation.cylinder(0.02, 0.05)
    shape.update_faces(np.abs(shape.face_normals[:, 2]) < 0.5)
    verts, faces = capped(from_trimesh(shape).verts, from_trimesh(shape).faces)
    closed = trimesh.Trimesh(verts.numpy(), faces.numpy(), process=False)
    assert closed.is_watertight
    assert closed.is_winding_consistent
    assert closed.volume == pytest.approx(trimesh.creation.cylinder(0.02, 0.05).volume, rel=1e-5)
