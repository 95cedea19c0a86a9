import math
from dataclasses import replace

import pytest
import torch
import trimesh

from geneoh.geometry.distance import MovingSurface, SurfaceDistance
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.metrics.contact import TOUCH
from geneoh.metrics.report import (
    before_and_after,
    measure_posed,
    near_hand,
    over_shots,
    through_walls,
)
from geneoh.sequence import windows

CUBE = SurfaceDistance(from_trimesh(trimesh.creation.box((0.1, 0.1, 0.1))))
FRAMES = 6
STILL = MovingSurface((CUBE,), torch.eye(3).expand(FRAMES, 1, 3, 3), torch.zeros(FRAMES, 1, 3))


def measured(verts_of, joints, surface, fps, valid=None, **how):
    """`measure_posed` of a triangle, in all frames by default."""
    valid = torch.ones(len(joints), dtype=torch.bool) if valid is None else valid
    how = {"faces": torch.tensor([[0, 1, 2]]), **how}
    return measure_posed(verts_of, joints, surface, fps, valid, **how)


def hand(height: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Vertices, the lowest at this height, and keypoints; the index tip alone is near them."""
    above = torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 0.01], [0.0, 0.01, 0.05]])
    verts = above + height[:, None, None] * torch.tensor([0.0, 0.0, 1.0])
    joints = torch.zeros(len(height), 21, 3) + torch.tensor([0.0, 0.0, 1.0])
    joints[:, 8] = verts[:, 0]
    return verts, joints


def test_a_hand_that_sinks_by_a_millimetre_a_frame_is_reported_so():
    verts, joints = hand(0.052 - 0.001 * torch.arange(FRAMES))
    found, _ = measured(verts.__getitem__, joints, STILL, fps=30.0)
    assert found.frames == FRAMES
    assert found.penetration_max_mm == pytest.approx(3, abs=1e-3)
    assert found.penetration_mean_mm == pytest.approx(1, abs=1e-3)
    assert found.contact_fraction == 1.0
    assert found.fingers_in_contact == 1.0
    assert found.acceleration_mm == pytest.approx(0, abs=1e-3)
    assert math.isnan(found.consistency_mm2)


def test_acceleration_is_in_millimetres_a_frame_squared_at_any_frame_rate():
    verts, joints = hand(torch.full((FRAMES,), 0.052))
    joints = joints + 0.002 * torch.arange(FRAMES)[:, None, None] ** 2 * torch.eye(3)[0]
    for fps in (30.0, 120.0):
        found, _ = measured(verts.__getitem__, joints, STILL, fps=fps)
        assert found.acceleration_mm == pytest.approx(4, rel=1e-3)


def test_frames_that_were_not_observed_change_nothing():
    verts, joints = hand(0.052 - 0.001 * torch.arange(FRAMES))
    valid = torch.tensor([True, True, True, True, False, False])
    broken, lost = verts.clone(), joints.clone()
    broken[~valid], lost[~valid] = torch.nan, torch.nan
    found, _ = measured(broken.__getitem__, lost, STILL, fps=30.0, valid=valid)
    expected, _ = measured(verts[:4].__getitem__, joints[:4], STILL.at(slice(4)), fps=30.0)
    assert str(found) == str(expected)


def test_one_frame_can_be_measured():
    verts, joints = hand(torch.tensor([0.045]))
    found, _ = measured(verts.__getitem__, joints, STILL.at(slice(1)), fps=30.0)
    assert found.penetration_max_mm == pytest.approx(5, abs=1e-3)
    assert math.isnan(found.acceleration_mm)


def test_no_valid_frame_is_all_unknown():
    verts, joints = hand(torch.full((FRAMES,), 0.05))
    found, _ = measured(
        verts.__getitem__, joints, STILL, fps=30.0, valid=torch.zeros(FRAMES, dtype=torch.bool)
    )
    assert found.frames == 0
    assert math.isnan(found.penetration_max_mm)


def test_carried_object_is_consistent_and_a_sliding_one_is_not():
    verts, joints = hand(torch.full((FRAMES,), 0.05))
    path = torch.zeros(FRAMES, 1, 3)
    path[:, 0, 0] = 0.003 * torch.arange(FRAMES)
    moving = replace(STILL, translation=path)
    carried, _ = measured((verts + path).__getitem__, joints + path, moving, fps=30.0)
    assert carried.consistency_mm2 == pytest.approx(0, abs=1e-6)
    sliding, _ = measured(verts.__getitem__, joints, moving, fps=30.0)
    assert sliding.consistency_mm2 == pytest.approx(9, rel=1e-3)


def test_before_and_after_stand_in_one_line_each():
    verts, joints = hand(torch.full((FRAMES,), 0.045))
    before, _ = measured(verts.__getitem__, joints, STILL, fps=30.0)
    lines = before_and_after(before, replace(before, penetration_mean_mm=0.25))
    assert len(lines) == 6
    assert lines[0].split() == ["penetration", "depth,", "mean", "5.00", "->", "0.25", "mm"]
    assert lines[2].endswith("100.0 ->    100.0 %")
    assert lines[5].split()[-4:-1] == ["n/a", "->", "n/a"]


def test_fingers_of_shots_count_by_the_frames_with_contact():
    verts, joints = hand(torch.full((FRAMES,), 0.045))
    whole, _ = measured(verts.__getitem__, joints, STILL, fps=30.0)
    one = replace(whole, contact_fraction=0.1, fingers_in_contact=5.0, penetration_mean_mm=1.0)
    other = replace(whole, contact_fraction=0.9, fingers_in_contact=1.0, penetration_mean_mm=2.0)
    found = over_shots([one, other])
    assert found.fingers_in_contact == pytest.approx(1.4)
    assert found.contact_fraction == pytest.approx(0.5)
    assert found.penetration_mean_mm == pytest.approx(1.5)
    assert found.frames == 2 * FRAMES


def test_a_report_is_plain_numbers():
    verts, joints = hand(torch.full((FRAMES,), 0.045))
    report, _ = measured(verts.__getitem__, joints, STILL, fps=30.0)
    assert all(type(value) in (int, float) for value in report.as_dict().values())


@pytest.mark.parametrize("gap", [-0.02, -0.001, 0.004, 0.03, 0.4, 5.0])
def test_the_nearest_vertex_is_exact_however_far_the_hand_is(gap):
    ball = SurfaceDistance(from_trimesh(trimesh.creation.icosphere(3, 0.05)))
    surface = replace(STILL, fields=(ball,))
    aside = torch.nn.functional.normalize(
        torch.tensor([[1.0, 1, 1], [1, 1, 0.5], [1, 0, 0]]), dim=1
    )
    verts = aside * (0.05 + gap + torch.tensor([0.0, 0.005, 0.01]))[:, None]
    verts = verts.expand(FRAMES, 3, 3)
    found, exact = near_hand(surface, verts), surface.query(verts)
    least, index = exact.distance.abs().min(-1)
    torch.testing.assert_close(found.distance.abs().min(-1).values, least)
    assert torch.equal(found.distance.abs().argmin(-1), index)
    at = index[:, None, None].expand(-1, 1, 3)
    torch.testing.assert_close(found.closest.gather(1, at), exact.closest.gather(1, at))
    assert torch.equal(found.distance <= TOUCH, exact.distance <= TOUCH)


def test_a_long_track_is_measured_in_blocks_as_in_one(monkeypatch):
    verts, joints = hand(0.052 - 0.001 * torch.arange(FRAMES))
    path = torch.zeros(FRAMES, 1, 3)
    path[:, 0, 0] = 0.003 * torch.arange(FRAMES) ** 2
    moving = replace(STILL, translation=path)
    whole, _ = measured(verts.__getitem__, joints + path, moving, fps=30.0)
    monkeypatch.setattr(windows, "BLOCK", 4)
    in_blocks, _ = measured(verts.__getitem__, joints + path, moving, fps=30.0)
    assert str(in_blocks) == str(whole)


def test_a_hand_in_a_plate_is_told_where_depth_is_half_a_millimetre():
    ball = from_trimesh(trimesh.creation.icosphere(3, 0.03))
    plate = SurfaceDistance(from_trimesh(trimesh.creation.box((0.2, 0.2, 0.001))))
    away = torch.zeros(FRAMES, 1, 3)
    away[:2, :, 2] = 0.04
    verts, joints = ball.verts + away, torch.zeros(FRAMES, 21, 3)
    found, _ = measured(
        verts.__getitem__, joints, replace(STILL, fields=(plate,)), fps=30.0, faces=ball.faces
    )
    assert found.penetration_max_mm < 0.51
    assert found.through_fraction == pytest.approx(4 / 6)
    seldom = replace(found, through_fraction=1 / 300)
    assert "in 0.33% of the frames, in the input in 66.7%" in next(through_walls(found, seldom))
    assert not list(through_walls(found, replace(found, through_fraction=0.0)))
