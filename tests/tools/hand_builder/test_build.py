"""The embedded hand's maker: connectivity, form and that the asset came from them."""

import numpy as np
import pytest
import trimesh

from geneoh.hand.embedded import read_arrays
from tools.hand_builder.__main__ import ORIGIN, tip_order
from tools.hand_builder.anatomy import digits, hand_distance, rod, skeleton, smooth_min
from tools.hand_builder.limits import rotation_vector
from tools.hand_builder.topology import hand_topology


def test_layout_is_one_closed_sphere_of_778_vertices():
    topology = hand_topology()
    mesh = trimesh.Trimesh(
        np.random.default_rng(0).random((778, 3)), topology.triangles, process=False
    )
    assert topology.count == 778
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2
    assert set(topology.triangles.ravel()) == set(range(778))


def test_edges_leave_out_the_diagonals_of_quads():
    topology = hand_topology()
    fans = 4 * 8 + 12 + 20
    quads = (len(topology.triangles) - fans) // 2
    assert len(topology.edges) == 3 * len(topology.triangles) // 2 - quads


def test_distance_to_a_rod_is_that_to_its_axis_less_its_radius():
    points = np.array([[5.0, 4.0, 0.0], [-3.0, 0.0, 0.0], [14.0, 0.0, 3.0]])
    found = rod(points, np.zeros(3), np.array([10.0, 0.0, 0.0]), (1.0, 2.0), 1.0)
    np.testing.assert_allclose(found, [4 - 1.5, 3 - 1, 5 - 2])


def test_smooth_union_holds_both_solids_and_little_more():
    random = np.random.default_rng(0)
    a, b = random.normal(size=(2, 100)) * 5
    union = smooth_min([a, b], 1.5)
    assert (union <= np.minimum(a, b)).all()
    assert (union >= np.minimum(a, b) - 1.5 * np.log(2) - 1e-12).all()


def test_flexion_turns_a_finger_towards_the_palm():
    tube = digits(skeleton())[0]
    vector = rotation_vector(tube, 1, 90.0, 0.0, 0.0)
    assert np.linalg.norm(vector) == pytest.approx(np.pi / 2)
    assert vector[2] > 1.4


def test_vertices_of_the_asset_lie_on_the_surface_of_the_form():
    arrays, topology, bones = read_arrays(), hand_topology(), skeleton()
    verts = arrays["v_template"][np.argsort(tip_order(topology))] * 1000.0 - ORIGIN
    gap = np.abs(hand_distance(verts, bones, digits(bones)))
    closing = np.r_[topology.dorsal[-2:].ravel(), topology.palmar[-2:].ravel(), topology.cap]
    closing = np.r_[closing, topology.side[-2:].ravel()]
    on_skin = np.delete(gap, closing)
    # Tubes of fingers are placed on their own, so their roots lie a little inside the fillets.
    assert np.median(on_skin) < 0.05
    assert np.percentile(on_skin, 95) < 1.0
