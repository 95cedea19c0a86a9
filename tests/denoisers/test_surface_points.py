from dataclasses import replace

import torch
from draws import seeded
from short_clips import example

from geneoh.denoisers.surface_points import (
    FEWEST_POINTS,
    REACH,
    SURFACE_POINTS,
    spread_points,
    surface_points,
)
from tools.noisy_objects.clips import large


def test_points_are_spread_over_all_of_a_small_object():
    clip = example()
    surface, joints = clip.object.surface(), clip.hands[0].joints
    (found,) = surface_points(surface, joints, generator=seeded())
    (spread,) = spread_points(surface, SURFACE_POINTS, seeded())
    assert found.points.equal(spread.points)
    assert found.normals.equal(spread.normals)


def test_points_of_a_large_object_are_where_the_hand_is():
    clip = example()
    wide = large(clip).object.surface()
    (found,) = surface_points(wide, clip.hands[0].joints, generator=seeded())
    assert 0.9 * SURFACE_POINTS <= len(found.points) <= 1.1 * SURFACE_POINTS

    def nearest(points: torch.Tensor) -> torch.Tensor:
        """Least distance of each keypoint of each frame to the points, metres."""
        return torch.cdist(clip.object.seen_from(0, clip.hands[0].joints).flatten(0, 1), points)

    assert float(nearest(found.points).amin(0).max()) <= REACH + 1e-4
    (small,) = surface_points(clip.object.surface(), clip.hands[0].joints, generator=seeded())
    (spread,) = spread_points(wide, SURFACE_POINTS, seeded())
    away = [float(nearest(p.points).amin(1).mean()) for p in (small, found, spread)]
    assert away[1] < away[0] + 0.002
    assert away[2] > away[0] + 0.01  # spread over all of it


def test_a_part_out_of_reach_has_its_nearest_points():
    clip = example()
    motion = clip.object
    far = motion.translation + torch.tensor([0.0, 3.0, 0.0])
    parts = replace(
        motion,
        meshes=(*motion.meshes, *large(clip).object.meshes),
        rotation=motion.rotation.expand(-1, 2, 3, 3),
        translation=torch.cat([motion.translation, far], dim=1),
    )
    near, apart = surface_points(parts.surface(), clip.hands[0].joints, generator=seeded())
    assert len(near.points) > 0.9 * SURFACE_POINTS
    assert len(apart.points) == FEWEST_POINTS
