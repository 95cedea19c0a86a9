import math
from dataclasses import replace

import pytest
import torch
import trimesh
from torch import Tensor

from geneoh.fitting.contact_planes import Nearby, contact_planes, planes_apart, way_out
from geneoh.fitting.fit import (
    fit_hand,
    fit_keypoints,
    possible_start,
    start_from_keypoints,
    steadiness_weight,
)
from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.terms import HandState
from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.distance import MovingSurface, SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.model import ShapedHand
from geneoh.metrics.contact import depth_between
from geneoh.sequence import windows

FRAMES = 4


def joints_of(state: HandState, shaped: ShapedHand) -> Tensor:
    return shaped.joints_from_rotations(state.rotations, state.wrist)


def ones(target: Tensor) -> Tensor:
    return torch.ones_like(target[..., 0])


def error(state: HandState, shaped: ShapedHand, target: Tensor) -> float:
    return float((joints_of(state, shaped) - target).norm(dim=-1).mean())


def jolted(state: HandState, seed: int = 0) -> HandState:
    """Every joint off by some 0.2 rad per axis and the wrist by some 2 cm."""
    generator = torch.Generator().manual_seed(seed)
    step = torch.randn(*state.wrist.shape[:-1], 51, generator=generator)
    return state.moved(step * torch.tensor([0.2] * 48 + [0.02] * 3))


def test_the_keypoint_start_lays_the_palm_on_its_keypoints(hand, shaped, make_state):
    state = make_state(samples=2, frames=2)
    target = joints_of(state, shaped)
    start = start_from_keypoints(target, shaped)
    torch.testing.assert_close(
        start.rotations[..., 0, :, :], state.rotations[..., 0, :, :], atol=1e-4, rtol=0
    )
    torch.testing.assert_close(start.wrist, state.wrist)
    relaxed = axis_angle_to_matrix(hand.pose_mean[1:])
    torch.testing.assert_close(start.rotations[1, 1, 1:], relaxed)


def test_a_frame_that_no_hand_reaches_holds_back_no_other_frame(shaped, make_state):
    target = joints_of(make_state(frames=8), shaped)
    generator = torch.Generator().manual_seed(0)
    target[:, 3] += 0.05 * torch.randn(21, 3, generator=generator)
    others = torch.arange(8) != 3
    fitted = joints_of(fit_keypoints(target, ones(target), shaped), shaped)
    assert (fitted - target)[:, others].norm(dim=-1).mean() < 0.0005


def test_a_known_pose_is_recovered_from_its_keypoints(shaped, make_state):
    target = joints_of(make_state(frames=FRAMES), shaped)
    start = start_from_keypoints(target, shaped)
    fitted = fit_hand(target, ones(target), shaped, start, config=FitConfig())
    assert error(start, shaped, target) > 0.005
    assert error(fitted, shaped, target) < 0.0005


def test_a_known_pose_is_recovered_from_a_noisy_start(shaped, make_state):
    state = make_state(frames=FRAMES, seed=1)
    target, start = joints_of(state, shaped), jolted(state)
    fitted = fit_hand(target, ones(target), shaped, start, config=FitConfig())
    assert error(start, shaped, target) > 0.02
    assert error(fitted, shaped, target) < 0.0005


def test_a_finger_that_starts_nearly_turned_around_is_led_back(shaped):
    """A tracker that loses a finger for a frame answers with any turn of its joints."""
    model = shaped.model
    rotations = axis_angle_to_matrix(model.pose_mean.expand(1, 8, 16, 3))
    state = HandState(rotations, torch.zeros(1, 8, 3))
    target, turned = joints_of(state, shaped), rotations.clone()
    finger = torch.tensor([[-0.7, 1.3, 2.2], [-0.1, 0.1, -2.6], [-2.0, 1.5, -0.6]])
    turned[:, 3, 4:7] = axis_angle_to_matrix(finger)
    start = replace(state, rotations=turned)
    fitted = fit_hand(target, ones(target), shaped, start, config=FitConfig())
    pose = fitted.pose[..., 1:, :]
    over = torch.maximum(pose - model.pose_high[1:], model.pose_low[1:] - pose)
    assert float(over.max()) < 0.1
    assert error(fitted, shaped, target) < 0.001


def test_a_joint_that_is_impossible_in_all_frames_starts_relaxed(shaped, make_state):
    state, model = make_state(frames=FRAMES), shaped.model
    turned = state.rotations.clone()
    turned[:, :, 5] = axis_angle_to_matrix(torch.tensor([-0.1, 0.1, -2.6]))
    start = possible_start(replace(state, rotations=turned), model)
    torch.testing.assert_close(start.pose[0, :, 5], model.pose_mean[5].expand(FRAMES, 3))
    assert torch.equal(start.rotations[:, :, :5], state.rotations[:, :, :5])


def test_a_start_that_can_be_is_kept(shaped, make_state):
    state = make_state(samples=2, frames=FRAMES)
    assert possible_start(state, shaped.model) is state


def test_one_frame_can_be_fitted(shaped, make_state):
    target = joints_of(make_state(frames=1), shaped)
    start = start_from_keypoints(target, shaped)
    fitted = fit_hand(target, ones(target), shaped, start, config=FitConfig())
    assert error(fitted, shaped, target) < 0.0005


def test_samples_are_fitted_independently_of_the_batch(shaped, make_state):
    state = make_state(samples=2, frames=2)
    target, start = joints_of(state, shaped), jolted(state)
    whole = fit_hand(target, ones(target), shaped, start, config=FitConfig())
    for i in range(2):
        pick = slice(i, i + 1)
        one = HandState(start.rotations[pick], start.wrist[pick])
        alone = fit_hand(target[pick], ones(target[pick]), shaped, one, config=FitConfig())
        torch.testing.assert_close(
            joints_of(alone, shaped), joints_of(whole, shaped)[pick], atol=2e-5, rtol=0
        )


def test_rotations_stay_rotations(shaped, make_state):
    state = make_state(frames=2)
    target = joints_of(state, shaped)
    fitted = fit_hand(target, ones(target), shaped, jolted(state), config=FitConfig())
    square = fitted.rotations @ fitted.rotations.mT
    torch.testing.assert_close(square, torch.eye(3).expand_as(square), atol=1e-5, rtol=0)


def test_a_frame_without_trust_is_filled_from_its_neighbours(shaped, make_state):
    state = make_state(frames=5, seed=2)
    target, trust = joints_of(state, shaped), torch.ones(1, 5, 21)
    trust[:, 2] = 0
    start = jolted(state)
    wrist = state.wrist.clone()  # as the gap was filled: a straight line
    start = replace(start, wrist=wrist)
    wild = target.clone()
    wild[:, 2] += 0.3
    config = replace(FitConfig(), prior=0.02)
    fitted = fit_hand(wild, trust, shaped, start, config=config)
    assert error(fitted, shaped, target) < 0.002
    turn = matrix_to_axis_angle(fitted.rotations[:, :-1].mT @ fitted.rotations[:, 1:])
    # a jolt of 0.2 rad per axis was in the start
    assert float(turn.norm(dim=-1).max()) < 0.1
    torch.testing.assert_close(fitted.wrist[:, 2], wrist[:, 2], atol=1e-5, rtol=0)


def test_a_keypoint_without_trust_does_not_pull(shaped, make_state):
    state = make_state(frames=2)
    target = joints_of(state, shaped)
    trust, wild = torch.ones(1, 2, 21), target.clone()
    trust[..., 8], wild[..., 8, :] = 0, 1.0
    start = start_from_keypoints(target, shaped)
    fitted = fit_hand(wild, trust, shaped, start, config=FitConfig())
    off = (joints_of(fitted, shaped) - target).norm(dim=-1)
    off[..., 8] = 0
    assert float(off.mean()) < 0.0005


def test_steady_fits_follow_jitter_less(shaped, make_state):
    target = joints_of(make_state(frames=12, seed=3), shaped)
    noise = torch.randn(target.shape, generator=torch.Generator().manual_seed(0))
    noisy = target + 0.005 * noise
    start = start_from_keypoints(noisy, shaped)
    jitter = []
    for steady in (0.0, 8.0):
        config = FitConfig(steady_finger=steady, steady_wrist=steady)
        fitted = fit_hand(noisy, ones(noisy), shaped, start, config=config)
        jitter.append(float(fitted.rotations.diff(n=2, dim=1).square().mean()))
    assert jitter[1] < 0.3 * jitter[0]


def test_limits_hold_against_keypoints(shaped, make_state):
    """A finger asked to bend backwards by a radian stops near its limit."""
    model = shaped.model
    pose = model.pose_mean.expand(1, 1, 16, 3).clone()
    pose[..., 2, 2] = model.pose_low[2, 2] - 1.0
    target = joints_of(HandState(axis_angle_to_matrix(pose), torch.zeros(1, 1, 3)), shaped)
    start = start_from_keypoints(target, shaped)
    fitted = fit_hand(target, ones(target), shaped, start, config=FitConfig())
    beyond = torch.maximum(model.pose_low - fitted.pose, fitted.pose - model.pose_high)
    assert float(beyond[..., 1:, :].max()) < 0.35


@pytest.fixture(scope="module")
def ball():
    """A ball of 4 cm radius as a field."""
    return field_of(trimesh.creation.icosphere(3, 0.04))


def field_of(shape: trimesh.Trimesh) -> SurfaceDistance:
    verts = torch.tensor(shape.vertices, dtype=torch.float32)
    return SurfaceDistance(Mesh(verts, torch.tensor(shape.faces, dtype=torch.int64)))


def surface_of(ball: SurfaceDistance, center: Tensor, frames: int = 2) -> MovingSurface:
    """The ball standing at a place (3,)."""
    turn = torch.eye(3).expand(frames, 1, 3, 3)
    return MovingSurface((ball,), turn, center.expand(frames, 1, 3), within=0.02)


def sunk(shaped: ShapedHand, make_state) -> tuple[HandState, Tensor]:
    """A hand over two frames and the place of a ball that its fingers have sunk into."""
    state = make_state(frames=2, seed=4)
    joints = joints_of(state, shaped)
    palm = torch.linalg.cross(
        joints[..., 5, :] - joints[..., 0, :], joints[..., 17, :] - joints[..., 0, :]
    )
    down = torch.nn.functional.normalize(palm, dim=-1)
    tip = joints[0, 0, 8]
    inner = shaped.verts_from_rotations(state.rotations, state.wrist).verts[0, 0].mean(0)
    side = down[0, 0] * torch.sign((tip - inner) @ down[0, 0])
    return state, tip + 0.03 * side


def depth_of(state: HandState, shaped: ShapedHand, surface) -> Tensor:
    verts = shaped.verts_from_rotations(state.rotations, state.wrist).verts
    return (-surface.query(verts).distance).amax(-1).clamp(min=0)


def test_with_a_surface_the_hand_leaves_the_object(shaped, make_state, ball):
    state, center = sunk(shaped, make_state)
    surface, target = surface_of(ball, center), joints_of(state, shaped)
    before = depth_of(state, shaped, surface)
    fitted = fit_hand(target, ones(target), shaped, state, config=FitConfig(), surface=surface)
    after = depth_of(fitted, shaped, surface)
    assert float(before.min()) > 0.004
    assert bool((after < 0.4 * before).all())
    assert error(fitted, shaped, target) < float(before.max()), "no more than is needed"


def test_a_surface_out_of_reach_changes_nothing(shaped, make_state, ball):
    state = make_state(frames=2)
    target = joints_of(state, shaped)
    far = surface_of(ball, torch.tensor([2.0, 0.0, 0.0]))
    start = start_from_keypoints(target, shaped)
    with_it = fit_hand(target, ones(target), shaped, start, config=FitConfig(), surface=far)
    assert error(with_it, shaped, target) < 0.0005


def test_planes_stand_where_the_hand_is_inside_or_a_tip_nearly_touches(shaped, make_state, ball):
    state, center = sunk(shaped, make_state)
    config, surface = FitConfig(), surface_of(ball, center)
    planes = contact_planes(state, shaped, config, near=Nearby(surface, config.touch))
    verts = shaped.verts_from_rotations(state.rotations, state.wrist).verts
    distance = surface.query(verts).distance
    inside = (distance < 0).sum(-1)
    pushed = planes.weight > 0.9 / config.depth_std
    assert torch.equal(pushed.sum(-1), inside)
    assert bool((planes.weight.count_nonzero(-1) <= inside + 5).all())
    looked = distance.gather(-1, planes.verts)
    assert bool((looked[planes.weight == 0] >= 0).all())
    gap = (planes.closest - center).norm(dim=-1)[planes.weight > 0]
    torch.testing.assert_close(gap, torch.full_like(gap, 0.04), atol=4e-4, rtol=0)


def test_a_tip_that_nearly_touches_is_drawn_towards_the_surface(shaped, make_state, ball):
    state = make_state(frames=1, seed=5)
    verts = shaped.verts_from_rotations(state.rotations, state.wrist).verts[0, 0]
    tip = joints_of(state, shaped)[0, 0, 8]
    away = torch.nn.functional.normalize(tip - verts.mean(0), dim=-1)
    support = float(((verts - tip) @ away).max())
    center = tip + away * (0.04 + support + 0.0015)  # the ball is 1.5 mm or so from the finger
    surface, target = surface_of(ball, center, frames=1), joints_of(state, shaped)
    gap = float(surface.query(verts[None, None]).distance.min())
    assert 0 < gap < 0.003
    fitted = fit_hand(target, ones(target), shaped, state, config=FitConfig(), surface=surface)
    moved = shaped.verts_from_rotations(fitted.rotations, fitted.wrist).verts
    assert abs(float(surface.query(moved).distance.min())) < 0.8 * gap


def test_only_vertices_that_may_have_come_near_are_asked_for_again(shaped, make_state, ball):
    state, center = sunk(shaped, make_state)
    surface, asked = surface_of(ball, center), []

    class Counted(MovingSurface):
        def query(self, points):
            asked.append(int(points.isfinite().all(-1).sum()))
            return super().query(points)

    near = Nearby(Counted(surface.fields, surface.rotation, surface.translation), 0.003)
    verts = shaped.verts_from_rotations(state.rotations, state.wrist).verts
    for step in range(6):
        moved = verts + 0.002 * step * torch.tensor([0.6, 0.0, 0.8])
        got, want = near.query(moved), surface.query(moved)
        within = want.distance <= 0.003
        assert bool(within.any())
        torch.testing.assert_close(got.distance[within], want.distance[within])
        torch.testing.assert_close(got.closest[within], want.closest[within])
        assert bool((got.distance[~within] > 0.003).all())
    assert max(asked[1:]) < 0.6 * asked[0]


def test_a_phalanx_leaves_a_thin_plate_on_one_side(shaped, make_state):
    plate = field_of(trimesh.creation.box((0.2, 0.2, 0.006)))
    state = make_state(frames=1, seed=5)
    verts = shaped.verts_from_rotations(state.rotations, state.wrist).verts
    bone = shaped.model.skin_weights.argmax(-1)
    lowest = verts[0, 0, bone == 3, 2].min()
    center = torch.stack([*verts[0, 0, bone == 3, :2].mean(0), lowest + 0.0025])
    surface = MovingSurface((plate,), torch.eye(3).expand(1, 1, 3, 3), center[None, None])
    nearest = surface.query(verts)
    inside = (nearest.distance[0, 0] < 0) & (bone == 3)
    sides = nearest.normal[0, 0, inside, 2]
    assert sides.min() < 0 < sides.max(), "torn apart by the nearest side"
    found = way_out(verts, bone, surface, nearest)
    assert bool((found.normal[0, 0, inside, 2] > 0.99).all())
    height = found.closest[0, 0, inside, 2] - center[2]
    torch.testing.assert_close(height, torch.full_like(height, 0.003), atol=1e-5, rtol=0)
    other = nearest.distance[0, 0] >= 0
    torch.testing.assert_close(found.closest[0, 0, other], nearest.closest[0, 0, other])


def test_every_step_is_heard(shaped, make_state, ball):
    state, heard = make_state(frames=1), []
    target = joints_of(state, shaped)
    config = FitConfig(iterations=2, contact_rounds=1)
    surface = surface_of(ball, torch.tensor([2.0, 0.0, 0.0]), frames=1)
    fit_hand(
        target,
        ones(target),
        shaped,
        state,
        config=config,
        surface=surface,
        on_step=lambda *at: heard.append(at),
    )
    assert heard == [(i, 4) for i in range(1, 5)]


def test_the_wrist_position_is_left_to_the_keypoints():
    weight = steadiness_weight(FitConfig(steady_finger=2.0, steady_wrist=0.5))
    assert weight.tolist() == [0.5] * 3 + [2.0] * 45 + [0.0] * 3
    assert math.isclose(float(weight.sum()), 91.5)


def noisy_target(shaped: ShapedHand, make_state, frames: int) -> tuple[Tensor, HandState]:
    """Keypoints with 5 mm of noise, and a start from them."""
    state = make_state(frames=frames, spread=0.1)
    target = joints_of(state, shaped)
    target = target + 0.005 * torch.randn(target.shape, generator=torch.Generator().manual_seed(3))
    return target, start_from_keypoints(target, shaped)


def test_a_long_track_is_fitted_in_blocks_as_in_one(shaped, make_state, monkeypatch):
    target, start = noisy_target(shaped, make_state, 150)
    config = FitConfig(iterations=5)
    whole = fit_hand(target, ones(target), shaped, start, config=config)
    heard: list[tuple[int, int]] = []
    monkeypatch.setattr(windows, "BLOCK", 50)
    parts = fit_hand(
        *(target, ones(target), shaped, start), config=config, on_step=lambda *at: heard.append(at)
    )
    apart = (joints_of(parts, shaped) - joints_of(whole, shaped)).norm(dim=-1)
    assert float(apart.max()) < 0.0005
    assert heard == [(i, 15) for i in range(1, 16)]


def test_the_blocks_of_a_fit_leave_no_seam(shaped, make_state, monkeypatch):
    target, start = noisy_target(shaped, make_state, 150)
    monkeypatch.setattr(windows, "BLOCK", 50)
    fitted = fit_hand(target, ones(target), shaped, start, config=FitConfig(iterations=5))
    bends = joints_of(fitted, shaped)[0].diff(n=2, dim=0).norm(dim=-1).mean(-1)
    for cut in (50, 100):  # a value is made of its frame and the two after it
        assert bends[cut - 2 : cut].mean() < 1.5 * bends.mean()


def skin_of(state: HandState, shaped: ShapedHand) -> ChangingSurface:
    verts = shaped.verts_from_rotations(state.rotations[0], state.wrist[0]).verts
    return ChangingSurface(verts, shaped.model.faces)


def ball_at_a_fingertip(state: HandState, shaped: ShapedHand) -> ChangingSurface:
    """A ball of 3 cm, 8 mm of it beyond the tip of the index finger; in the last frame far off."""
    ball = trimesh.creation.icosphere(3, 0.03)
    joints = joints_of(state, shaped)[0]
    ahead = torch.nn.functional.normalize(joints[:, 8] - joints[:, 7], dim=-1)
    middle = joints[:, 8] + 0.022 * ahead
    middle[-1] += 1
    verts = torch.tensor(ball.vertices).float() + middle[:, None]
    return ChangingSurface(verts, torch.tensor(ball.faces))


def test_planes_of_another_hand_are_half_the_way_out_where_this_one_is_inside(shaped, make_state):
    state = make_state(frames=2)
    other = ball_at_a_fingertip(state, shaped)
    planes = planes_apart(state, shaped, FitConfig(), other=other)
    inside = planes.weight[0, 0] > 0
    verts = skin_of(state, shaped).verts[0, planes.verts[0, 0]]
    outside = verts + 2 * (planes.closest[0, 0] - verts)
    radius = (outside - other.verts[0].mean(0)).norm(dim=-1)[inside]
    assert len(radius) > 5
    torch.testing.assert_close(radius, torch.full_like(radius, 0.03), atol=3e-4, rtol=0)
    assert not planes.weight[0, 1].any()


def test_a_hand_goes_half_the_way_out_of_another_one(shaped, make_state):
    state = make_state(frames=FRAMES)
    target, other = joints_of(state, shaped), ball_at_a_fingertip(state, shaped)
    config = FitConfig(iterations=0, contact_rounds=1)
    left = fit_hand(target, ones(target), shaped, state, config=config, other=other)
    before, after = (depth_between(skin_of(each, shaped), other) for each in (state, left))
    assert (before[:-1] > 0.005).all()
    assert (after[:-1] < 0.8 * before[:-1]).all()
    assert (after[:-1] > 0.3 * before[:-1]).all()
