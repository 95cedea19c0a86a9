import numpy as np
import pytest
import torch
import trimesh
from scipy.sparse.csgraph import connected_components
from watertight import is_watertight, volume

from geneoh.geometry.mesh import Mesh, welded
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.geometry.openings import connected, open_edges, thickened


@pytest.fixture
def ball():
    return trimesh.creation.icosphere(2, 0.05)


def test_seams_are_no_openings_and_holes_are(ball):
    seams = Mesh(from_trimesh(ball).corners().reshape(-1, 3), torch.arange(960).reshape(-1, 3))
    assert is_watertight(seams)
    assert int(open_edges(welded(seams).faces).sum()) == 0
    assert not is_watertight(Mesh(seams.verts, seams.faces[1:]))


def test_edges_are_joined_by_the_integers_that_every_scipy_takes(monkeypatch):
    def joined(links, **how):
        assert links.row.dtype == np.int32  # scipy before 1.12 takes no others
        return connected_components(links, **how)

    monkeypatch.setattr("geneoh.geometry.openings.connected_components", joined)
    assert connected(torch.tensor([[0, 1], [2, 3], [3, 4]])).tolist() == [0, 0, 1, 1, 1]


def test_one_missing_face_leaves_its_three_edges_open(ball):
    faces = from_trimesh(ball).faces
    rim = open_edges(faces[1:])
    assert int(rim.sum()) == 3
    assert set(faces[1:][rim].tolist()) <= set(faces[0].tolist())


def test_thickened_sheet_is_closed_and_holds_area_times_thickness():
    sheet = trimesh.creation.icosphere(3, 0.05)
    sheet.update_faces(sheet.triangles_center[:, 2] < 0)
    wall = thickened(from_trimesh(sheet), 0.002)
    assert is_watertight(wall)
    assert len(wall.verts) == 2 * len(np.unique(sheet.faces))
    assert volume(wall) == pytest.approx(sheet.area * 0.002, rel=0.01)
