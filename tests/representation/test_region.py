from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from geneoh.representation.region import CONTACT_RADIUS, ContactRegion

seeds = st.integers(0, 1000)
few = settings(max_examples=10)  # every one of them a whole scene, or two
PARTS = pytest.mark.parametrize("parts", [1, 2])


def closest(scene, points: Tensor) -> Tensor:
    """Least distance of each world point (T, N, 3) to any keypoint in any frame, slowly."""
    frames = range(len(points))
    return torch.stack(
        [
            torch.stack([(p[t] - scene.joints[t]).norm(dim=-1).min() for t in frames]).min()
            for p in points.transpose(0, 1)
        ]
    )


def world_of(scene) -> Tensor:
    """All surface points in the world, slowly."""
    frames = range(len(scene.joints))
    return torch.stack(
        [
            torch.stack(
                [
                    scene.rotation[t, q] @ scene.points[i] + scene.translation[t, q]
                    for i, q in enumerate(scene.part.tolist())
                ]
            )
            for t in frames
        ]
    )


@few
@given(seeds)
def test_to_world_takes_canonical_points_back(make_scene, seed):
    scene = make_scene(seed)
    region = scene.region()
    back = region.to_world(region.to_canon(scene.joints))
    torch.testing.assert_close(back, scene.joints, atol=1e-6, rtol=0)


@PARTS
def test_the_frame_stands_at_the_mean_contact_point_turned_as_the_first_part(make_scene, parts):
    scene = make_scene(3, parts)
    region = scene.region()
    assert torch.equal(region.rotation, scene.rotation[:, 0])
    torch.testing.assert_close(region.center, region.points.mean(1))
    axis = region.center[:, None] + region.rotation[:, None, :, 0]
    torch.testing.assert_close(
        region.to_canon(axis)[:, 0], torch.tensor([1.0, 0, 0]).expand(len(axis), 3)
    )


def test_contact_points_of_a_rigid_object_stand_still_in_the_canonical_frame(make_scene):
    region = make_scene(4).region()
    for values in (region.points_canon, region.normals_canon):
        torch.testing.assert_close(values, values[:1].expand_as(values), atol=1e-6, rtol=0)


@PARTS
def test_surface_points_are_carried_by_their_part(make_scene, parts):
    scene = make_scene(5, parts)
    points, normals = scene.in_world()
    torch.testing.assert_close(points, world_of(scene))
    turned = replace(scene, points=scene.normals, translation=0 * scene.translation)
    torch.testing.assert_close(normals, world_of(turned))


@PARTS
def test_contact_points_are_surface_points_with_their_normals(make_scene, parts):
    scene = make_scene(6, parts)
    region, world = scene.region(), world_of(scene)
    apart = (region.points[:, :, None] - world[:, None]).norm(dim=-1).amax(0)
    assert float(apart.amin(1).max()) < 1e-6
    part = scene.part[apart.argmin(1)]
    turn = scene.rotation[:, part]
    normals = (turn @ scene.normals[apart.argmin(1)][..., None])[..., 0]
    torch.testing.assert_close(region.normals, normals)


def test_contact_points_are_within_reach_of_the_trajectory(make_scene):
    scene = make_scene(7)
    distance = closest(scene, world_of(scene))
    near = int((distance <= CONTACT_RADIUS).sum())
    assert near > 12, "the scene should offer more than are asked for"
    chosen = closest(scene, scene.region().points)
    assert float(chosen.max()) <= CONTACT_RADIUS
    torch.testing.assert_close(chosen.min(), distance.min())


@pytest.mark.parametrize("away", [0.3, 3.0])
def test_a_hand_far_away_gets_the_nearest_points(make_scene, away):
    scene = make_scene(8)
    scene = replace(scene, joints=scene.joints + torch.tensor([away, 0.0, 0.0]))
    region = scene.region()
    want = closest(scene, world_of(scene)).sort().values[:12]
    torch.testing.assert_close(closest(scene, region.points).sort().values, want)


@few
@given(seeds)
def test_contact_points_are_spread_over_all_that_are_near(make_scene, seed):
    """Farthest-point sampling: no near point is farther from a chosen one than they apart."""
    scene = make_scene(seed)
    world, region = world_of(scene), scene.region()
    distance = torch.cdist(world, scene.joints).amin(-1).amin(0)
    reach = torch.maximum(distance.kthvalue(12).values, torch.tensor(CONTACT_RADIUS))
    near = world[0][distance <= reach]
    chosen = region.points[0]
    apart = torch.cdist(chosen, chosen) + 9 * torch.eye(12)
    uncovered = torch.cdist(near, chosen).amin(1).max()
    assert float(uncovered) <= float(apart.min()) + 1e-6
    assert float(apart.min()) > 0


def test_the_order_of_surface_points_does_not_matter(make_scene):
    scene = make_scene(9)
    order = torch.randperm(len(scene.points), generator=torch.Generator().manual_seed(0))
    shuffled = replace(scene, points=scene.points[order], normals=scene.normals[order])
    assert torch.equal(scene.region().points, scene.region().points)
    torch.testing.assert_close(scene.region().points, shuffled.region().points)


def test_an_object_with_fewer_points_than_asked_for_gives_them_all(make_scene):
    scene = make_scene(10)
    few = replace(scene, points=scene.points[:4], normals=scene.normals[:4], part=scene.part[:4])
    region = few.region(count=6)
    assert region.points.shape == (5, 6, 3)
    apart = torch.cdist(world_of(few)[0], region.points[0])
    assert float(apart.amin(1).max()) < 1e-6


def test_frames_that_are_skipped_do_not_count(make_scene):
    scene = make_scene(11)
    joints = scene.joints + torch.tensor([0.3, 0.0, 0.0])
    near = joints.clone()
    near[1] = scene.joints[1]  # close, but in a frame that is not looked at
    every = [replace(scene, joints=j).region(every=4).points for j in (joints, near)]
    assert torch.equal(*every)
    assert not torch.equal(every[0], replace(scene, joints=near).region().points)


def test_nearest_keeps_the_nearest_points_and_the_frame(make_scene):
    scene = make_scene(12)
    region = scene.region()
    kept = region.nearest(scene.joints, 5)
    want = closest(scene, region.points).sort().values[:5]
    torch.testing.assert_close(closest(scene, kept.points).sort().values, want)
    assert torch.equal(kept.center, region.center)
    assert torch.equal(kept.rotation, region.rotation)
    for point, normal in zip(kept.points[0], kept.normals[0], strict=True):
        at = int((region.points[0] - point).norm(dim=-1).argmin())
        assert torch.equal(region.normals[0, at], normal)
    assert region.nearest(scene.joints, 99).points.shape == region.points.shape


@few
@given(seeds, seeds)
def test_canonical_hand_and_points_do_not_change_with_a_motion_of_the_scene(
    make_scene, make_rigid, seed, other
):
    scene = make_scene(seed)
    moved = scene.moved(make_rigid(other))
    here, there = scene.region(), moved.region()
    for a, b in (
        (here.to_canon(scene.joints), there.to_canon(moved.joints)),
        (here.points_canon, there.points_canon),
        (here.normals_canon, there.normals_canon),
    ):
        torch.testing.assert_close(a, b, atol=3e-6, rtol=0)


@pytest.mark.parametrize("seed", range(3))
def test_contact_points_do_not_depend_on_where_the_world_has_its_origin(make_scene, seed):
    scene, shift = make_scene(seed), torch.tensor([3.0, -2.0, 4.0])
    far = replace(scene, joints=scene.joints + shift, translation=scene.translation + shift)
    for here, there in (
        (scene.region(), far.region()),
        (scene.region().nearest(scene.joints, 4), far.region().nearest(far.joints, 4)),
    ):
        torch.testing.assert_close(here.points + shift, there.points, atol=2e-6, rtol=0)


def test_turning_the_frame_turns_canonical_points_only(make_scene, make_rigid):
    scene, turn = make_scene(13), make_rigid(0).rotation
    region = scene.region()
    turned = region.turned(turn)
    torch.testing.assert_close(
        turned.to_canon(scene.joints), region.to_canon(scene.joints) @ turn, atol=1e-6, rtol=0
    )
    torch.testing.assert_close(
        turned.to_world(turned.to_canon(scene.joints)), scene.joints, atol=1e-6, rtol=0
    )
    assert torch.equal(turned.points, region.points)


def test_a_batch_of_scenes_is_the_scenes_one_by_one(make_scene):
    scenes = [make_scene(seed, 2) for seed in (14, 15)]
    names = ("joints", "points", "normals", "part", "rotation", "translation")
    both = replace(
        scenes[0], **{n: torch.stack([getattr(scene, n) for scene in scenes]) for n in names}
    ).region()
    for i, scene in enumerate(scenes):
        alone = scene.region()
        for name in ContactRegion.__dataclass_fields__:
            torch.testing.assert_close(getattr(both, name)[i], getattr(alone, name))


def test_a_frame_held_still_keeps_the_points_and_the_worlds_axes(make_scene):
    region = make_scene(6).region()
    still = region.held_still()
    assert torch.equal(still.points, region.points)
    shift = region.center.mean(0)
    torch.testing.assert_close(still.to_canon(still.points), still.points - shift)
