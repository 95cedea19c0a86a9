import numpy as np

from geneoh.viz.raster import NOTHING, at_pixels, rasterise


def slow_raster(screen, faces, size):
    """Every pixel against every face."""
    width, height = size
    face = np.full((height, width), NOTHING)
    best = np.zeros((height, width))
    for row in range(height):
        for column in range(width):
            point = np.array([column + 0.5, row + 0.5])
            for index, corners in enumerate(faces):
                a, b, c = screen[corners]
                matrix = np.stack([b[:2] - a[:2], c[:2] - a[:2]], -1)
                if abs(np.linalg.det(matrix)) < 1e-9:
                    continue
                second, third = np.linalg.solve(matrix, point - a[:2])
                if min(second, third, 1 - second - third) < 0:
                    continue
                near = a[2] + second * (b[2] - a[2]) + third * (c[2] - a[2])
                if near > best[row, column]:
                    best[row, column], face[row, column] = near, index
    return face, best


def test_random_triangles_cover_the_pixels_that_a_slow_search_finds():
    rng = np.random.default_rng(0)
    screen = np.concatenate([rng.uniform(-4, 28, (24, 2)), rng.uniform(1, 2, (24, 1))], -1)
    faces = np.arange(24).reshape(8, 3)
    face, nearness = slow_raster(screen, faces, (24, 20))
    raster = rasterise(screen, faces, (24, 20))
    np.testing.assert_array_equal(raster.face, face)
    np.testing.assert_allclose(raster.nearness, nearness, atol=1e-5)


def test_the_nearer_of_two_faces_is_in_front_whichever_comes_first():
    square = np.array([[0, 0], [8, 0], [0, 8]])
    near, far = (np.column_stack([square, np.full(3, level)]) for level in (2.0, 1.0))
    for order, front in (((near, far), 0), ((far, near), 1)):
        raster = rasterise(np.concatenate(order), np.arange(6).reshape(2, 3), (8, 8))
        assert set(raster.face[raster.covered]) == {front}


def test_a_face_with_a_corner_behind_the_eye_is_left_out():
    screen = np.array([[0, 0, 1.0], [8, 0, 1.0], [0, 8, 0.0]])
    assert not rasterise(screen, np.array([[0, 1, 2]]), (8, 8)).covered.any()


def test_values_are_interpolated_linearly_between_corners():
    screen = np.array([[0.0, 0, 1], [16, 0, 1], [0, 16, 1]])
    faces = np.array([[0, 1, 2]])
    raster = rasterise(screen, faces, (16, 16))
    values = at_pixels(raster, screen, faces, screen[:, :2].astype(np.float32))
    row, column = np.nonzero(raster.covered)
    np.testing.assert_allclose(values, np.stack([column + 0.5, row + 0.5], -1), atol=1e-4)
