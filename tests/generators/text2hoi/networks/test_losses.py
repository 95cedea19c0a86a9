from dataclasses import replace

import pytest
import torch
from made_actions import made_actions

from geneoh.generators.text2hoi.networks.losses import (
    ERROR_UNIT,
    VELOCITY_UNIT,
    LossWeights,
    distance_loss,
    drawn_points,
    geometric_loss,
    masked_mean,
    object_places,
    orientation_loss,
    simple_loss,
    velocity_loss,
)
from geneoh.generators.text2hoi.networks.tokens import columns, tokens_of
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.synthesis.draws import Draws, Part


def draws(count: int = 6) -> Draws:
    return Draws(count, torch.Generator().manual_seed(0))


def test_a_masked_mean_is_over_what_is_true_and_zero_where_nothing_is():
    values = torch.tensor([[1.0, 2.0], [3.0, torch.nan]])
    assert masked_mean(values, torch.tensor([[True, True], [True, False]])) == 2
    assert masked_mean(values, torch.zeros(2, 1, dtype=torch.bool)) == 0


def test_items_of_a_batch_count_by_their_share():
    values = torch.tensor([[1.0, 3.0], [5.0, 7.0]])
    everywhere = torch.ones(2, 2, dtype=torch.bool)
    assert masked_mean(values, everywhere, torch.tensor([1.0, 0.5])) == (4 + 6) / 4


def test_the_simple_loss_adds_the_mean_of_each_agent():
    tokens = tokens_of(made_actions())
    clean = tokens.flat
    off = clean.clone()
    off[..., :99] += 1
    off[..., 99:198] += 2
    off[..., 198:] += 3
    assert simple_loss(off, clean, tokens.defined) == pytest.approx(1 + 4 + 9)
    right = tokens.defined.clone()
    right[..., :99] = False
    assert simple_loss(off, clean, right) == pytest.approx(4 + 9)
    outside = torch.where(tokens.defined, clean, 5.0)
    assert simple_loss(outside, clean, tokens.defined) == 0


@pytest.mark.parametrize("frame", ["object", "world"])
def test_orientations_are_compared_relative_to_the_object(frame):
    """Hands and object that turn together lose nothing; a half turn of hands costs its square."""
    actions = made_actions()
    turn = axis_angle_to_matrix(torch.tensor([0.4, -0.2, 0.3]))
    clean = tokens_of(actions, frame)
    both = replace(actions, rotation=turn @ actions.rotation)
    own = clean.hands.clone()
    if frame == "world":
        own[..., 3:9] = columns(turn @ clean.rotations[..., 0, :, :])
    found = replace(tokens_of(both, frame), hands=own)
    assert orientation_loss(found, clean) == pytest.approx(0, abs=1e-10)
    half = torch.diag(torch.tensor([-1.0, -1.0, 1.0]))
    hands = clean.hands.clone()
    hands[..., 3:9] = columns(clean.rotations[..., 0, :, :] @ half)
    expected = 2 * 4 / 9  # two columns of unit length change their sign
    assert orientation_loss(replace(clean, hands=hands), clean) == pytest.approx(expected)


def test_velocities_count_and_places_do_not():
    clean = tokens_of(made_actions())
    joints = clean.joints_on_object()
    thing = clean.object.clone()
    thing[..., :3] += 0.1
    shifted = replace(clean, object=thing)
    assert velocity_loss(shifted, clean, joints + 0.05, joints) == pytest.approx(0, abs=1e-6)
    ramp = VELOCITY_UNIT * torch.arange(20.0)
    drifting = joints.clone()
    drifting[..., 0] += ramp[:, None]
    assert velocity_loss(clean, clean, drifting, joints) == pytest.approx(1, rel=1e-4)
    thing = clean.object.clone()
    thing[..., 1] += ramp
    found = velocity_loss(replace(clean, object=thing), clean, joints, joints)
    assert found == pytest.approx(1, rel=1e-4)


def test_places_of_the_object_are_its_origin_and_ends_of_its_axes():
    turn = axis_angle_to_matrix(torch.tensor([0.0, 0.0, torch.pi / 2]))
    actions = made_actions()
    actions = replace(actions, rotation=turn.expand_as(actions.rotation)).ended()
    places = object_places(tokens_of(actions))[0, 0]
    expected = torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.1, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])
    torch.testing.assert_close(places, expected, atol=1e-6, rtol=0)


def test_distances_count_where_they_are_less_than_two_centimetres_in_truth():
    """One point and one hand: a keypoint at 1 cm that is thought to be at 3, and one at 4 cm."""
    actions = made_actions(count=1, frames=2, points=1)
    point = actions.points[:, :1]
    true = torch.full((1, 2, 2, 21, 3), 9.0)
    true[0, 1, :, 0] = point[0, 0] + torch.tensor([0.01, 0.0, 0.0])
    true[0, 1, :, 1] = point[0, 0] + torch.tensor([0.0, 0.04, 0.0])
    found = true.clone()
    found[0, 1, :, 0] = point[0, 0] + torch.tensor([0.0, 0.0, 0.03])
    found[0, 1, :, 1] += 0.01
    shown = torch.tensor([[[False, False], [True, True]]])
    given = (actions, torch.ones(1, 1), shown, LossWeights(points=1), draws(1))
    assert distance_loss(found, true, *given) == pytest.approx((0.02 / ERROR_UNIT) ** 2, rel=1e-3)
    hidden = (actions, torch.ones(1, 1), ~shown, LossWeights(points=1), draws(1))
    assert distance_loss(found, true, *hidden) == 0


def test_touched_points_are_drawn_first():
    contact = torch.zeros(6, 48)
    contact[:, 5::7] = 1
    pick = drawn_points(contact, 7, draws())
    assert contact.gather(1, pick).min() == 1
    more = drawn_points(contact, 20, draws())
    assert all(len(set(row.tolist())) == 20 for row in more)


@pytest.mark.parametrize("hands", [(True, False), (False, True), (True, True)])
def test_a_batch_without_a_hand_has_finite_losses_and_gradients(hands):
    actions = replace(made_actions(), hands=torch.tensor(hands).expand(6, 2))
    clean = tokens_of(actions)
    flat = (clean.flat + 0.1).requires_grad_()
    found, contact = clean.with_flat(flat), torch.ones(6, 48)
    weights, share = LossWeights(frames=8, points=12), torch.ones(6)
    loss = simple_loss(flat, clean.flat, clean.defined) + geometric_loss(
        found, clean, actions, contact, weights, draws(), share
    )
    loss.backward()
    assert loss.isfinite()
    assert flat.grad.isfinite().all()
    assert not flat.grad[~clean.defined].any()


def test_the_truth_costs_nothing():
    actions = made_actions()
    clean = tokens_of(actions)
    weights = LossWeights(frames=150, points=48)
    found = geometric_loss(
        clean, clean, actions, torch.ones(6, 48), weights, draws(), torch.ones(6)
    )
    assert found == pytest.approx(0, abs=1e-9)


def test_all_parts_of_a_batch_see_the_same_frames():
    actions = made_actions(count=1).take(torch.zeros(6, dtype=torch.long), "B")
    clean = tokens_of(actions)
    moved = clean.flat + torch.randn(20, 1, generator=torch.Generator().manual_seed(1))
    found, contact = clean.with_flat(moved), torch.zeros(6, 48)
    weights = LossWeights(frames=4, points=48)

    def loss(part: Part):
        some = slice(part.first, part.first + part.count)
        few = [each.take(some, "B") for each in (found, clean, actions)]
        drawn = Draws(part.count, torch.Generator().manual_seed(0), part)
        return geometric_loss(*few, contact[some], weights, drawn, torch.ones(part.count))

    whole = loss(Part(0, 6, 6))
    for part in Part(0, 6, 6).divided(3):
        torch.testing.assert_close(loss(part), whole)
