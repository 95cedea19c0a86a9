"""The search of surfaces that runs on GPUs, beside libigl's; where there is no GPU, on the CPU."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import load_mesh

pytest.importorskip("warp", reason="needs NVIDIA Warp (extra gpu)")
OBJECT = Path(__file__).parents[2] / "examples" / "taco_object.obj"


@pytest.fixture(params=["cpu", pytest.param("cuda", marks=pytest.mark.gpu)])
def device(request) -> torch.device:
    if request.param == "cuda" and not torch.cuda.is_available():
        pytest.skip("needs a CUDA device")
    return torch.device(request.param)


def box(low: float, high: float, *, inward: bool = False) -> Mesh:
    corners = torch.cartesian_prod(*[torch.tensor([low, high])] * 3)
    faces = torch.tensor(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
        + [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    )
    return Mesh(corners, faces.flip(-1) if inward else faces)


def both_boxes() -> Mesh:
    """Two boxes apart from each other, of which one is turned inside out."""
    first, second = box(-0.05, 0.05), box(0.1, 0.2, inward=True)
    faces = torch.cat([first.faces, second.faces + len(first.verts)])
    return Mesh(torch.cat([first.verts, second.verts]), faces)


def open_box() -> Mesh:
    whole = box(-0.05, 0.05)
    return replace(whole, faces=whole.faces[2:])


@pytest.mark.parametrize("name", ["box", "two", "open", "scan"])
def test_it_answers_as_libigl_does(name, device):
    meshes = {"box": lambda: box(-0.05, 0.05), "two": both_boxes, "open": open_box}
    mesh = load_mesh(OBJECT) if name == "scan" else meshes[name]()
    field = SurfaceDistance(mesh)
    low, high = mesh.verts.amin(0) - 0.03, mesh.verts.amax(0) + 0.03
    share = torch.rand(4, 500, 3, generator=torch.Generator().manual_seed(0))
    points = low + share * (high - low)
    wanted, found = field.query(points), field.query_on(device, points)
    assert found.distance.shape == (4, 500)
    assert (wanted.distance < 0).any()
    torch.testing.assert_close(found.distance, wanted.distance, atol=1e-5, rtol=0)
    far = wanted.distance.abs() > 1e-4
    same = (found.closest - wanted.closest).norm(dim=-1)[far] < 1e-4
    assert same.float().mean() > 0.995  # but where two places are equally near
    agree = (found.normal * wanted.normal).sum(-1)[far][same]
    assert agree.min() > 0.99


def test_points_that_are_not_finite_get_no_distance(device):
    points = torch.tensor([[float("nan"), 0, 0], [0.06, 0.0, 0.0]])
    found = SurfaceDistance(box(-0.05, 0.05)).query_on(device, points)
    assert found.distance.isfinite().tolist() == [False, True]
    assert found.distance[1] == pytest.approx(0.01, abs=1e-6)


def test_normals_on_the_surface_are_those_of_its_faces(device):
    found = SurfaceDistance(box(-0.05, 0.05)).query_on(device, torch.tensor([[0.05, 0.01, 0.02]]))
    torch.testing.assert_close(found.normal, torch.tensor([[1.0, 0, 0]]))
    assert found.distance.abs() < 1e-6


def test_what_is_far_from_the_box_is_not_searched_for(device):
    field = SurfaceDistance(load_mesh(OBJECT))
    points = 0.4 * torch.rand(2000, 3, generator=torch.Generator().manual_seed(0)) - 0.2
    exact, found = field.query(points), field.query_on(device, points, 0.02)
    near = exact.distance <= 0.02
    torch.testing.assert_close(found.distance[near], exact.distance[near], atol=1e-5, rtol=0)
    assert (found.distance[~near] > 0.02).all()
    assert (found.distance <= exact.distance + 1e-5).all()
    assert (found.distance < exact.distance - 1e-3).any()
