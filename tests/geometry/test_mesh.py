import pytest
import torch
import trimesh
from watertight import volume

from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh, checked_mesh, size_warning, tidied
from geneoh.geometry.mesh_files import from_trimesh


@pytest.fixture
def ball():
    return trimesh.creation.icosphere(2, 0.05)


@pytest.mark.parametrize("index", [-1, 3])
def test_faces_beyond_the_vertices_are_refused(index):
    mesh = Mesh(torch.eye(3), torch.tensor([[0, 1, index]]))
    with pytest.raises(InputError, match=r"cup\.obj: faces must index the 3 vertices"):
        checked_mesh(mesh, "cup.obj")


@pytest.mark.parametrize(
    ("scale", "said"), [(1000, "--unit mm"), (100, "--unit cm"), (1, None), (0.001, "1000")]
)
def test_absurd_size_says_how_to_scale(ball, scale, said):
    warning = size_warning(from_trimesh(ball.apply_scale(scale)))
    assert warning is None if said is None else said in warning


def test_a_thin_knife_is_not_too_small():
    assert size_warning(from_trimesh(trimesh.creation.box((0.2, 0.02, 0.001)))) is None


@pytest.mark.parametrize(("scale", "named"), [(1000, False), (100, True), (1 / 0.0254, True)])
def test_inches_are_named_where_they_fit(ball, scale, named):
    words = "if it is in inches, scale it to metres first, by 0.0254"
    assert (words in size_warning(from_trimesh(ball.apply_scale(scale)))) == named


@pytest.mark.parametrize(("size", "named"), [(6.0, True), (150.0, False)])
def test_a_room_is_told_to_be_cut(size, named):
    words = "; if it is a room or a large thing, give the part that hands touch, at most 2.2 m long"
    assert (words in size_warning(from_trimesh(trimesh.creation.box((size, 4, 2.5))))) == named


def test_a_door_is_not_too_large():
    assert size_warning(from_trimesh(trimesh.creation.box((0.9, 0.05, 2.1)))) is None


def test_mirrored_mesh_still_looks_outward(ball):
    ball.apply_translation([0.3, 0, 0])
    mesh = from_trimesh(ball)
    assert volume(mesh.mirrored()) == pytest.approx(volume(mesh))
    assert float(mesh.mirrored().verts[:, 0].max()) < 0
    torch.testing.assert_close(mesh.mirrored().center(), torch.tensor([-0.3, 0.0, 0.0]))
    assert Mesh(mesh.verts, mesh.faces.flip(-1)).sha256 != mesh.sha256


def test_a_tidied_mesh_has_no_unused_vertex_and_no_face_that_repeats_one():
    verts = torch.arange(15.0).reshape(5, 3)
    faces = torch.tensor([[0, 1, 3], [0, 0, 1], [1, 3, 1], [3, 0, 0]])
    found = tidied(Mesh(verts, faces))
    assert tidied(found) is found
    for mesh in (found, tidied(Mesh(verts, faces[:1]))):
        assert torch.equal(mesh.verts, verts[[0, 1, 3]])
        assert mesh.faces.tolist() == [[0, 1, 2]]
