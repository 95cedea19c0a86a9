"""Each measure against the loop that its definition reads as, one frame and point at a time."""

import math

import pytest
import torch
import trimesh

from geneoh.geometry.distance import MovingSurface, SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.metrics.accuracy import mpjpe, mpvpe
from geneoh.metrics.contact import (
    contact_iou,
    motion_consistency,
    penetration_depth,
    proximity_error,
)
from geneoh.metrics.smoothness import acceleration, acceleration_error, jerk

FRAMES, FPS = 7, 30.0


def points(count: int, seed: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return 0.06 * torch.randn(FRAMES, count, 3, generator=generator)


def mean(values) -> float:
    values = [float(value) for value in values]
    return sum(values) / len(values)


BALL = trimesh.creation.icosphere(2, 0.05)
FIELD = SurfaceDistance(Mesh(torch.tensor(BALL.vertices).float(), torch.tensor(BALL.faces)))
STILL = (torch.eye(3).expand(FRAMES, 1, 3, 3), torch.zeros(FRAMES, 1, 3))


def test_position_errors():
    ours, truth = points(21, 0), points(21, 1)
    for measure in (mpjpe, mpvpe):
        for t in range(FRAMES):
            twin = mean((ours[t, k] - truth[t, k]).norm() for k in range(21))
            assert float(measure(ours, truth)[t]) == pytest.approx(twin)


def test_derivatives():
    ours, truth = points(5, 0), points(5, 1)
    for t in range(FRAMES - 2):
        second = [ours[t, k] - 2 * ours[t + 1, k] + ours[t + 2, k] for k in range(5)]
        true = [truth[t, k] - 2 * truth[t + 1, k] + truth[t + 2, k] for k in range(5)]
        twin = mean((a * FPS**2).norm() for a in second)
        assert float(acceleration(ours, FPS)[t]) == pytest.approx(twin, rel=1e-5)
        twin = mean(((a - b) * FPS**2).norm() for a, b in zip(second, true, strict=True))
        assert float(acceleration_error(ours, truth, FPS)[t]) == pytest.approx(twin, rel=1e-5)
    for t in range(FRAMES - 3):
        third = [
            ours[t + 3, k] - 3 * ours[t + 2, k] + 3 * ours[t + 1, k] - ours[t, k] for k in range(5)
        ]
        assert float(jerk(ours, FPS)[t]) == pytest.approx(
            mean((a * FPS**3).norm() for a in third), rel=1e-5
        )


def distance_to_ball(point: torch.Tensor) -> float:
    """Signed, face by face: to the nearest of many points of each triangle."""
    grid = torch.linspace(0, 1, 25)
    u, v = (x.reshape(-1) for x in torch.meshgrid(grid, grid, indexing="ij"))
    u, v = u[u + v <= 1.0001], v[u + v <= 1.0001]
    a, b, c = FIELD.mesh.corners().unbind(1)
    spread = a[:, None] + u[:, None] * (b - a)[:, None] + v[:, None] * (c - a)[:, None]
    away = float((spread.reshape(-1, 3) - point).norm(dim=-1).min())
    outside = ((point - a) * FIELD.mesh.face_normals().float()).sum(-1).max() > 0
    return away if outside else -away


def test_depth_proximity_and_overlap_of_contact():
    ours, truth = points(6, 2), points(6, 3)
    slow = [[[distance_to_ball(p) for p in frame] for frame in verts] for verts in (ours, truth)]
    fast = [MovingSurface((FIELD,), *STILL).query(verts).distance for verts in (ours, truth)]
    for t in range(FRAMES):
        deepest = max(0.0, *(-d for d in slow[0][t]))
        # a tenth of a millimetre, the bound on depths
        assert float(penetration_depth(fast[0])[t]) == pytest.approx(deepest, abs=1e-4)
        off = mean(abs(abs(a) - abs(b)) for a, b in zip(slow[0][t], slow[1][t], strict=True))
        assert float(proximity_error(*fast)[t]) == pytest.approx(off, abs=1e-4)
    touching = [[abs(d) <= 0.02 for frame in verts for d in frame] for verts in slow]
    both = sum(a and b for a, b in zip(*touching, strict=True))
    either = sum(a or b for a, b in zip(*touching, strict=True))
    assert float(contact_iou(*fast, threshold=0.02)) == pytest.approx(both / either)


def test_motion_consistency():
    generator = torch.Generator().manual_seed(5)
    steps = 0.004 * torch.randn(FRAMES, 1, 3, generator=generator)
    steps[3] = 0
    translation = steps.cumsum(0)
    rotation = axis_angle_to_matrix(8 * translation)
    verts = points(6, 4) + translation
    surface = MovingSurface((FIELD,), rotation, translation)
    query = surface.query(verts)
    fast = motion_consistency(verts, query, surface)
    for t in range(FRAMES - 1):
        local = [rotation[t, 0].T @ (v - translation[t, 0]) for v in verts[t]]
        gaps = [abs(distance_to_ball(v)) for v in local]
        k = gaps.index(min(gaps))
        touched = rotation[t, 0].T @ (query.closest[t, k] - translation[t, 0])
        moved = rotation[t + 1, 0] @ touched + translation[t + 1, 0] - query.closest[t, k]
        if float(moved.norm()) <= 0.0003:
            assert math.isnan(float(fast[t]))
            continue
        hand = verts[t + 1, k] - verts[t, k]
        miss = (math.exp(-100 * gaps[k]) * hand - moved).square().sum()
        assert float(fast[t]) == pytest.approx(float(miss), rel=0.02)
    assert fast.isnan().tolist() == [False, False, True, False, False, False]
