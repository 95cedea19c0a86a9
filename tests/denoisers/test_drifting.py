"""Errors that drift, seen over the object that a hand holds."""

import pytest
import torch
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.denoisers.drifting import drift
from geneoh.denoisers.holding import HeldPlace
from geneoh.geometry.rotations import axis_angle_to_matrix

FRAMES = 120
RAY = normalize(torch.tensor([0.6, -0.2, 0.77]), dim=0).expand(1, FRAMES, 3)
TIME = torch.linspace(0, 1, FRAMES)
TURN = axis_angle_to_matrix(
    1.5 * torch.stack([(2 * TIME).sin(), TIME, 0.5 * (5 * TIME).cos()], dim=-1)
)[None]
EXACT = torch.zeros(1, 1)


def wandering(generator: torch.Generator, size: float) -> Tensor:
    """A process of this deviation that stays alike over ten frames, (1, FRAMES, 3)."""
    values = torch.randn(FRAMES, 3, generator=generator)
    alike = 0.9
    for frame in range(1, FRAMES):
        values[frame] = alike * values[frame - 1] + (1 - alike**2) ** 0.5 * values[frame]
    return size * values[None]


def held_with(error: Tensor, sure: float = 1.0) -> HeldPlace:
    """A hand that keeps its place on a turning object, but for an error in the world."""
    place = torch.tensor([0.03, -0.02, 0.05]) + (TURN.mT @ error[..., None])[..., 0]
    return HeldPlace(place, TURN, torch.full((1, FRAMES), sure))


def size(error: Tensor) -> float:
    """Root mean square length around the mean: a constant error is no drift."""
    return float((error - error.mean(1, keepdim=True)).square().sum(-1).mean().sqrt())


@pytest.mark.parametrize("seed", range(5))
def test_a_good_part_of_a_drift_is_found(seed):
    error = wandering(torch.Generator().manual_seed(seed), 0.008)
    found = drift(held_with(error), EXACT)
    assert size(error - found) < 0.65 * size(error)


def test_a_hand_that_keeps_its_place_is_left_alone(draw):
    restless = 0.002 * draw(1, FRAMES, 3)
    assert size(drift(held_with(restless), EXACT)) < 0.0002
    assert float(drift(held_with(torch.zeros(1, FRAMES, 3)), EXACT).norm(dim=-1).max()) < 1e-5


def test_a_hand_that_slides_slowly_is_left_alone():
    slid = 0.006 * torch.stack([TIME, -TIME, 0.5 * TIME], dim=-1)
    held = held_with(torch.zeros(1, FRAMES, 3))
    held = HeldPlace(held.place + slid, held.rotation, held.sure)
    assert size(drift(held, EXACT)) < 0.1 * size(slid[None])


@pytest.mark.parametrize("step", [0.03, 0.04])
def test_a_hand_that_grips_anew_is_left_alone(step):
    """As one that screws a lid: it lets go, and takes the object a step further."""
    held, grip = held_with(torch.zeros(1, FRAMES, 3)), torch.arange(FRAMES) * 3 // FRAMES
    place = held.place + step * (grip[:, None] - 1) * torch.tensor([0.8, 0.6, 0.0])
    sure = held.sure.clone()
    sure[:, [*range(35, 45), *range(75, 85)]] = 0
    found = drift(HeldPlace(place, held.rotation, sure), EXACT)
    assert float(found[sure > 0].norm(dim=-1).max()) < 0.0001


def test_what_is_known_of_the_ray_helps():
    along = wandering(torch.Generator().manual_seed(1), 0.01)[..., :1] * RAY
    across = 0.004 * torch.linalg.cross(RAY, torch.tensor([0.0, 0, 1]).expand_as(RAY))
    held = held_with(along + across * torch.sin(9 * TIME)[None, :, None])
    told, untold = size(along - drift(held, EXACT, RAY)), size(along - drift(held, EXACT))
    assert told < 0.8 * untold


@pytest.mark.parametrize("case", ["free", "noisy object"])
def test_what_says_nothing_of_the_hand_moves_nothing(case):
    error = wandering(torch.Generator().manual_seed(2), 0.008)
    held = held_with(error, 0.0 if case == "free" else 1.0)
    noise = EXACT if case == "free" else torch.full((1, 1), 0.05**2)
    assert float(drift(held, noise).norm(dim=-1).max()) < 0.0005


def test_the_answer_turns_with_the_world():
    error = wandering(torch.Generator().manual_seed(3), 0.008)
    held, turn = held_with(error), axis_angle_to_matrix(torch.tensor([0.4, -1.0, 0.7]))
    turned = HeldPlace(held.place, turn @ held.rotation, held.sure)
    torch.testing.assert_close(
        drift(turned, EXACT, RAY @ turn.mT), drift(held, EXACT, RAY) @ turn.mT, atol=1e-6, rtol=0
    )


def test_a_frame_or_two_have_no_drift():
    held = held_with(0.01 * torch.ones(1, FRAMES, 3))
    for frames in (1, 2, 4):
        few = HeldPlace(held.place[:, :frames], held.rotation[:, :frames], held.sure[:, :frames])
        assert float(drift(few, EXACT).norm(dim=-1).max()) < 0.001
