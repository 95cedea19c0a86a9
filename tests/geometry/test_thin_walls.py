import pytest
import torch
import trimesh

from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.geometry.openings import edges_of
from geneoh.geometry.thin_walls import goes_through

FINGER = from_trimesh(trimesh.creation.icosphere(2, 0.01))
EDGES = edges_of(FINGER.faces)


def through(extents: tuple[float, float, float], place: tuple[float, float, float]) -> bool:
    """Whether a ball of 1 cm at a place goes through a box at the origin."""
    found = SurfaceDistance(from_trimesh(trimesh.creation.box(extents))).query(
        FINGER.verts + torch.tensor(place)
    )
    verts = FINGER.verts + torch.tensor(place)
    return bool(goes_through(verts, found.distance, found.normal, EDGES))


def test_a_sphere_has_three_edges_for_two_faces():
    assert len(EDGES) == 3 * len(FINGER.faces) // 2


@pytest.mark.parametrize("height", [-0.005, 0.0, 0.008])
def test_a_ball_goes_through_a_plate_that_is_thinner_than_it(height):
    assert through((0.1, 0.1, 0.001), (0.0, 0.0, height))


@pytest.mark.parametrize(
    ("extents", "place"),
    [
        ((0.1, 0.1, 0.001), (0.0, 0.0, 0.0106)),  # lies on it
        ((0.1, 0.1, 0.001), (0.0595, 0.0, 0.0)),  # half a millimetre beyond its rim
        ((0.1, 0.1, 0.1), (0.0, 0.0, 0.05)),  # half of it is in a block
        ((0.1, 0.1, 0.1), (0.05, 0.05, 0.05)),  # around its corner
    ],
)
def test_a_ball_on_a_plate_at_its_rim_or_in_a_block_goes_through_no_wall(extents, place):
    assert not through(extents, place)
