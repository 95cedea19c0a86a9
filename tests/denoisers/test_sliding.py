import pytest
import torch

from geneoh.denoisers.sliding import SLIDING, sliding_density
from geneoh.geometry.rotations import axis_angle_to_matrix

FRAMES = 40
INDEPENDENT = 0.5
HELD, EXACT = torch.ones(1, FRAMES, 1), torch.zeros(1, 2)


def held_hand(turn: float) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Keypoints that hold an object, which turns by so many radians, and the object's motion."""
    generator = torch.Generator().manual_seed(0)
    time = torch.linspace(0, 1, FRAMES)
    axes = torch.stack([time.sin(), time, 0.5 * (3 * time).cos()], dim=-1)
    rotation = axis_angle_to_matrix(turn * axes)[None]
    translation = 0.3 * time[None, :, None] * torch.tensor([1.0, -0.5, 0.2])
    own = 0.05 * torch.randn(1, 1, 21, 3, generator=generator)
    joints = own @ rotation.mT + translation[:, :, None]
    return joints, rotation[:, :, None], translation[:, :, None]


def density_of(shifts, joints, rotation, translation, held=HELD, noise=EXACT) -> torch.Tensor:
    """The density with as many independent frames as the constant says."""
    return sliding_density(shifts, joints, rotation, translation, held, noise, INDEPENDENT)


def grid(around: torch.Tensor) -> torch.Tensor:
    """Shifts every 5 mm along each axis, and that in the middle first."""
    steps = 0.005 * torch.arange(-4, 5)
    shifts = torch.cartesian_prod(steps, steps, steps)
    return torch.cat([torch.zeros(1, 3), shifts[shifts.abs().sum(-1) > 0]])[None] + around


def test_the_density_is_that_of_the_spread_in_the_objects_frame(draw):
    joints, rotation, translation = held_hand(0.8)
    joints = joints + 0.01 * draw(1, FRAMES, 21, 3)
    held, shift = draw(1, FRAMES, 1, seed=1).sigmoid(), torch.tensor([[[0.01, -0.02, 0.015]]])
    got = density_of(shift, joints, rotation, translation, held)
    middle = joints.mean(2) + shift - translation[:, :, 0]
    own, share = (middle[:, :, None] @ rotation[:, :, 0])[:, :, 0], held / held.sum()
    square = (share * (own - (share * own).sum(1, keepdim=True)).square()).sum()
    wanted = -1.5 * INDEPENDENT * held.sum() * torch.log1p(square / SLIDING**2)
    torch.testing.assert_close(got[0, 0], wanted, rtol=1e-4, atol=1e-5)


def test_a_constant_error_is_found_where_the_held_object_turns():
    joints, rotation, translation = held_hand(0.8)
    error = torch.tensor([0.02, -0.03, 0.01])
    shifts = grid(-error)
    density = density_of(shifts, joints + error, rotation, translation)
    assert int(density.argmax()) == 0
    assert float(density[0, 0]) == pytest.approx(0, abs=1e-3)


def test_an_object_that_does_not_turn_tells_nothing():
    joints, rotation, translation = held_hand(0.0)
    density = density_of(grid(torch.zeros(3)), joints, rotation, translation)
    assert float(density.max() - density.min()) < 1e-4


def test_frames_in_which_nothing_is_held_tell_nothing():
    joints, rotation, translation = held_hand(0.8)
    density = density_of(grid(torch.zeros(3)), joints, rotation, translation, 0 * HELD)
    torch.testing.assert_close(density, torch.zeros_like(density))


def test_a_hand_that_lets_go_is_pulled_less_than_one_that_holds():
    """What is won from the error's place to the right one, in the logarithm of the density."""
    joints, rotation, translation = held_hand(0.8)
    error = torch.tensor([0.02, -0.03, 0.01])
    away = 0.2 * torch.linspace(0, 1, FRAMES)[None, :, None, None] * torch.tensor([0.0, 0.0, 1.0])
    shifts = torch.stack([torch.zeros(3), -error])[None]

    def won(hand: torch.Tensor) -> float:
        nothing, right = density_of(shifts, hand + error, rotation, translation)[0]
        return abs(float(right - nothing))

    assert won(joints + away) < 0.2 * won(joints)


def test_of_two_parts_the_one_that_is_held_longest_counts():
    joints, rotation, translation = held_hand(0.8)
    still = torch.eye(3).expand_as(rotation), torch.zeros_like(translation)
    both = torch.cat([still[0], rotation], dim=2), torch.cat([still[1], translation], dim=2)
    held = torch.cat([0.5 * HELD, HELD], dim=-1)
    shifts = grid(torch.zeros(3))
    density = density_of(shifts, joints, *both, held)
    wanted = density_of(shifts, joints, rotation, translation)
    torch.testing.assert_close(density, wanted)


def test_noise_of_the_object_excuses_sliding():
    joints, rotation, translation = held_hand(0.8)
    error = torch.tensor([0.02, -0.03, 0.01])
    shifts = torch.stack([torch.zeros(3), -error])[None]

    def won(turn: float, shift: float) -> float:
        noise = torch.tensor([[turn, shift]])
        nothing, right = density_of(shifts, joints + error, rotation, translation, HELD, noise)[0]
        return float(right - nothing)

    assert won(0.0, 0.02) < 0.3 * won(0.0, 0.0)
    assert won(0.2, 0.0) < 0.5 * won(0.0, 0.0)
