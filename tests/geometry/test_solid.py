import numpy as np
import pytest
import torch
import trimesh

from geneoh.errors import InputError
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.geometry.solid import build_solid

CENTRE = torch.zeros(1, 3)


def without(shape: trimesh.Trimesh, faces: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(shape.vertices, shape.faces[~faces], process=False)


def cylinder() -> trimesh.Trimesh:
    return trimesh.creation.cylinder(0.03, 0.12, sections=48).subdivide().subdivide()


def heights(shape: trimesh.Trimesh) -> np.ndarray:
    return shape.triangles_center[:, 2]


def disc(z: float, sections: int) -> trimesh.Trimesh:
    turn = np.linspace(0, 2 * np.pi, sections, endpoint=False)
    rim = 0.03 * np.stack([np.cos(turn), np.sin(turn)], -1)
    verts = np.concatenate([[[0, 0, z]], np.insert(rim, 2, z, axis=-1)])
    step = np.arange(sections)
    faces = np.stack([0 * step, 1 + step, 1 + (step + 1) % sections], -1)
    return trimesh.Trimesh(verts, faces if z > 0 else faces[:, ::-1], process=False)


@pytest.fixture
def torus():
    return trimesh.creation.torus(0.05, 0.02, major_sections=48, minor_sections=24)


IN_TORUS = torch.tensor([[0.05, 0.0, 0.0], [0.0, -0.05, 0.01], [-0.04, 0.0, -0.01]])
OFF_TORUS = torch.tensor([[0.0, 0.0, 0.0], [0.06, 0.06, 0.0], [0.05, 0.0, 0.019]])


def gets_a_wall(mesh: Mesh | trimesh.Trimesh) -> bool:
    mesh = mesh if isinstance(mesh, Mesh) else from_trimesh(mesh)
    solid = build_solid(mesh)
    assert solid.walled == (len(solid.body.verts) > len(mesh.verts))
    return solid.walled


def assert_is_the_torus(mesh: Mesh) -> None:
    solid = build_solid(mesh)
    assert not gets_a_wall(mesh)
    assert bool(solid.contains(IN_TORUS).all())
    assert not bool(solid.contains(OFF_TORUS[:2]).any())
    middles = solid.surface.corners().mean(-2)
    ring = torch.nn.functional.normalize(middles * torch.tensor([1.0, 1.0, 0.0]), dim=-1) * 0.05
    assert bool(((middles - ring) * solid.surface.face_normals()).sum(-1).gt(0).all())


def test_closed_mesh_is_the_solid_it_looks_like(torus):
    assert_is_the_torus(from_trimesh(torus))


def test_mesh_inside_out_is_the_same_solid(torus):
    torus.invert()
    assert_is_the_torus(from_trimesh(torus))


def test_faces_that_disagree_are_turned_to_agree(torus):
    mesh = from_trimesh(torus)
    flip = torch.rand(len(mesh.faces), generator=torch.Generator().manual_seed(0)) < 0.2
    assert_is_the_torus(
        Mesh(mesh.verts, torch.where(flip[:, None], mesh.faces.flip(-1), mesh.faces))
    )


@pytest.mark.parametrize("turned", [True, False])
@pytest.mark.parametrize("own_vertices", [True, False])
def test_faces_that_are_there_twice_are_one(torus, turned, own_vertices):
    again = torus.copy()
    if turned:
        again.invert()
    both = trimesh.util.concatenate([torus, again])
    if not own_vertices:
        both.merge_vertices()
    mesh = from_trimesh(both)
    assert_is_the_torus(mesh)
    assert len(build_solid(mesh).surface.faces) == len(torus.faces)


@pytest.mark.parametrize("turned", [True, False])
def test_faces_of_which_some_are_there_twice_are_one(torus, turned):
    mesh = from_trimesh(torus)
    again = mesh.faces[len(mesh.faces) // 3 :][: len(mesh.faces) // 2]
    both = Mesh(mesh.verts, torch.cat([mesh.faces, again.flip(-1) if turned else again]))
    assert_is_the_torus(both)
    assert len(build_solid(both).surface.faces) == len(mesh.faces)


def test_a_sheet_that_is_seen_from_either_side_has_a_wall():
    square = torch.tensor([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]])
    faces = torch.tensor([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]])
    found = SurfaceDistance(Mesh(square, faces)).query(torch.tensor([[[0.05, 0.05, 0.0005]]]))
    assert found.distance == pytest.approx(-0.0005, abs=1e-6)


@pytest.mark.parametrize("inside_out", [True, False])
def test_boxes_that_share_a_wall_are_one_solid(inside_out):
    boxes = [trimesh.creation.box((0.1, 0.1, 0.1)) for _ in range(2)]
    boxes[1].apply_translation((0.1, 0, 0))
    both = trimesh.util.concatenate(boxes)
    if inside_out:
        both.invert()
    found = SurfaceDistance(from_trimesh(both))
    inside = torch.tensor([[[0.0, 0, 0], [0.05, 0, 0], [0.1, 0, 0]]])
    assert found.query(inside).distance[0].tolist() == pytest.approx([-0.05] * 3, abs=1e-5)


def test_missing_faces_leave_a_solid(torus):
    lost = np.random.default_rng(0).random(len(torus.faces)) < 0.1
    assert_is_the_torus(from_trimesh(without(torus, lost)))


def test_a_hole_of_25_mm_leaves_a_solid(torus):
    lost = np.linalg.norm(torus.triangles_center - [0.0, 0.05, 0.02], axis=-1) < 0.0125
    assert_is_the_torus(from_trimesh(without(torus, lost)))


def test_triangles_without_shared_vertices_are_a_solid(torus):
    corners = from_trimesh(torus).corners()
    assert_is_the_torus(
        Mesh(corners.reshape(-1, 3), torch.arange(corners.numel() // 3).reshape(-1, 3))
    )


def test_faces_buried_by_another_shell_are_no_surface():
    parts = [trimesh.creation.icosphere(3, 0.05).apply_translation([x, 0, 0]) for x in (0, 0.06)]
    solid = build_solid(from_trimesh(trimesh.util.concatenate(parts)))
    middles = solid.surface.corners().mean(-2)
    centres = torch.tensor([[0.0, 0, 0], [0.06, 0, 0]])
    assert float(torch.cdist(middles, centres).min()) > 0.045
    assert bool(solid.contains(torch.tensor([[0.03, 0, 0], [0.0, 0.0, 0.04], [0.1, 0, 0]])).all())


@pytest.mark.parametrize("whole_inside_out", [True, False])
def test_shells_that_overlap_and_point_opposite_ways_are_one_solid(torus, whole_inside_out):
    rod = trimesh.creation.box((0.02, 0.02, 0.1)).apply_translation([0.05, 0, 0])
    solid = build_solid(from_trimesh(trimesh.util.concatenate([torus, rod])))
    rod.invert()
    mixed = trimesh.util.concatenate([torus, rod])
    if whole_inside_out:
        mixed.invert()
    points = 0.08 * torch.rand(1000, 3, generator=torch.Generator().manual_seed(0))
    found, expected = build_solid(from_trimesh(mixed)), solid.contains(points)
    assert 100 < int(expected.sum()) < 900
    assert found.contains(points).equal(expected)
    assert len(found.surface.faces) == len(solid.surface.faces)


@pytest.mark.parametrize("whole_inside_out", [True, False])
def test_hollow_shells_keep_their_cavity(whole_inside_out):
    outer, inner = trimesh.creation.icosphere(3, 0.05), trimesh.creation.icosphere(3, 0.04)
    inner.invert()
    both = trimesh.util.concatenate([outer, inner])
    if whole_inside_out:
        both.invert()
    solid = build_solid(from_trimesh(both))
    assert solid.contains(torch.tensor([[0.0, 0, 0], [0.045, 0, 0]])).tolist() == [False, True]
    assert len(solid.surface.faces) == len(outer.faces) + len(inner.faces)


@pytest.mark.parametrize("inverted", [False, True])
def test_open_bowl_has_a_wall_and_a_cavity(inverted):
    bowl = trimesh.creation.icosphere(4, 0.06)
    bowl.update_faces(heights(bowl) < 0)
    if inverted:
        bowl.invert()
    solid = build_solid(from_trimesh(bowl))
    assert gets_a_wall(bowl)
    down = torch.tensor([0.0, 0.03, 0.055, 0.0597, 0.0603, 0.065])
    inside = solid.contains(down[:, None] * torch.tensor([0.0, 0.0, -1.0]))
    assert inside.tolist() == [False, False, False, True, True, False]


def test_glass_is_open_and_bottle_is_solid():
    glass = without(cylinder(), heights(cylinder()) > 0.0599)
    middle = cylinder().triangles_center
    neck = (middle[:, 2] > 0.0599) & (np.linalg.norm(middle[:, :2], axis=-1) < 0.012)
    assert gets_a_wall(glass)
    assert not bool(build_solid(from_trimesh(glass)).contains(CENTRE)[0])
    assert not gets_a_wall(without(cylinder(), neck))
    assert bool(build_solid(from_trimesh(without(cylinder(), neck))).contains(CENTRE)[0])


def test_tube_closed_by_separate_lids_is_solid_and_with_one_lid_a_glass():
    tube = without(cylinder(), abs(heights(cylinder())) > 0.0599)
    lids = [disc(0.06, 31), disc(-0.06, 37)]
    closed = trimesh.util.concatenate([tube, *lids])
    assert not gets_a_wall(closed)
    assert bool(build_solid(from_trimesh(closed)).contains(CENTRE)[0])
    assert gets_a_wall(tube)
    assert not bool(
        build_solid(from_trimesh(trimesh.util.concatenate([tube, lids[1]]))).contains(CENTRE)[0]
    )


def test_box_of_six_loose_sides_is_solid():
    box = trimesh.creation.box((0.06, 0.05, 0.04))
    sides = [
        without(box, abs(box.face_normals @ axis - sign) > 1e-6).subdivide_loop(0)
        for axis in np.eye(3)
        for sign in (1, -1)
    ]
    # Different subdivisions on each side, so that no edge of one side is an edge of the next.
    for i, side in enumerate(sides):
        for _ in range(i % 3):
            side = side.subdivide()
        sides[i] = side
    box = trimesh.util.concatenate(sides)
    assert not gets_a_wall(box)
    assert bool(build_solid(from_trimesh(box)).contains(CENTRE)[0])


@pytest.mark.parametrize("metres", [1e3, 1e5])
@pytest.mark.parametrize("collinear", [False, True])
def test_far_corner_of_a_face_without_area_changes_no_depth(metres, collinear):
    box = from_trimesh(trimesh.creation.box((0.1, 0.1, 0.1)).subdivide().subdivide())
    corner = box.verts[0]
    (other,) = torch.nonzero((box.verts == corner * torch.tensor([-1, 1, 1])).all(-1))[0]
    far = torch.tensor([[metres, corner[1], corner[2]]])  # in line with an edge of the box
    face = torch.tensor([[0, len(box.verts), int(other) if collinear else 0]])
    stretched = Mesh(torch.cat([box.verts, far]), torch.cat([box.faces, face]))
    points = torch.rand(200, 3, generator=torch.Generator().manual_seed(0)) * 0.2 - 0.1
    found = SurfaceDistance(stretched).query(points).distance
    torch.testing.assert_close(found, SurfaceDistance(box).query(points).distance)


@pytest.mark.parametrize(
    ("verts", "faces", "said"),
    [
        (torch.zeros(0, 3), torch.zeros(0, 3, dtype=torch.int64), "no face"),
        (torch.eye(3) * torch.nan, torch.tensor([[0, 1, 2]]), "NaN"),
        (torch.eye(3), torch.tensor([[0, 1, 3]]), "must index the 3 vertices"),
        (torch.eye(3) * 1e-7, torch.tensor([[0, 1, 2]]), "1e-07 m long; scale it to metres"),
        (torch.eye(3), torch.tensor([[0, 0, 1]]), "no area"),
    ],
)
def test_mesh_without_a_surface_is_refused_before_any_search_tree(verts, faces, said):
    with pytest.raises(InputError, match=said):
        SurfaceDistance(Mesh(verts, faces))
