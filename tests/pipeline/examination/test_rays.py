"""The ray of a camera, found in the noise of the hand that it saw."""

import math
from dataclasses import replace

import pytest
import torch
from torch.nn.functional import normalize

import geneoh
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.pipeline.examination.rays import found_ray, scatter, with_found_rays
from geneoh.pipeline.presets import preset
from geneoh.sequence.noise import corrupt_sequence, perturbed
from geneoh.sequence.resample import at_rate
from geneoh.sequence.sequence import HandTrack, ObjectTrack

FRAMES = 120
RAY = normalize(torch.tensor([0.3, -0.5, 0.8]), dim=0)


def still(frames: int = FRAMES) -> HandTrack:
    """Keypoints of a hand at rest."""
    generator = torch.Generator().manual_seed(7)
    joints = 0.05 * torch.randn(21, 3, generator=generator)
    return HandTrack("right", torch.ones(frames, dtype=torch.bool), joints.repeat(frames, 1, 1))


def world(frames: int = FRAMES) -> ObjectTrack:
    """An object at rest."""
    return ObjectTrack((), torch.eye(3).expand(frames, 1, 3, 3), torch.zeros(frames, 1, 3))


def shaken(hand: HandTrack, along: float, across: float, seed: int = 0) -> HandTrack:
    """The hand with white noise of its place, metres, along the ray and across it."""
    generator = torch.Generator().manual_seed(seed)
    noise = across * torch.randn(hand.frames, 3, generator=generator)
    noise = noise + (along - across) * (noise @ RAY)[:, None] * RAY / across
    return replace(hand, joints=hand.joints + noise[:, None])


def without_rays(sequence: geneoh.Sequence) -> geneoh.Sequence:
    """The sequence, which knows of no camera."""
    return replace(sequence, hands=tuple(replace(h, camera_ray=None) for h in sequence.hands))


def degrees_off(direction: torch.Tensor, ray: torch.Tensor) -> float:
    """Angle between two lines."""
    return math.degrees(math.acos(min(1.0, float((direction @ ray).abs()))))


def test_noise_that_is_larger_along_a_line_tells_its_direction():
    found = found_ray(shaken(still(), 0.006, 0.002), world(), 30.0)
    assert found is not None
    assert degrees_off(found.direction, RAY) < 5
    assert found.times == pytest.approx(3, rel=0.25)


@pytest.mark.parametrize("seed", range(10))
def test_noise_that_is_alike_in_all_directions_tells_none(seed):
    assert found_ray(shaken(still(), 0.004, 0.004, seed), world(), 30.0) is None


def test_a_long_track_tells_no_ray_by_a_slight_difference():
    frames = 6000
    hand, motion = still(frames), world(frames)
    assert found_ray(shaken(hand, 0.0045, 0.004), motion, 30.0) is None
    assert found_ray(shaken(hand, 0.006, 0.004), motion, 30.0) is not None


def test_few_frames_and_small_noise_tell_none():
    assert found_ray(shaken(still(12), 0.006, 0.002), world(12), 30.0) is None
    assert found_ray(shaken(still(2), 0.006, 0.002), world(2), 30.0) is None
    assert found_ray(shaken(still(), 0.0006, 0.0002), world(), 30.0) is None


def test_a_hand_at_perfect_rest_tells_none():
    assert found_ray(still(), world(), 30.0) is None


def test_missing_frames_do_not_count():
    hand = shaken(still(), 0.01, 0.002)
    valid = torch.arange(FRAMES) % 30 < 20
    lost = torch.where(valid[:, None, None], hand.joints, torch.nan)
    found = found_ray(replace(hand, valid=valid, joints=lost), world(), 30.0)
    assert found is not None
    assert degrees_off(found.direction, RAY) < 8


def test_fast_motion_with_the_object_is_no_noise():
    time = torch.arange(FRAMES) / 30
    turn = axis_angle_to_matrix(0.4 * torch.sin(2 * math.pi * 5 * time)[:, None] * RAY)
    hand = still()
    moved = replace(hand, joints=hand.joints @ turn.mT)
    carried = ObjectTrack((), turn[:, None], torch.zeros(FRAMES, 1, 3))
    assert found_ray(moved, carried, 30.0) is None
    found = found_ray(shaken(moved, 0.006, 0.002), carried, 30.0)
    assert found is not None
    assert degrees_off(found.direction, RAY) < 8


def test_smooth_motion_along_a_line_is_no_noise():
    place = 0.05 * torch.sin(2 * math.pi * 2 * torch.arange(FRAMES) / 30)[:, None] * RAY
    hand = still()
    assert found_ray(replace(hand, joints=hand.joints + place[:, None]), world(), 30.0) is None


def test_noise_of_the_rotation_alone_tells_none(clean):
    hand, found = clean.hands[0], 0
    for seed in range(10):
        generator, offsets = torch.Generator().manual_seed(seed), torch.zeros(hand.frames, 51)
        offsets[:, 3:6] = 0.1 * torch.randn(hand.frames, 3, generator=generator)
        noisy = perturbed(hand, offsets, hand.valid)
        found += found_ray(noisy, clean.object, clean.fps) is not None
    assert found <= 1


def test_noise_of_the_rotation_hides_no_ray_that_the_wrist_shows(clean):
    hand, found = clean.hands[0], 0
    for seed in range(20):
        generator, offsets = torch.Generator().manual_seed(seed), torch.zeros(hand.frames, 51)
        offsets[:, :3] = 0.002 * torch.randn(hand.frames, 3, generator=generator)
        offsets[:, :3] += 0.004 * torch.randn(hand.frames, 1, generator=generator) * RAY
        offsets[:, 3:6] = 0.04 * torch.randn(hand.frames, 3, generator=generator)
        noisy = perturbed(hand, offsets, hand.valid)
        ray = found_ray(noisy, clean.object, clean.fps)
        found += ray is not None and degrees_off(ray.direction, RAY) < 20
    assert found >= 17  # 14 by the middle of the palm alone


def test_a_hand_that_pats_fast_tells_none():
    lift = 0.02 * torch.sin(2 * math.pi * 4 * torch.arange(FRAMES) / 30)[:, None] * RAY
    hands = [shaken(still(), 0.004, 0.004, seed) for seed in range(10)]
    patting = [replace(hand, joints=hand.joints + lift[:, None]) for hand in hands]
    assert sum(found_ray(hand, world(), 30.0) is not None for hand in patting) <= 1


def test_the_ray_of_a_camera_is_nearly_always_found(clean):
    draws = [torch.Generator().manual_seed(seed) for seed in range(10)]
    told = [without_rays(corrupt_sequence(clean, "camera", generator=draw)) for draw in draws]
    found = [found_ray(one.hands[0], one.object, one.fps) for one in told]
    assert sum(ray is not None for ray in found) >= 9


@pytest.mark.parametrize("fps", [10.0, 15.0, 30.0])
def test_motion_at_few_frames_a_second_is_no_noise(clean, fps):
    slow = at_rate(clean, fps)
    assert found_ray(slow.hands[0], slow.object, slow.fps) is None
    hand = shaken(still(), 0.04, 0.01)
    assert found_ray(hand, world(), fps) is not None


def test_scatter_is_a_covariance_that_outliers_hardly_change():
    generator = torch.Generator().manual_seed(1)
    values = torch.randn(4000, 3, generator=generator).double() * torch.tensor([3.0, 2.0, 1.0])
    shape = scatter(values)
    torch.testing.assert_close(
        shape / shape[2, 2], torch.diag(values.new_tensor([9, 4, 1])), atol=0.6, rtol=0
    )
    values[:40, 2] = 100.0
    assert float(scatter(values)[2, 2] / shape[2, 2]) < 1.2


def test_a_told_ray_is_kept_and_presets_choose_what_is_shown(clean):
    told = corrupt_sequence(clean, "camera", generator=torch.Generator().manual_seed(2))
    chosen, untold = preset("default"), without_rays(told)
    kept, said = with_found_rays(told, chosen)
    assert (kept.hands[0].camera_ray.equal(told.hands[0].camera_ray), said) == (True, [])
    found, said = with_found_rays(untold, chosen)
    assert degrees_off(found.hands[0].camera_ray[0], told.hands[0].camera_ray[0]) < 10
    assert "--camera" in said[0]
    for sequence, other in (
        (told, chosen.without("camera")),
        (untold, chosen.without("camera")),
        (untold, chosen.alone()),
        (untold, preset("paper")),
    ):
        withheld, said = with_found_rays(sequence, other)
        assert (withheld.hands[0].camera_ray, said) == (None, [])
    again, _ = with_found_rays(told, chosen.without("told-camera"))
    assert again.hands[0].camera_ray.equal(found.hands[0].camera_ray)


def test_errors_along_a_ray_that_nobody_told_are_mended(clean):
    told = corrupt_sequence(clean, "camera", generator=torch.Generator().manual_seed(2))
    untold = without_rays(told)

    found, without = (
        geneoh.denoise(untold, preset="fast", without=parts) for parts in ((), ("camera",))
    )

    def error(result: geneoh.Denoised) -> float:
        """Of the result, millimetres."""
        assert result.sequence.hands[0].camera_ray is None
        off = result.sequence.hands[0].joints - clean.hands[0].joints
        return 1000 * float(off.norm(dim=-1).mean())

    assert error(found) < 0.85 * error(without)
    assert any("ray of the camera" in note for note in found.notes)
