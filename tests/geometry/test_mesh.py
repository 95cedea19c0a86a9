import numpy as np
import pytest
import torch
import trimesh
from watertight import is_watertight

from geneoh.errors import InputError
from geneoh.geometry.mesh import (
    Mesh,
    checked,
    load_mesh,
    open_edges,
    size_warning,
    thickened,
    welded,
)


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    verts = torch.tensor(np.array(shape.vertices), dtype=torch.float32)
    return Mesh(verts, torch.tensor(np.array(shape.faces), dtype=torch.int64))


def volume(mesh: Mesh) -> float:
    a, b, c = mesh.corners().double().unbind(-2)
    return float((a * torch.linalg.cross(b, c)).sum() / 6)


@pytest.fixture
def ball():
    return trimesh.creation.icosphere(2, 0.05)


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off", "glb"])
def test_every_format_gives_the_same_surface(ball, suffix, tmp_path):
    ball.export(tmp_path / f"ball.{suffix}")
    mesh = load_mesh(tmp_path / f"ball.{suffix}")
    torch.testing.assert_close(mesh.corners(), mesh_of(ball).corners(), atol=1e-6, rtol=0)
    assert is_watertight(mesh)


@pytest.mark.parametrize("suffix", ["obj", "ply", "off", "glb"])
def test_vertex_order_is_kept(ball, suffix, tmp_path):
    ball.export(tmp_path / f"ball.{suffix}")
    mesh = load_mesh(tmp_path / f"ball.{suffix}")
    torch.testing.assert_close(mesh.verts, mesh_of(ball).verts, atol=1e-6, rtol=0)


def test_scene_becomes_one_mesh_with_its_nodes_in_place(ball, tmp_path):
    scene = trimesh.Scene(ball)
    scene.add_geometry(ball, transform=trimesh.transformations.translation_matrix([1.0, 0, 0]))
    scene.export(tmp_path / "two.glb")
    mesh = load_mesh(tmp_path / "two.glb")
    assert len(mesh.faces) == 2 * len(ball.faces)
    torch.testing.assert_close(mesh.extent(), torch.tensor([1.1, 0.1, 0.1]), atol=1e-4, rtol=0)


VERTS = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("text.obj", "hello", "got 0 vertices and no face"),
        ("lost.obj", VERTS + "f 1 2 7\n", "cannot be read as OBJ"),
        ("empty.stl", "", "no face"),
        ("cut.ply", "ply\n", "cannot be read as PLY"),
        ("cut.glb", "12", "cannot be read as GLB"),
        (
            "far.off",
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
            "cannot be read as OFF",
        ),
        ("nan.obj", VERTS.replace("1", "nan", 1) + "f 1 2 3\n", "got NaN or infinity in 1 of 3"),
        ("flat.obj", VERTS + "f 1 2 2\n", "1 faces without any area"),
        ("model.fbx", "", "expected a mesh file"),
    ],
)
def test_useless_file_is_refused_in_one_sentence_that_names_it(name, content, said, tmp_path):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError) as caught:
        load_mesh(tmp_path / name)
    message = str(caught.value)
    assert message.startswith(str(tmp_path / name))
    assert said in message
    assert "\n" not in message


@pytest.mark.parametrize("index", [-1, 3])
def test_faces_beyond_the_vertices_are_refused(index):
    mesh = Mesh(torch.eye(3), torch.tensor([[0, 1, index]]))
    with pytest.raises(InputError, match=r"cup\.obj: faces must index the 3 vertices"):
        checked(mesh, "cup.obj")


def test_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such mesh file"):
        load_mesh(tmp_path / "none.obj")


@pytest.mark.parametrize(
    ("scale", "said"), [(1000, "--unit mm"), (100, "--unit cm"), (1, None), (0.001, "1000")]
)
def test_absurd_size_says_how_to_scale(ball, scale, said):
    warning = size_warning(mesh_of(ball.apply_scale(scale)))
    assert warning is None if said is None else said in warning


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1000), ("cm", 100)])
def test_a_mesh_in_another_unit_is_read_in_metres(ball, unit, scale, tmp_path):
    ball.export(tmp_path / "metres.obj")
    ball.apply_scale(scale).export(tmp_path / "ball.obj")
    metres, read = load_mesh(tmp_path / "metres.obj"), load_mesh(tmp_path / "ball.obj", unit)
    torch.testing.assert_close(read.verts, metres.verts, rtol=0, atol=1e-6)
    assert read.source is None


def test_mirrored_mesh_still_looks_outward(ball):
    ball.apply_translation([0.3, 0, 0])
    mesh = mesh_of(ball)
    assert volume(mesh.mirrored()) == pytest.approx(volume(mesh))
    assert float(mesh.mirrored().verts[:, 0].max()) < 0


def test_seams_are_no_openings_and_holes_are(ball):
    seams = Mesh(mesh_of(ball).corners().reshape(-1, 3), torch.arange(960).reshape(-1, 3))
    assert is_watertight(seams)
    assert int(open_edges(welded(seams).faces).sum()) == 0
    assert not is_watertight(Mesh(seams.verts, seams.faces[1:]))


def test_one_missing_face_leaves_its_three_edges_open(ball):
    faces = mesh_of(ball).faces
    rim = open_edges(faces[1:])
    assert int(rim.sum()) == 3
    assert set(faces[1:][rim].tolist()) <= set(faces[0].tolist())


def test_thickened_sheet_is_closed_and_holds_area_times_thickness():
    sheet = trimesh.creation.icosphere(3, 0.05)
    sheet.update_faces(sheet.triangles_center[:, 2] < 0)
    wall = thickened(mesh_of(sheet), 0.002)
    assert is_watertight(wall)
    assert len(wall.verts) == 2 * len(np.unique(sheet.faces))
    assert volume(wall) == pytest.approx(sheet.area * 0.002, rel=0.01)
