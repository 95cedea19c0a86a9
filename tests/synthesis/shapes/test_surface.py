import pytest
import torch
from draws import seeded
from watertight import is_watertight

from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.synthesis.shapes.solids import BOX, ELLIPSOID, TORUS
from geneoh.synthesis.shapes.surface import COARSEST, SPACING, mesh_of_solid, spacing_for_looks

SIZES = {
    BOX: ((0.02, 0.03, 0.01), 8 * 0.02 * 0.03 * 0.01),
    ELLIPSOID: ((0.02, 0.03, 0.01), 4 / 3 * torch.pi * 0.02 * 0.03 * 0.01),
    TORUS: ((0.03, 0.008, 1.0), 2 * torch.pi**2 * 0.03 * 0.008**2),
}


def volume(mesh) -> float:
    a, b, c = mesh.corners().double().unbind(-2)
    return float((a * torch.linalg.cross(b, c)).sum()) / 6


@pytest.mark.parametrize("kind", SIZES)
@pytest.mark.parametrize("center", [(0.0, 0.0, 0.0), (0.4, -0.2, 0.1)])
def test_the_mesh_is_closed_and_has_the_solids_volume(make_solid, kind, center):
    size, want = SIZES[kind]
    mesh = mesh_of_solid(make_solid(kind, size, center=center), 0.001)
    assert is_watertight(mesh)
    assert abs(volume(mesh)) == pytest.approx(want, rel=0.03)


@pytest.mark.parametrize("family", ["kettle", "knife", "scissors"])
def test_vertices_lie_on_the_surface_and_nothing_is_cut_off(family):
    solid = draw_objects([family], generator=seeded(5))
    mesh = mesh_of_solid(solid)
    assert is_watertight(mesh)
    assert float(solid.signed_distance(mesh.verts[None]).abs().max()) < 1e-4
    points, _ = solid.surface_points(300, generator=seeded())
    assert float(torch.cdist(points[0], mesh.verts).amin(-1).max()) < 1.5 * SPACING


def test_pictures_use_fine_grids_for_thin_solids_only(make_solid):
    assert spacing_for_looks(make_solid(BOX, (0.1, 0.1, 0.1))) == COARSEST
    assert spacing_for_looks(make_solid(BOX, (0.1, 0.1, 0.0015))) == SPACING
    thin = spacing_for_looks(make_solid(TORUS, (0.1, 0.0025, 1.0)))
    assert thin == pytest.approx(0.003)
