"""Voxels against closed forms, an exact boolean, and asking for every voxel one by one."""

import math
import time
import tracemalloc

import manifold3d
import numpy as np
import pytest
import torch
import trimesh

from geneoh.geometry.distance import MovingSurface, SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.geometry.openings import capped
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.metrics.volume import ASKEW, intersection_volume


def ball(radius: float, x: float = 0, y: float = 0, z: float = 0, *, detail: int = 5) -> Mesh:
    shape = trimesh.creation.icosphere(detail, radius)
    shape.apply_translation((x, y, z))
    return from_trimesh(shape)


def box(size: float) -> trimesh.Trimesh:
    return trimesh.creation.box((size, size, size)).subdivide()


def body(mesh: Mesh) -> manifold3d.Manifold:
    verts, faces = mesh.verts.numpy(), mesh.faces.numpy().astype(np.uint32)
    made = manifold3d.Manifold(manifold3d.Mesh(verts, faces))
    assert made.status() == manifold3d.Error.NoError
    return made


def mesh_from(made: manifold3d.Manifold) -> Mesh:
    mesh = made.to_mesh()
    verts = torch.from_numpy(np.array(mesh.vert_properties[:, :3]))
    return Mesh(verts, torch.from_numpy(np.array(mesh.tri_verts, dtype=np.int64)))


def bowl() -> Mesh:
    """Half a hollow ball, 4 mm thick, open upwards."""
    above = manifold3d.Manifold.cube((0.2, 0.2, 0.2)).translate((-0.1, -0.1, 0))
    return mesh_from(body(ball(0.07)) - body(ball(0.066)) - above)


def finger(depth: float) -> Mesh:
    """A capsule of 8 mm radius whose tip is this much below the origin."""
    tip = manifold3d.Manifold.sphere(0.008, 128).translate((0.004, 0.003, 0.008 - depth))
    return mesh_from(manifold3d.Manifold.batch_hull([tip, tip.translate((0, 0, 0.08))]))


def volume_of(hand: Mesh, *parts: Mesh, voxel: float = 0.001) -> float:
    fields = tuple(SurfaceDistance(part) for part in parts)
    turn = torch.eye(3).expand(1, len(parts), 3, 3)
    surface = MovingSurface(fields, turn, torch.zeros(1, len(parts), 3))
    return float(intersection_volume(hand.verts[None], hand.faces, surface, voxel=voxel))


@pytest.mark.parametrize("apart", [0.02, 0.04, 0.05])
def test_two_balls_share_a_lens(apart):
    radius = 0.03
    lens = math.pi * (4 * radius + apart) * (2 * radius - apart) ** 2 / 12
    direction = [apart * x for x in (0.6, 0.64, 0.48)]
    assert volume_of(ball(radius, *direction), ball(radius)) == pytest.approx(lens, rel=0.02)


@pytest.mark.parametrize("out", [0.0, 0.006, 0.015, 0.021])
def test_ball_that_leaves_a_box_loses_a_cap(out):
    radius, half = 0.015, 0.05
    middle = half - radius + out
    whole = 4 / 3 * math.pi * radius**3
    cap = math.pi * out**2 * (3 * radius - out) / 3
    cube = from_trimesh(trimesh.creation.box((2 * half,) * 3))
    found = volume_of(ball(radius, 0.004, middle, 0.003), cube)
    assert found == pytest.approx(whole - cap, rel=0.02)


@pytest.mark.parametrize("depth", [0.0685, 0.0695, 0.08])
def test_finger_in_an_open_bowl_shares_its_wall_alone(depth):
    hand, vessel = finger(depth), bowl()
    exact = (body(hand) ^ body(vessel)).volume()
    assert exact > 2e-8
    assert volume_of(hand, vessel) == pytest.approx(exact, rel=0.02)


def test_finger_that_hovers_in_a_bowl_shares_nothing():
    assert volume_of(finger(0.064), bowl()) == 0


def test_finger_in_a_bowl_without_thickness_shares_the_wall_it_is_given():
    half = trimesh.creation.icosphere(5, 0.07)
    half.update_faces(half.triangles_center[:, 2] < 0)
    sheet = from_trimesh(half)
    found = volume_of(finger(0.09), sheet)
    wall = from_trimesh(trimesh.creation.icosphere(5, 0.071))
    inner = from_trimesh(trimesh.creation.icosphere(5, 0.069))
    exact = ((body(wall) - body(inner)) ^ body(finger(0.09))).volume()
    assert found == pytest.approx(exact, rel=0.02)


SHIFTS = torch.tensor([[0.0307, 0.0113, 0.0004], [0.0452, 0.0003, 0.0004], [0.2, 0.0, 0.0]])
CUBE, HAND = SurfaceDistance(from_trimesh(box(0.06))), from_trimesh(box(0.04))
STILL = MovingSurface((CUBE,), torch.eye(3).expand(3, 1, 3, 3), torch.zeros(3, 1, 3))
EXPECTED = (0.05 - SHIFTS.abs()).clamp(0, 0.04).prod(-1)


def test_boxes_that_overlap_share_a_box():
    found = intersection_volume(HAND.verts + SHIFTS[:, None], HAND.faces, STILL)
    torch.testing.assert_close(found, EXPECTED, rtol=0.02, atol=1e-10)


def test_parts_add_up():
    parts = [ball(0.02, 0.0, 0.0, 0.0, detail=4), ball(0.015, 0.1, 0.0, 0.0, detail=4)]
    hand = from_trimesh(trimesh.creation.box((0.3, 0.05, 0.05)))
    together = volume_of(hand, *parts)
    assert together == pytest.approx(4 / 3 * math.pi * (0.02**3 + 0.015**3), rel=0.02)


def test_wrist_that_is_open_is_closed_first():
    hand = load_hand("right").shaped(torch.zeros(10))
    posed, faces = hand.verts, hand.model.faces
    # a hole where the forearm would go on: the faces around the vertex farthest from the fingers
    end = int(posed[:, 0].argmax())
    opened = faces[(faces != end).all(-1)]
    around = ball(0.5, detail=3)
    whole = float(body(Mesh(posed, faces)).volume())
    assert volume_of(Mesh(posed, opened), around, voxel=0.002) == pytest.approx(whole, rel=0.02)


def holed() -> Mesh:
    """A ball with a round hole above."""
    shape = trimesh.creation.icosphere(4, 0.05)
    shape.update_faces(np.linalg.norm(shape.triangles_center - [0, 0, 0.05], axis=1) > 0.02)
    return from_trimesh(shape)


def test_every_voxel_that_is_asked_for_alone_gives_the_same_count():
    hand = load_hand("right").shaped(torch.zeros(10))
    torus = from_trimesh(trimesh.creation.torus(0.03, 0.012))
    posed = Mesh(hand.verts + torch.tensor([0.08, 0.01, 0.0]), hand.model.faces)
    voxel, steps = 0.002, (torch.arange(-60, 61) + 0.5) * 0.002
    middles = torch.cartesian_prod(steps, steps, steps).double() @ ASKEW.T
    for one, other in ((posed, torus), (ball(0.03, z=0.05, detail=3), holed())):
        closed = Mesh(*capped(one.verts, one.faces))
        solids = [SurfaceDistance(mesh).solid for mesh in (other, closed)]
        slow = int((solids[0].contains(middles) & solids[1].contains(middles)).sum())
        assert slow > 300
        assert volume_of(one, other, voxel=voxel) == pytest.approx(slow * voxel**3)


def test_an_object_with_holes_counts_as_if_it_were_closed():
    shape = trimesh.creation.icosphere(4, 0.04)
    shape.update_faces(np.linalg.norm(shape.triangles_center - [0, 0, 0.04], axis=1) > 0.008)
    assert not shape.is_watertight
    plug = ball(0.01, 0.0, 0.0, 0.037)
    whole = (body(plug) ^ body(ball(0.04, detail=4))).volume()
    found = volume_of(plug, from_trimesh(shape))
    # the winding number closes a hole by a surface that bulges a little
    assert found == pytest.approx(whole, rel=0.1)


@pytest.mark.parametrize("keep", [slice(None), slice(1, None)])
def test_volume_does_not_change_with_a_rigid_motion(keep):
    faces, verts = HAND.faces[keep], HAND.verts + SHIFTS[:, None]
    rotation = axis_angle_to_matrix(torch.tensor([[0.5, -1.0, 2.0]] * 3))[:, None]
    translation = torch.tensor([0.3, -0.2, 0.5]).expand(3, 1, 3)
    moved = verts @ rotation[:, 0].mT + translation
    rest = intersection_volume(verts, faces, STILL)
    found = intersection_volume(moved, faces, MovingSurface((CUBE,), rotation, translation))
    torch.testing.assert_close(found, rest, rtol=1e-3, atol=1e-10)


def test_frames_without_a_hand_have_no_volume():
    verts = (HAND.verts + SHIFTS[:, None]).clone()
    verts[0] = torch.nan
    found = intersection_volume(verts, HAND.faces, STILL)
    assert found.isnan().tolist() == [True, False, False]


def test_a_hundred_times_the_triangles_take_at_most_ten_times_as_long():
    hand = load_hand("right").shaped(torch.zeros(10))
    verts = hand.verts + torch.tensor([0.08, 0.01, 0.0]) + 0.0002 * torch.arange(4)[:, None, None]
    spent, peaks, volumes = [], [], []
    for rings in (32, 320):
        torus = trimesh.creation.torus(0.03, 0.012, major_sections=rings, minor_sections=rings)
        field = SurfaceDistance(from_trimesh(torus))
        surface = MovingSurface((field,), torch.eye(3).expand(4, 1, 3, 3), torch.zeros(4, 1, 3))
        tracemalloc.start()
        start = time.process_time()
        volumes.append(intersection_volume(verts, hand.model.faces, surface))
        spent.append(time.process_time() - start)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert spent[1] < 10 * spent[0]
    assert peaks[1] < 200e6
    torch.testing.assert_close(volumes[1], volumes[0], rtol=0.02, atol=0)
