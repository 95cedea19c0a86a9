import pytest
import torch
from torch import Tensor

from geneoh.denoisers.holding import HeldPlace, holding
from geneoh.denoisers.sliding import INDEPENDENT, NOISE_LEFT, USUAL_SLIDING, Sliding
from geneoh.denoisers.spatial import track_cues
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation.parameters import UNIT, HandParameters

FRAMES = 60
ERROR = torch.tensor([0.02, -0.03, 0.01])
HELD = torch.ones(1, FRAMES, 1)


def held_hand(turn: float) -> tuple[Tensor, Tensor, Tensor]:
    """Keypoints that hold an object, which turns by so many radians, and the object's motion."""
    generator = torch.Generator().manual_seed(0)
    time = torch.linspace(0, 1, FRAMES)
    axes = torch.stack([time.sin(), time, 0.5 * (3 * time).cos()], dim=-1)
    rotation = axis_angle_to_matrix(turn * axes)[None]
    translation = 0.3 * time[None, :, None] * torch.tensor([1.0, -0.5, 0.2])
    own = 0.05 * torch.randn(1, 1, 21, 3, generator=generator)
    joints = own @ rotation.mT + translation[:, :, None]
    return joints, rotation[:, :, None], translation[:, :, None]


def sliding(
    joints: Tensor,
    rotation: Tensor,
    translation: Tensor,
    *,
    held: Tensor = HELD,
    object_noise: tuple[float, float] = (0.0, 0.0),
    wrist_noise: float = 0.0,
) -> Sliding:
    """How these hands slide; `wrist_noise`, metres, is what MotionDiff took away of each axis."""
    hand = HandParameters.of_pose(
        torch.zeros(1, FRAMES, 3), torch.zeros(1, FRAMES, 16, 3), torch.ones(1, 20, 3)
    )
    change = torch.zeros(1, FRAMES, 51)
    change[..., :3] = wrist_noise / UNIT[0] * torch.tensor([1.0, -1.0]).repeat(FRAMES // 2)[:, None]
    track = track_cues(hand, change, torch.ones(1, FRAMES), torch.tensor([object_noise]))
    return Sliding.of(HeldPlace.of(joints.mean(2), rotation, translation, held), track)


def grid(around: Tensor) -> Tensor:
    """Shifts every 5 mm along each axis, and that in the middle first."""
    steps = 0.005 * torch.arange(-4, 5)
    shifts = torch.cartesian_prod(steps, steps, steps)
    return torch.cat([torch.zeros(1, 3), shifts[shifts.abs().sum(-1) > 0]])[None] + around


def won(found: Sliding) -> float:
    """From the place of an error to the right one, in the logarithm of the density."""
    wrong, right = found.log_density(torch.stack([torch.zeros(3), -ERROR])[None])[0]
    return float(right - wrong)


def test_the_density_is_that_of_the_spread_in_the_objects_frame(draw):
    joints, rotation, translation = held_hand(0.8)
    joints = joints + 0.01 * draw(1, FRAMES, 21, 3)
    held, shift = draw(1, FRAMES, 1, seed=1).sigmoid(), torch.tensor([[[0.01, -0.02, 0.015]]])
    got = sliding(joints, rotation, translation, held=held).log_density(shift)
    middle = joints.mean(2) + shift - translation[:, :, 0]
    own, share = (middle[:, :, None] @ rotation[:, :, 0])[:, :, 0], held / held.sum()
    square = (share * (own - (share * own).sum(1, keepdim=True)).square()).sum()
    wanted = -1.5 * (INDEPENDENT * held.sum() - 1) * torch.log1p(square / USUAL_SLIDING**2)
    torch.testing.assert_close(got[0, 0], wanted, rtol=1e-4, atol=1e-5)


def test_a_constant_error_is_found_where_the_held_object_turns():
    joints, rotation, translation = held_hand(0.8)
    density = sliding(joints + ERROR, rotation, translation).log_density(grid(-ERROR))
    assert int(density.argmax()) == 0
    assert float(density[0, 0]) == pytest.approx(0, abs=1e-3)


def test_an_object_that_does_not_turn_tells_nothing():
    density = sliding(*held_hand(0.0)).log_density(grid(torch.zeros(3)))
    assert float(density.max() - density.min()) < 1e-4


def test_few_frames_tell_nothing():
    """One place on the object explains them."""
    few = (torch.arange(FRAMES) < 1 / INDEPENDENT - 1).float()[None, :, None]
    assert won(sliding(*held_hand(0.8), held=few)) == pytest.approx(0, abs=1e-6)


def test_a_hand_that_lets_go_is_pulled_less_than_one_that_holds():
    joints, *motion = held_hand(0.8)
    away = 0.2 * torch.linspace(0, 1, FRAMES)[None, :, None, None] * torch.tensor([0.0, 0.0, 1.0])
    assert abs(won(sliding(joints + ERROR + away, *motion))) < 0.2 * won(
        sliding(joints + ERROR, *motion)
    )


def test_of_two_parts_the_one_that_is_held_longest_counts():
    joints, rotation, translation = held_hand(0.8)
    still = torch.eye(3).expand_as(rotation), torch.zeros_like(translation)
    both = torch.cat([still[0], rotation], dim=2), torch.cat([still[1], translation], dim=2)
    held = torch.cat([0.5 * HELD, HELD], dim=-1)
    shifts = grid(torch.zeros(3))
    density = sliding(joints, *both, held=held).log_density(shifts)
    torch.testing.assert_close(density, sliding(joints, rotation, translation).log_density(shifts))


def test_noise_of_object_and_hand_excuses_sliding():
    joints, *motion = held_hand(0.8)
    joints = joints + ERROR
    exact = won(sliding(joints, *motion))
    assert exact > 1
    assert won(sliding(joints, *motion, object_noise=(0.0, 0.02))) < 0.5 * exact
    assert won(sliding(joints, *motion, object_noise=(0.2, 0.0))) < 0.7 * exact
    left = sliding(joints, *motion, wrist_noise=0.02).least.sqrt()
    assert float(left) == pytest.approx(
        (USUAL_SLIDING**2 + (NOISE_LEFT * 0.02) ** 2) ** 0.5, rel=0.02
    )


def test_a_hand_holds_what_moves_with_it_and_not_what_passes_by():
    joints, rotation, translation = held_hand(0.5)
    parts = torch.cat([rotation, rotation[:, :1].expand_as(rotation)], dim=2)
    places = torch.cat([translation, translation[:, :1].expand_as(translation)], dim=2)
    held = holding(joints, parts, places)
    assert float(held[..., 0].min()) > 0.99
    assert float(held[..., 1].max()) < 0.05
    passing = holding(joints[:, :1].expand_as(joints), rotation, translation)
    assert float(passing.max()) < 0.05


def test_a_hand_that_comes_to_an_object_does_not_hold_it_though_the_view_moves():
    """The object moves by 20 mm a frame in the view of a camera, and the hand comes by 9 mm."""
    frames = torch.arange(12.0)[:, None] * torch.tensor([1.0, 0.0, 0.0])
    translation = (0.02 * frames)[None, :, None]
    rotation = torch.eye(3).expand(1, 12, 1, 3, 3)
    joints = (0.011 * frames)[None, :, None].expand(1, 12, 21, 3)
    assert float(holding(joints, rotation, translation).min()) > 0.99
    far, near = (torch.full((1, 12), apart) for apart in (0.05, 0.01))
    assert float(holding(joints, rotation, translation, far).max()) < 0.01
    assert float(holding(joints, rotation, translation, near).min()) > 0.99
