from dataclasses import fields, replace

import pytest
import torch
from torch import Tensor

from geneoh.fitting.terms import (
    MOST_OVERLAPS,
    UNKNOWNS,
    Equations,
    HandState,
    Planes,
    finger_term,
    keypoint_term,
    moving_keypoints,
    pose_term,
    steadiness,
    surface_term,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.model import ShapedHand
from geneoh.hand.spheres import finger_clearance, hand_scale, hand_spheres


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def exact(state: HandState) -> HandState:
    """The state in float64, its rotations orthonormal to the last digit."""
    return HandState(axis_angle_to_matrix(state.pose.double()), state.wrist.double())


def half_slope(energy, state: HandState) -> Tensor:
    """Half the gradient of an energy of a state in the increments of its unknowns."""
    step = torch.zeros(*state.wrist.shape[:-1], UNKNOWNS, dtype=state.wrist.dtype)
    step.requires_grad_(True)
    (gradient,) = torch.autograd.grad(energy(state.moved(step)).sum(), step)
    return gradient / 2


@pytest.fixture(scope="module")
def plain(shaped, double):
    """A hand without pose correctives, in float64."""
    model = replace(shaped.model, pose_dirs=torch.zeros_like(shaped.model.pose_dirs))
    return double(replace(shaped, model=model))


@pytest.fixture(scope="module")
def state(make_state):
    return exact(make_state(samples=2, frames=3))


@pytest.fixture(scope="module")
def planes(state, plain):
    """Planes a centimetre or so from vertices of all over the hand; one is switched off."""
    verts = torch.randint(0, 778, (2, 3, 6), generator=torch.Generator().manual_seed(1))
    at = plain.verts_from_rotations(state.rotations, state.wrist).verts
    closest = at.gather(-2, verts[..., None].expand(2, 3, 6, 3)) + 0.01 * normal(2, 3, 6, 3)
    normals = torch.nn.functional.normalize(normal(2, 3, 6, 3, seed=2), dim=-1)
    weight = torch.full((2, 3, 6), 500.0, dtype=torch.float64)
    weight[..., 5] = 0
    return Planes(verts, closest, normals, weight)


def test_keypoints_pull_by_the_gradient_of_their_squared_distance(state, plain):
    joints = plain.joints_from_rotations(state.rotations, state.wrist)
    target = joints + 0.01 * normal(2, 3, 21, 3)
    weight = 300 * normal(2, 3, 21, seed=3).abs()

    def energy(at: HandState) -> Tensor:
        off = plain.joints_from_rotations(at.rotations, at.wrist) - target
        return (weight * off.norm(dim=-1)).square().sum(-1)

    found = keypoint_term(moving_keypoints(state, plain), target, weight)
    torch.testing.assert_close(found.energy, energy(state))
    torch.testing.assert_close(found.gradient, half_slope(energy, state))


def at_planes(state: HandState, shaped: ShapedHand, planes: Planes) -> Equations:
    return surface_term(state, shaped, moving_keypoints(state, shaped), planes)


def test_planes_pull_by_the_gradient_of_the_squared_height(state, plain, planes):
    def energy(at: HandState) -> Tensor:
        verts = plain.verts_from_rotations(at.rotations, at.wrist).verts
        off = verts.gather(-2, planes.verts[..., None].expand(2, 3, 6, 3)) - planes.closest
        return ((off * planes.normal).sum(-1) * planes.weight).square().sum(-1)

    found = at_planes(state, plain, planes)
    torch.testing.assert_close(found.energy, energy(state))
    # skinning weights were written in float32: they sum to one to its last digit
    torch.testing.assert_close(found.gradient, half_slope(energy, state), rtol=1e-5, atol=1e-3)


def test_planes_see_the_vertices_with_their_pose_correctives(state, plain, planes):
    bulges = 0.002 * normal(*plain.model.pose_dirs.shape, seed=4)
    bulged = replace(plain, model=replace(plain.model, pose_dirs=bulges))
    verts = bulged.verts_from_rotations(state.rotations, state.wrist).verts
    at = verts.gather(-2, planes.verts[..., None].expand(2, 3, 6, 3))
    found = at_planes(state, bulged, replace(planes, closest=at))
    assert float(found.energy.max()) < 1e-12
    assert float(at_planes(state, plain, replace(planes, closest=at)).energy.min()) > 0.1


@pytest.fixture(scope="module")
def crossed(state) -> HandState:
    """Hands whose index and middle finger are turned into each other."""
    pose = state.pose.clone()
    pose[..., 1:, :] = 0
    pose[..., 1, 1], pose[..., 4, 1] = 0.35, -0.3
    return exact(replace(state, rotations=axis_angle_to_matrix(pose)))


def test_fingers_in_each_other_are_pushed_by_the_gradient_of_their_overlap(crossed, plain):
    def deepest(at: HandState) -> Tensor:
        spheres = hand_spheres(at.joints(plain), hand_scale(plain.offsets))
        return (-finger_clearance(*spheres)).clamp(min=0).topk(MOST_OVERLAPS).values

    assert float(deepest(crossed).amax(-1).min()) > 0.003
    found = finger_term(moving_keypoints(crossed, plain), plain, 500.0)
    torch.testing.assert_close(found.energy, (500 * deepest(crossed)).square().sum(-1))
    slope = half_slope(lambda at: (500 * deepest(at)).square().sum(-1), crossed)
    # the places of the spheres along the bones are those of float32
    torch.testing.assert_close(found.gradient, slope, rtol=1e-5, atol=1e-4)


def test_fingers_that_are_apart_are_not_pushed(state, plain):
    flat = replace(state, rotations=torch.eye(3, dtype=torch.float64).expand(2, 3, 16, 3, 3))
    assert not bool(finger_term(moving_keypoints(flat, plain), plain, 500.0).energy.any())


def test_matrices_are_those_of_gauss_and_newton(state, plain, planes):
    """Where all residuals are zero, the gradient grows along any increment by matrix times it."""
    joints = plain.joints_from_rotations(state.rotations, state.wrist)
    verts = plain.verts_from_rotations(state.rotations, state.wrist).verts
    on = replace(planes, closest=verts.gather(-2, planes.verts[..., None].expand(2, 3, 6, 3)))
    weight = 300 * normal(2, 3, 21, seed=3).abs()
    terms = (
        lambda at: keypoint_term(moving_keypoints(at, plain), joints, weight),
        lambda at: at_planes(at, plain, on),
    )
    step = 1e-6 * normal(2, 3, UNKNOWNS, seed=5)
    for term in terms:
        grown = (term(state.moved(step)).gradient - term(state.moved(-step)).gradient) / 2
        want = (term(state).matrix @ step[..., None])[..., 0]
        torch.testing.assert_close(grown, want, rtol=1e-5, atol=1e-7)


def test_the_prior_and_the_limits_pull_by_their_gradient_at_the_flat_hand(make_state, hand, double):
    model = double(hand)
    flat = torch.eye(3, dtype=torch.float64).expand(1, 2, 16, 3, 3)
    state = HandState(flat, torch.zeros(1, 2, 3, dtype=torch.float64))
    # limits that the flat hand oversteps on both sides
    low, high = torch.full_like(model.pose_low, 0.1), torch.full_like(model.pose_low, 0.3)
    low[3], high[3] = -0.4, -0.2
    model = replace(model, pose_low=low, pose_high=high)

    def energy(at: HandState) -> Tensor:
        return pose_term(at, model, 0.3, 20.0).energy

    found = pose_term(state, model, 0.3, 20.0)
    torch.testing.assert_close(found.gradient, half_slope(energy, state))
    overshoot = 20.0**2 * (14 * 3 * 0.1**2 + 3 * 0.2**2)
    toward = ((model.pose_mean / model.pose_std)[1:] * 0.3).square().sum()
    torch.testing.assert_close(found.energy, (overshoot + toward).expand(1, 2))


def test_the_prior_pulls_nearly_by_its_gradient_in_natural_poses(state, hand, double):
    model = double(hand)

    def energy(at: HandState) -> Tensor:
        return pose_term(at, model, 0.1, 20.0).energy

    found = pose_term(state, model, 0.1, 20.0).gradient
    want = half_slope(energy, state)
    alike = torch.nn.functional.cosine_similarity(found, want, dim=-1)
    assert float(alike.min()) > 0.9


def test_the_prior_leaves_wrist_and_orientation_alone(state, hand, double):
    found = pose_term(state, double(hand), 0.1, 20.0)
    free = [0, 1, 2, 48, 49, 50]
    assert not bool(found.gradient[..., free].any())
    assert not bool(found.matrix[..., free, :].any())


def test_steadiness_pulls_by_the_gradient_of_the_squared_change(state):
    weight = torch.cat([torch.full((3,), 0.5), torch.full((45,), 2.0), torch.full((3,), 9.0)])
    weight = weight.double()

    def energy(at: HandState) -> Tensor:
        return steadiness(at, weight)[0]

    torch.testing.assert_close(steadiness(state, weight)[1], half_slope(energy, state))


def test_steadiness_is_the_weighted_angle_between_frames():
    turn = torch.tensor([0.0, 0.2, 0.5])
    pose = torch.zeros(1, 3, 16, 3)
    pose[0, :, 4, 1] = turn
    wrist = torch.zeros(1, 3, 3)
    wrist[0, 2, 0] = 0.01
    weight = torch.full((UNKNOWNS,), 2.0)
    energy, pull = steadiness(HandState(axis_angle_to_matrix(pose), wrist), weight)
    want = torch.tensor([[0, 4 * 0.2**2, 4 * (0.3**2 + 0.01**2)]])
    torch.testing.assert_close(energy, want)
    torch.testing.assert_close(pull.sum(1), torch.zeros(1, UNKNOWNS), atol=1e-5, rtol=0)
    still = HandState(torch.eye(3).expand(1, 4, 16, 3, 3), torch.ones(1, 4, 3))
    energy, pull = steadiness(still, weight)
    assert not bool(energy.any())
    assert not bool(pull.any())


def test_an_increment_turns_joints_in_their_own_frame_and_shifts_the_wrist(make_state):
    state = make_state()
    step = torch.zeros(1, 3, UNKNOWNS)
    step[..., 6:9] = torch.tensor([0.1, -0.2, 0.3])
    step[..., 48:] = torch.tensor([0.01, 0.0, 0.0])
    moved = state.moved(step)
    turn = state.rotations[:, :, 2].mT @ moved.rotations[:, :, 2]
    want = axis_angle_to_matrix(torch.tensor([0.1, -0.2, 0.3]))
    torch.testing.assert_close(turn, want.expand_as(turn), atol=1e-6, rtol=0)
    torch.testing.assert_close(moved.wrist - state.wrist, step[..., 48:])
    others = [j for j in range(16) if j != 2]
    torch.testing.assert_close(moved.rotations[:, :, others], state.rotations[:, :, others])
    torch.testing.assert_close(axis_angle_to_matrix(state.pose), state.rotations, atol=1e-5, rtol=0)


def test_terms_add(state, plain):
    joints = plain.joints_from_rotations(state.rotations, state.wrist)
    weight = torch.ones(2, 3, 21, dtype=torch.float64)
    one = keypoint_term(moving_keypoints(state, plain), joints + 0.01, weight)
    two = keypoint_term(moving_keypoints(state, plain), joints + 0.01, 2 * weight)
    for field in fields(Equations):
        added = getattr(one + two, field.name)
        torch.testing.assert_close(added, 5 * getattr(one, field.name))
