"""Noise on the poses of an object."""

import numpy as np
import pytest
import torch
from draws import seeded
from scipy.spatial.transform import Rotation

from geneoh.choices import OBJECT_NOISES
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.sequence.object_noise import DEGREES, corrupt_object, draw_object_noise
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence


@pytest.mark.parametrize("noise", OBJECT_NOISES)
def test_the_same_generator_gives_the_same_noise(noise):
    first, second = (draw_object_noise(noise, 50, generator=seeded()) for _ in range(2))
    assert all(
        torch.equal(a.nan_to_num(9), b.nan_to_num(9)) for a, b in zip(first, second, strict=True)
    )


@pytest.mark.parametrize("noise", ["shaky_2", "shaky_10"])
def test_shaky_poses_are_off_by_as_much_as_their_name_says(noise):
    turn, shift = draw_object_noise(noise, 20000, generator=seeded())
    angle = np.degrees(float(turn.square().sum(-1).mean().sqrt()))
    assert angle == pytest.approx(DEGREES[noise], rel=0.1)
    length = float(shift.square().sum(-1).mean().sqrt())
    assert length == pytest.approx(0.002 * DEGREES[noise], rel=0.1)


def test_flips_are_short_runs_about_one_axis():
    turn, _ = draw_object_noise("flips", 600, generator=seeded())
    large = turn[turn.norm(dim=-1) > 0.5]
    assert 0.1 < len(large) / 600 < 0.4
    axes = torch.nn.functional.normalize(large, dim=-1)
    assert float((axes @ axes[0]).abs().min()) > 0.97


def test_lost_poses_are_short_runs_that_are_marked_and_filled():
    turn, shift = draw_object_noise("lost", 600, generator=seeded())
    lost = turn.isnan().any(-1)
    assert torch.equal(lost, shift.isnan().all(-1))
    assert 0.08 < float(lost.float().mean()) < 0.2
    still = ObjectTrack((), torch.eye(3).expand(600, 1, 3, 3), torch.zeros(600, 1, 3))
    hand = HandTrack("right", torch.ones(600, dtype=torch.bool), joints=torch.rand(600, 21, 3))
    noisy = corrupt_object(Sequence((hand,), still, 30.0), "lost", generator=seeded())
    assert torch.equal(noisy.object.valid[:, 0], ~lost)
    assert noisy.object.translation.norm(dim=-1).max() < 0.02


def test_noise_on_the_poses_of_no_object_is_refused():
    hand = HandTrack("right", torch.ones(9, dtype=torch.bool), joints=torch.rand(9, 21, 3))
    alone = Sequence((hand,), ObjectTrack.resting((), 9), 30.0, "hand.npz")
    with pytest.raises(InputError, match="expected the poses of an object"):
        corrupt_object(alone, "lost", generator=seeded())


def test_only_the_object_of_a_sequence_is_changed():
    mesh = Mesh(torch.rand(4, 3), torch.tensor([[0, 1, 2]]))
    still = torch.eye(3).expand(30, 2, 3, 3)
    hand = HandTrack("right", torch.ones(30, dtype=torch.bool), joints=torch.rand(30, 21, 3))
    sequence = Sequence((hand,), ObjectTrack((mesh, mesh), still, torch.zeros(30, 2, 3)), 30.0)
    noisy = corrupt_object(sequence, "shaky_10", generator=seeded(3))
    assert noisy.hands is sequence.hands
    assert "shaky_10 noise of the object, seed 3" in noisy.source
    turns = Rotation.from_matrix(noisy.object.rotation.flatten(0, 1).numpy()).magnitude()
    assert turns.min() > 0
    assert not torch.equal(noisy.object.rotation[:, 0], noisy.object.rotation[:, 1])
