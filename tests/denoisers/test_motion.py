from dataclasses import replace

import pytest
import torch

from geneoh.denoisers.motion import (
    MOTION_FEATURES,
    MotionConfig,
    MotionDenoiser,
    ObservedMotion,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.representation.parameters import HandParameters

TINY = MotionConfig(width=16, depth=1, heads=2)


@pytest.fixture(scope="module")
def model(wake):
    return wake(MotionDenoiser(TINY))


@pytest.fixture(scope="module")
def observed(draw):
    def made(frames: int = 4, seed: int = 0) -> ObservedMotion:
        def some(*shape: int, at: int = 0) -> torch.Tensor:
            return draw(2, frames, *shape, seed=seed + 10 * at)

        hand = HandParameters(
            0.05 * some(3),
            axis_angle_to_matrix(0.2 * some(3, at=1) + torch.tensor([0.4, 1.0, -0.5])),
            0.3 * some(15, 3, at=2),
            load_hand("right").shaped(torch.zeros(2, 10)).offsets,
        )
        nearest = hand.joints + 0.01 * some(21, 3, at=3)
        normals = torch.nn.functional.normalize(some(21, 3, at=4), dim=-1)
        rotation = axis_angle_to_matrix(0.02 * some(3, at=5))
        return ObservedMotion(
            hand, torch.ones(2, frames), nearest, normals, rotation, 0.002 * some(3, at=6)
        )

    return made


@pytest.mark.parametrize("frames", [1, 2, 7])
def test_the_clean_change_has_the_shape_of_the_noisy_one(model, draw, observed, frames):
    x = draw(2, frames, 51)
    seen = observed(frames)
    assert seen.network_input.features.shape == (2, frames, MOTION_FEATURES)
    got = model(x, torch.tensor([1.0, 0.2]), seen)
    assert got.shape == x.shape
    assert bool(got.isfinite().all())


def test_an_untrained_network_is_the_skip_path_around_no_change(draw, observed):
    x, sigma = draw(2, 4, 51), torch.tensor([0.3, 2.0])
    with torch.no_grad():
        got = MotionDenoiser(TINY)(x, sigma, observed())
    torch.testing.assert_close(got, x / (1 + sigma**2)[:, None, None])


def test_an_almost_clean_change_comes_back(model, draw, observed):
    x = draw(2, 4, 51)
    got = model(x, torch.full((2,), 1e-5), observed())
    torch.testing.assert_close(got, x, atol=1e-3, rtol=0)


def test_the_hand_is_denoised_the_same_however_the_canonical_frame_is_turned(model, draw, observed):
    x, sigma, seen = draw(2, 4, 51), torch.full((2,), 0.5), observed()
    turn = axis_angle_to_matrix(torch.tensor([0.5, -1.2, 2.0]))
    hand = replace(seen.hand, wrist=seen.hand.wrist @ turn.T, turn=turn @ seen.hand.turn)
    turned = replace(
        seen,
        hand=hand,
        nearest=seen.nearest @ turn.T,
        normals=seen.normals @ turn.T,
        rotation=seen.rotation @ turn.T,
    )

    def around(change: torch.Tensor) -> torch.Tensor:
        return torch.cat([change[..., :3] @ turn.T, change[..., 3:]], dim=-1)

    got = model(around(x), sigma, turned)
    torch.testing.assert_close(got, around(model(x, sigma, seen)), atol=1e-4, rtol=0)


def test_what_stands_near_the_hand_and_how_the_object_moves_is_seen(model, draw, observed):
    x, sigma, seen = draw(2, 4, 51), torch.full((2,), 0.5), observed()
    plain = model(x, sigma, seen)
    for other in (
        replace(seen, nearest=seen.nearest + 0.01),
        replace(seen, normals=-seen.normals),
        replace(seen, center=seen.center + torch.arange(4.0)[:, None] * 0.01),
        replace(seen, trust=torch.zeros(2, 4)),
    ):
        assert not torch.allclose(model(x, sigma, other), plain, atol=1e-4)


def test_the_clips_of_a_batch_do_not_influence_each_other(model, draw, observed):
    x, sigma, seen = draw(2, 4, 51), torch.tensor([0.2, 1.0]), observed()
    whole = model(x.repeat(2, 1, 1), sigma.repeat(2), seen)
    torch.testing.assert_close(whole[2:], whole[:2])
    torch.testing.assert_close(model(x, sigma, seen), whole[:2])
