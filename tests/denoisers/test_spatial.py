from dataclasses import replace

import pytest
import torch

from geneoh.denoisers.spatial import (
    LONGEST_SHIFT,
    PRIOR_RANGE,
    TRACK_CUES,
    SpatialConfig,
    SpatialDenoiser,
    SpatialEvidence,
    frame_features,
    relative_speeds,
    track_cues,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation.parameters import HandParameters

TINY = SpatialConfig(width=16, frames=4)
TURN = axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
SHIFT = torch.tensor([0.3, -0.7, 0.2])


@pytest.fixture(scope="module")
def model(wake):
    return wake(SpatialDenoiser(TINY))


@pytest.fixture
def evidence(draw) -> SpatialEvidence:
    """Two hands near a ball of 4 cm that moves, 6 frames."""
    normals = torch.nn.functional.normalize(draw(2, 50, 3), dim=-1)
    rotation = axis_angle_to_matrix(0.2 * draw(2, 6, 1, 3, seed=1))
    translation = 0.05 * draw(2, 6, 1, 3, seed=2)
    joints = translation[:, :, 0, None] + 0.05 * draw(2, 1, 21, 3, seed=3)
    ray = torch.nn.functional.normalize(draw(2, 3, seed=4), dim=-1)
    return SpatialEvidence(
        0.04 * normals,
        normals,
        torch.zeros(2, 50, dtype=torch.long),
        rotation,
        translation,
        joints,
        relative_speeds(joints, rotation[:, :, 0], translation[:, :, 0]),
        ray * torch.tensor([[1.0], [0.0]]),
        draw(2, TRACK_CUES, seed=5),
    )


def turned(evidence: SpatialEvidence) -> SpatialEvidence:
    """The same scene, moved rigidly."""
    return replace(
        evidence,
        joints=evidence.joints @ TURN.T + SHIFT,
        rotation=TURN @ evidence.rotation,
        translation=evidence.translation @ TURN.T + SHIFT,
        ray=evidence.ray @ TURN.T,
    )


def test_the_density_moves_with_a_rigid_motion_of_the_scene(model, evidence, draw):
    shifts = 0.02 * draw(2, 5, 3, seed=6)
    here, there = model(shifts, evidence), model(shifts @ TURN.T, turned(evidence))
    assert here.shape == (2, 5)
    torch.testing.assert_close(there, here, atol=2e-4, rtol=0)


def test_a_place_is_the_same_place_however_the_hand_came_there(model, evidence):
    """What is seen at a trial place depends on the place alone; the rest is told beside it."""
    aside = torch.tensor([0.01, 0.0, -0.02])
    moved = replace(evidence, joints=evidence.joints + aside)
    reached = frame_features(aside.expand(2, 1, 3), evidence)[..., : 21 * 8]
    given = frame_features(torch.zeros(2, 1, 3), moved)[..., : 21 * 8]
    torch.testing.assert_close(reached, given, atol=1e-4, rtol=0)


def test_before_training_the_density_is_the_prior(evidence, draw):
    fresh = SpatialDenoiser(TINY)
    shifts = 0.02 * draw(2, 7, 3, seed=6)
    got = fresh(shifts, evidence)
    want = -0.5 * (shifts / 0.015).square().sum(-1)
    torch.testing.assert_close(got, want, atol=1e-4, rtol=1e-4)


def test_the_prior_is_wider_along_a_known_ray_only(evidence, draw):
    model = SpatialDenoiser(TINY).requires_grad_(False)
    model.width[-1].weight.copy_(0.05 * draw(2, 64))
    width = model.prior(evidence)
    assert bool((width >= PRIOR_RANGE[0] - 1e-9).all())
    assert bool((width <= PRIOR_RANGE[1] + 1e-9).all())
    assert float(width[0, 0]) != float(width[0, 1])
    assert float(width[1, 0]) == float(width[1, 1])
    root = model.prior_root(evidence, TURN)
    ray = TURN.T @ evidence.ray[0]
    torch.testing.assert_close(root[0] @ ray, width[0, 0] * ray)


def test_the_answer_turns_with_the_scene(model, evidence):
    def asked(where: SpatialEvidence, axes: torch.Tensor) -> torch.Tensor:
        generator = torch.Generator().manual_seed(0)
        return model.posterior(where, axes, rounds=3, places=50, generator=generator).mean

    here, there = asked(evidence, torch.eye(3)), asked(turned(evidence), TURN)
    torch.testing.assert_close(here, there, atol=1e-5, rtol=0)


def test_nothing_is_moved_beyond_the_reach_of_training(evidence):
    class Far(SpatialDenoiser):
        def forward(self, shifts, evidence):
            return 1e3 * shifts[..., 0]

    far, generator = Far(TINY).requires_grad_(False), torch.Generator().manual_seed(0)
    found = far.posterior(evidence, TURN, rounds=4, places=200, generator=generator)
    assert float(found.mean.norm(dim=-1).max()) <= LONGEST_SHIFT


@pytest.mark.parametrize("frames", [1, 2, 3, 6])
def test_any_number_of_frames_can_be_looked_at(model, evidence, draw, frames):
    some = evidence[:frames].spread_over(TINY.frames)
    assert some.joints.shape[1] == min(frames, TINY.frames)
    assert bool(model(0.01 * draw(2, 3, 3), some).isfinite().all())


def test_speeds_tell_a_held_object_from_one_that_is_passed():
    frames = 12
    rotation = torch.eye(3).expand(1, frames, 3, 3)
    path = torch.zeros(1, frames, 3)
    path[..., 0] = 0.006 * torch.arange(frames)
    hand = 0.05 * torch.randn(1, 1, 21, 3, generator=torch.Generator().manual_seed(0))
    held = relative_speeds(hand + path[:, :, None], rotation, path)
    passed = relative_speeds(hand + path[:, :, None], rotation, torch.zeros_like(path))
    twice_three_mm = torch.log1p(torch.tensor(2.0))
    torch.testing.assert_close(held[0, 5], twice_three_mm * torch.tensor([1.0, 0, 0, 1, 0]))
    torch.testing.assert_close(passed[0, 5], twice_three_mm * torch.tensor([0.0, 0, 1, 1, 0]))


def test_cues_grow_with_the_noise_of_the_track(draw):
    def cues(noise: float) -> torch.Tensor:
        hand = HandParameters.of_pose(
            noise * 0.01 * draw(1, 20, 3), noise * 0.1 * draw(1, 20, 16, 3), draw(1, 20, 3)
        )
        change = noise * draw(1, 20, 51, seed=3)
        return track_cues(hand, change, torch.ones(1, 20), noise * torch.ones(1, 2))

    calm, noisy = cues(0.1), cues(1.0)
    assert bool((noisy[:, :-1] > calm[:, :-1]).all())
    assert float(calm[0, -1]) == 1.0, "the share of frames that were seen"
