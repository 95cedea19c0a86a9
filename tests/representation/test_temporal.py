from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from geneoh.representation.region import ContactRegion
from geneoh.representation.temporal import (
    DISTANCE_DECAY,
    NORMAL_GAIN,
    TANGENTIAL_GAIN,
    TemporalRelations,
    encode_temporal,
    places_by_distance,
)

FPS = 30.0
seeds = st.integers(0, 1000)
few = settings(max_examples=10)  # every one of them a whole scene, or two


def slow_relation(
    joints: Tensor, region: ContactRegion, fps: float, t: int, k: int, j: int
) -> dict[str, Tensor]:
    """Equation (1) for one frame pair, contact point and keypoint, in float64."""
    turn = region.rotation[t].double().T
    here, there = (region.points[i, k].double() for i in (t, t + 1))
    hand, later = (joints[i, j].double() for i in (t, t + 1))
    normal = turn @ region.normals[t, k].double()
    object_velocity = turn @ (there - here) * fps
    velocity = turn @ (later - hand) * fps - object_velocity
    along = (velocity @ normal) * normal
    distance = (hand - here).norm()
    near = torch.exp(-DISTANCE_DECAY * distance)
    return {
        "distance": distance,
        "velocity": velocity,
        "tangential": near * TANGENTIAL_GAIN * (velocity - along).norm(),
        "normal": near * NORMAL_GAIN * along.norm(),
        "object_velocity": object_velocity,
        "normals": normal,
    }


def hands_of(
    relations: TemporalRelations, first: Tensor, region: ContactRegion, fps: float
) -> Tensor:
    """World keypoints from T and the first frame: h - o = (h_1 - o_1) + sum of v_ho dt for every
    contact point o, and the mean over them."""
    turn = region.rotation[:-1, None]
    steps = relations.velocity @ turn.mT / fps
    start = first - region.points[:1, :, None]
    offsets = torch.cat([start, start + steps.cumsum(0)])
    return (offsets + region.points[:, :, None]).mean(1)


@pytest.mark.parametrize("parts", [1, 2])
def test_relations_are_those_of_equation_1(make_scene, parts):
    scene = make_scene(1, parts)
    region = scene.region()
    relations = encode_temporal(scene.joints, region, FPS)
    for t, k, j in [(0, 0, 0), (1, 11, 20), (3, 4, 9), (2, 7, 13)]:
        for name, want in slow_relation(scene.joints, region, FPS, t, k, j).items():
            at = (t, k) if name in ("object_velocity", "normals") else (t, k, j)
            got = getattr(relations, name)[at].double()
            torch.testing.assert_close(got, want, rtol=1e-4, atol=1e-5)


@few
@given(seeds, st.integers(1, 2))
def test_relations_and_the_first_frame_give_the_hand(make_scene, seed, parts):
    """Claim 1 of appendix A.2; random frames 3 cm apart are rough motion."""
    scene = make_scene(seed, parts)
    region = scene.region()
    relations = encode_temporal(scene.joints, region, FPS)
    back = hands_of(relations, scene.joints[0], region, FPS)
    torch.testing.assert_close(back, scene.joints, atol=1e-5, rtol=0)


@few
@given(seeds, seeds)
def test_temporal_relations_do_not_change_with_a_motion_of_the_scene(
    make_scene, make_rigid, seed, other
):
    scene = make_scene(seed)
    moved = scene.moved(make_rigid(other))
    here, there = (encode_temporal(s.joints, s.region(), FPS) for s in (scene, moved))
    for name in TemporalRelations.__dataclass_fields__:
        tolerance = 1e-5 if name in ("distance", "normals") else 2e-4
        torch.testing.assert_close(
            getattr(here, name), getattr(there, name), atol=tolerance, rtol=0
        )


def test_a_hand_carried_without_turning_has_no_relative_velocity(make_scene):
    scene = make_scene(2)
    scene = replace(scene, rotation=scene.rotation[:1].expand_as(scene.rotation))
    joints = scene.joints[:1] - scene.translation[:1] + scene.translation
    relations = encode_temporal(joints, scene.region(), FPS)
    assert float(relations.object_velocity.norm(dim=-1).min()) > 0.1
    for values in (relations.velocity, relations.tangential, relations.normal):
        assert float(values.abs().max()) < 1e-4


def test_a_keypoint_carried_at_a_contact_point_has_no_velocity_against_it(make_scene):
    scene = make_scene(3)
    region = scene.region()
    joints = region.points[:, :1].expand(-1, 21, -1)  # all at the first contact point
    relations = encode_temporal(joints, region, FPS)
    assert float(relations.velocity[:, 0].abs().max()) < 1e-5
    assert float(relations.velocity[:, 1:].norm(dim=-1).max()) > 0.1, "the object turns"


def test_a_slide_along_the_surface_is_tangential_and_a_lift_is_normal(make_scene):
    scene = make_scene(4)
    still = replace(
        scene,
        rotation=scene.rotation[:1].expand_as(scene.rotation),
        translation=scene.translation[:1].expand_as(scene.translation),
    )
    region = still.region()
    point, normal = region.points[0, 0], region.normals[0, 0]
    tangent = torch.nn.functional.normalize(
        torch.linalg.cross(normal, torch.tensor([0.3, -0.5, 0.8])), dim=-1
    )
    time = torch.arange(5.0)[:, None, None]
    for way, big, small in (
        (tangent, "tangential", "normal"),
        (normal, "normal", "tangential"),
    ):
        joints = (point + 0.001 * time * way).expand(-1, 21, -1)
        relations = encode_temporal(joints, region, FPS)
        # 1 mm a frame at 30 frames a second; at the start it is on the point
        assert float(getattr(relations, big)[0, 0, 0]) == pytest.approx(0.03, rel=1e-3)
        assert float(getattr(relations, small)[0, 0, 0]) < 1e-3


def test_velocities_scale_with_the_frame_rate_and_distances_do_not(make_scene):
    scene = make_scene(5)
    region = scene.region()
    slow, fast = (encode_temporal(scene.joints, region, fps) for fps in (30.0, 60.0))
    torch.testing.assert_close(fast.velocity, 2 * slow.velocity)
    torch.testing.assert_close(fast.tangential, 2 * slow.tangential)
    assert torch.equal(fast.distance, slow.distance)


def test_two_frames_are_one_pair(make_scene):
    scene = make_scene(6, frames=2)
    region = scene.region()
    relations = encode_temporal(scene.joints, region, FPS)
    assert relations.velocity.shape == (1, 12, 21, 3)
    back = hands_of(relations, scene.joints[0], region, FPS)
    torch.testing.assert_close(back, scene.joints, atol=1e-6, rtol=0)


def test_gradients_stay_finite_where_nothing_moves(make_scene):
    scene = make_scene(7)
    joints = scene.region().points[:, :1].repeat(1, 21, 1).requires_grad_(True)
    relations = encode_temporal(joints, scene.region(), FPS)
    sum(getattr(relations, n).sum() for n in TemporalRelations.__dataclass_fields__).backward()
    assert bool(joints.grad.isfinite().all())


def test_distances_from_a_few_points_tell_where_keypoints_are():
    draw = torch.Generator().manual_seed(0)
    points = 0.02 * torch.randn(4, 12, 3, generator=draw)
    joints = 0.05 * torch.randn(4, 21, 3, generator=draw) + torch.tensor([0.3, 0.0, -0.1])
    distance = (joints[:, None] - points[:, :, None]).norm(dim=-1)
    torch.testing.assert_close(places_by_distance(distance, points), joints, atol=1e-3, rtol=0)
    # points of a plane know the place along it, and set it to the plane
    flat = points * torch.tensor([1.0, 1.0, 0.0])
    distance = (joints[:, None] - flat[:, :, None]).norm(dim=-1)
    wanted = joints * torch.tensor([1.0, 1.0, 0.0])
    torch.testing.assert_close(places_by_distance(distance, flat), wanted, atol=1e-3, rtol=0)
