"""What one process of the benchmark does."""

import pytest
import trimesh

from geneoh.bench.measure import Moment, by_stage, example, subdivided


@pytest.fixture(scope="module")
def mesh():
    return example(2).object.meshes[0]


def test_the_track_runs_forth_and_back(mesh):
    track = example(300).hands[0].joints
    assert track.shape[0] == 300
    assert (track[150] == track[2 * 145 - 150]).all()
    assert (track[290] == track[0]).all()


@pytest.mark.parametrize("triangles", [2002, 5999, 8000, 20_000])
def test_a_refined_mesh_has_the_same_surface_in_so_many_triangles(mesh, triangles):
    made, before = (
        trimesh.Trimesh(each.verts.numpy().astype(float), each.faces.numpy(), process=False)
        for each in (subdivided(mesh, triangles), mesh)
    )
    assert len(made.faces) == triangles - triangles % 2
    assert made.area == pytest.approx(before.area, rel=1e-5)
    assert made.volume == pytest.approx(before.volume, rel=1e-5)
    assert made.is_winding_consistent
    assert made.area_faces.min() > 0


def test_no_mesh_is_made_coarser(mesh):
    assert subdivided(mesh, 100) is mesh


def test_the_first_stage_does_not_pay_for_what_came_before_it():
    """Four seconds of preparation, then motion in two steps of 1 s and the fit in one of 3 s."""
    moments = [
        ("", Moment(10.0, 1.0, 100.0)),
        ("motion", Moment(15.0, 3.5, 120.0)),
        ("motion", Moment(16.0, 4.0, 130.0)),
        ("fit", Moment(19.0, 5.5, 200.0)),
    ]
    found = by_stage(moments, {"motion": 2.0, "fit": 3.0})
    assert found == {
        "motion": {"seconds": 2.0, "processor": 1.0, "peak_mb": 130.0},
        "fit": {"seconds": 3.0, "processor": 1.5, "peak_mb": 200.0},
    }
