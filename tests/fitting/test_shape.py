import pytest
import torch
from torch import Tensor

from geneoh.fitting.shape import BONE_STD, OFFSET_STD, betas_from_lengths, betas_from_offsets
from geneoh.hand.skeleton import bone_lengths

EYE = torch.eye(3).expand(16, 3, 3)


def known(seed: int) -> Tensor:
    return torch.randn(10, generator=torch.Generator().manual_seed(seed))


def lengths_of(model, betas: Tensor) -> Tensor:
    return bone_lengths(model.shaped(betas).joints_from_rotations(EYE, torch.zeros(3)))


def pull(misses, betas: Tensor) -> float:
    """Length of the gradient of squared misses, in deviations, and of betas under their prior."""
    betas = betas.clone().requires_grad_(True)
    energy = misses(betas).square().sum() + betas.square().sum()
    return float(torch.autograd.grad(energy, betas)[0].norm())


@pytest.mark.parametrize("seed", [0, 1])
def test_a_known_skeleton_is_met(hand, seed):
    offsets = hand.shaped(known(seed)).offsets
    got = hand.shaped(betas_from_offsets(hand, offsets)).offsets
    before = (hand.shaped(torch.zeros(10)).offsets - offsets).norm(dim=-1)
    off = (got - offsets).norm(dim=-1)
    assert float(off.max()) < BONE_STD / 2
    assert float(off.mean()) < 0.3 * float(before.mean())


@pytest.mark.parametrize("seed", [0, 1])
def test_known_lengths_are_met(hand, seed):
    lengths = lengths_of(hand, known(seed))
    got = lengths_of(hand, betas_from_lengths(hand, lengths))
    before = (lengths_of(hand, torch.zeros(10)) - lengths).abs()
    assert float((got - lengths).abs().max()) < BONE_STD
    assert float((got - lengths).abs().mean()) < 0.4 * float(before.mean())


def test_the_beta_that_moves_the_skeleton_most_is_recovered(hand):
    """Others are alike to the bones, and share what the skeleton says."""
    mean = hand.shaped(torch.zeros(10)).offsets
    reach = (hand.shaped(torch.eye(10)).offsets - mean).flatten(1).norm(dim=-1)
    betas = torch.zeros(10)
    betas[reach.argmax()] = 1.5
    got = betas_from_offsets(hand, hand.shaped(betas).offsets)
    assert float((got - betas).abs().max()) < 0.3


def test_the_mean_hand_has_no_betas(hand):
    mean = hand.shaped(torch.zeros(10)).offsets
    assert float(betas_from_offsets(hand, mean).abs().max()) < 1e-4
    assert float(betas_from_lengths(hand, lengths_of(hand, torch.zeros(10))).abs().max()) < 1e-3


def test_betas_are_the_best_under_their_prior(hand):
    """Also for a person that the model cannot quite make."""
    offsets = hand.shaped(known(3)).offsets.clone()
    offsets[4] *= 1.2
    lengths = lengths_of(hand, known(3)).clone()
    lengths[7] *= 1.2

    def of_offsets(betas: Tensor) -> Tensor:
        return (hand.shaped(betas).offsets - offsets) / OFFSET_STD

    def of_lengths(betas: Tensor) -> Tensor:
        return (lengths_of(hand, betas) - lengths) / BONE_STD

    nothing = torch.zeros(10)
    assert pull(of_offsets, betas_from_offsets(hand, offsets)) < 1e-3 * pull(of_offsets, nothing)
    # the lengths' own curvature is left out of the last steps
    assert pull(of_lengths, betas_from_lengths(hand, lengths)) < 0.01 * pull(of_lengths, nothing)


def test_lengths_of_a_posed_hand_serve_as_well(hand, make_state):
    betas, state = known(2), make_state(frames=1)
    posed = hand.shaped(betas).joints_from_rotations(state.rotations, state.wrist)[0, 0]
    got = betas_from_lengths(hand, bone_lengths(posed))
    rest = betas_from_lengths(hand, lengths_of(hand, betas))
    torch.testing.assert_close(got, rest, atol=1e-2, rtol=0)
