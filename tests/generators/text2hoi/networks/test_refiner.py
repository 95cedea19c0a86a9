from dataclasses import replace

import pytest
import torch
from made_actions import made_actions
from made_networks import TINY

from geneoh.generators.text2hoi.networks.refiner import (
    LARGEST_OFFSET,
    LayerOfEachHand,
    RefinerConfig,
    RefinerNetwork,
    RefinerWeights,
    contact_distance_loss,
    nearest,
    penetration_loss,
    points_of,
    refined_by,
    refiner_loss,
)
from geneoh.generators.text2hoi.networks.tokens import Tokens, tokens_of
from geneoh.hand.library import load_hand

PAPER = replace(TINY.refiner, form="paper", frames_per_token=1, frame="world")
FORMS = {"ours": TINY.refiner, "paper": PAPER}
SOMEWHERE = torch.full((6, 48), 0.3)  # a contact map


def network_of(form: str, *, learned: bool = True) -> RefinerNetwork:
    torch.manual_seed(0)
    network = RefinerNetwork(FORMS[form]).eval()
    return with_output(network) if learned else network


def with_output(network: RefinerNetwork) -> RefinerNetwork:
    """The network with random weights in its output, which is zero before training."""
    for parameter in network.output.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    return network


def asked(network, actions):
    """Clips, points of their objects and contact there, as the network is given them."""
    tokens = tokens_of(actions, network.config.frame)
    return tokens, *points_of(actions, tokens, SOMEWHERE, network.config.points)[:2]


@pytest.mark.parametrize("form", FORMS)
def test_an_untrained_refiner_changes_nothing_and_all_its_blocks_can_learn(form):
    network = network_of(form, learned=False)
    tokens, points, contact = asked(network, made_actions())
    found = network(tokens, points, contact)
    torch.testing.assert_close(found.hands, tokens.hands)
    with_output(network)(tokens, points, contact).hands.square().sum().backward()
    for name, parameter in network.trunk.named_parameters():
        if name.endswith("weight"):
            assert parameter.grad is not None, name
            assert parameter.grad.abs().max() > 0, name


@pytest.mark.parametrize("form", FORMS)
def test_hands_change_and_nothing_else_does(form):
    network, actions = network_of(form), made_actions()
    found = refined_by(network, actions, SOMEWHERE)
    torch.testing.assert_close(found.rotation, actions.rotation, atol=1e-5, rtol=0)
    torch.testing.assert_close(found.translation, actions.translation)
    moved = (found.wrist - actions.wrist).norm(dim=-1).amax(-1) > 0
    assert moved.equal(actions.hands)
    assert found.length.equal(actions.length)


@pytest.mark.parametrize("form", FORMS)
def test_the_paper_s_form_is_told_a_contact_map_of_zeros_and_ones(form):
    network, actions = network_of(form), made_actions()
    likely = torch.linspace(0, 1, 48).expand(6, -1)
    found, sure = (refined_by(network, actions, each).wrist for each in (likely, likely.round()))
    assert found.equal(sure) == (form == "paper")


@pytest.mark.parametrize(("form", "share"), [("ours", 0.1), ("paper", 1.0)])
def test_the_change_of_our_form_is_smooth(form, share):
    network, actions = network_of(form), made_actions()
    tokens, points, contact = asked(network, actions)
    with torch.no_grad():
        change = network(tokens, points, contact).hands - tokens.hands
    found = tokens_of(refined_by(network, actions, SOMEWHERE), network.config.frame)
    kept = found.hands - tokens.hands

    def bends(values):
        return values[..., :3].diff(n=2, dim=2)[:, :, : int(actions.length.min()) - 2].norm()

    assert bends(change) > 0
    assert bends(kept) <= 1.01 * share * bends(change)


@pytest.mark.parametrize("form", FORMS)
def test_what_stands_in_padded_frames_and_in_absent_hands_changes_nothing(form):
    network = network_of(form)
    tokens, points, contact = asked(network, made_actions())
    first = network(tokens, points, contact)
    other = replace(tokens, hands=torch.where(tokens.shown[:, :2, :, None], tokens.hands, 9.0))
    shown = tokens.valid[:, :, None, None]
    second = network(other, torch.where(shown, points, points + 1), contact)
    torch.testing.assert_close(first.hands, second.hands)
    assert not first.hands[~tokens.shown[:, :2]].any()


def test_the_paper_s_network_has_the_paper_s_size():
    """About 19.3 million: 2,273 numbers of a hand in a layer for each, and 99 out of another."""
    config = RefinerConfig("paper", 512, 8, 4, frames_per_token=1, points=1024, frame="world")
    with torch.device("meta"):
        count = sum(parameter.numel() for parameter in RefinerNetwork(config).parameters())
    layers = 8 * (4 * 512**2 + 4 * 512 + 2 * 512 * 1024 + 1024 + 512 + 4 * 512)
    assert count == layers + 2 * (2273 * 512 + 512) + 2 * (512 * 99 + 99)


def test_the_layers_of_the_paper_s_form_are_each_hand_s_own():
    network = network_of("paper")
    tokens, points, contact = asked(network, made_actions())
    before = network(tokens, points, contact).hands
    assert isinstance(network.output, LayerOfEachHand)
    for parameter in network.output.hands[0].parameters():
        torch.nn.init.zeros_(parameter)
    after = network(tokens, points, contact).hands
    torch.testing.assert_close(after[:, 0], tokens.hands[:, 0])
    torch.testing.assert_close(after[:, 1], before[:, 1])


def test_the_offset_to_the_nearest_point_is_told_up_to_its_reach():
    actions = made_actions()
    tokens = tokens_of(actions)
    joints = tokens.joints()
    points = torch.full((6, joints.shape[2], 2, 3), 50.0)
    points[..., 0, :] = joints[:, 1, :, 0] + torch.tensor([0.01, 0.0, -0.2])
    told = network_of("ours").inputs(tokens, points, torch.zeros(6, 2))[:, 1][tokens.shown[:, 1]]
    offset = told[:, -63:].unflatten(-1, (21, 3))[:, 0]
    wanted = torch.tensor([0.01, 0.0, -LARGEST_OFFSET]) / LARGEST_OFFSET
    torch.testing.assert_close(offset, wanted.expand_as(offset), atol=1e-4, rtol=0)
    near = told[:, 162 : 162 + 63].unflatten(-1, (21, 3))[:, 0]
    wanted = torch.exp(-50 * torch.tensor([0.01, 0.0, 0.2]) ** 2)
    torch.testing.assert_close(near, wanted.expand_as(near), atol=1e-4, rtol=0)


def test_nearest_points_are_those_of_a_search_one_by_one():
    draw = torch.Generator().manual_seed(0)
    joints, points = (
        torch.rand(2, 2, 3, 21, 3, generator=draw),
        torch.rand(2, 3, 9, 3, generator=draw),
    )
    found = nearest(joints, points)
    for clip, hand, frame, joint in ((0, 0, 0, 0), (1, 1, 2, 20), (1, 0, 1, 7)):
        apart = (points[clip, frame] - joints[clip, hand, frame, joint]).norm(dim=-1)
        assert found[clip, hand, frame, joint].equal(points[clip, frame, apart.argmin()])


def hand_at(height: float) -> Tokens:
    """A flat right hand whose lowest vertex is so far over the plane z = 0, metres."""
    tokens = tokens_of(made_actions(frames=12)).take(slice(0, 1), "B")
    hands = torch.zeros_like(tokens.hands)
    hands[..., 3:] = torch.tensor([1.0, 0, 0, 1, 0, 0]).repeat(16)
    flat = replace(tokens, hands=hands)
    hand = load_hand("right").shaped(torch.zeros(10))
    verts = hand.verts_from_rotations(flat.rotations[:, 1], flat.hands[:, 1, :, :3]).verts
    hands = hands.clone()
    hands[..., 2] = height - float(verts[..., 2].min())
    return replace(flat, hands=hands)


def plane() -> torch.Tensor:
    line = torch.linspace(-0.25, 0.25, 60)
    x, y = torch.meshgrid(line, line, indexing="ij")
    return torch.stack([x, y, 0 * x], dim=-1).view(1, 1, -1, 3).expand(1, 12, -1, -1)


def test_penetration_is_the_mean_squared_depth_of_vertices_inside():
    up = torch.tensor([0.0, 0, 1]).expand_as(plane())
    assert penetration_loss(hand_at(0.001), plane(), up) == 0
    tokens = hand_at(-0.004)
    hand = load_hand("right").shaped(torch.zeros(10))
    verts = hand.verts_from_rotations(tokens.rotations[:, 1], tokens.hands[:, 1, :, :3]).verts
    height = verts[..., 2]
    wanted = (100 * height[height < 0]).square().mean()
    torch.testing.assert_close(penetration_loss(tokens, plane(), up), wanted, rtol=1e-4, atol=1e-6)


def test_contact_draws_keypoints_that_were_near_to_the_point_that_was_nearest():
    points = torch.tensor([[0.0, 0, 0], [1.0, 0, 0]]).expand(1, 1, -1, -1)
    coarse = torch.full((1, 2, 1, 21, 3), 5.0)
    coarse[0, 0, 0, 0] = torch.tensor([0.015, 0.0, 0.0])
    coarse[0, 0, 0, 1] = torch.tensor([1.03, 0.0, 0.0])  # too far away to count
    shown = torch.ones(1, 2, 1, dtype=torch.bool)
    refined = coarse.clone()
    refined[0, 0, 0, 0] = torch.tensor([0.0, 0.02, 0.0])
    torch.testing.assert_close(
        contact_distance_loss(refined, coarse, points, shown), torch.tensor(4.0)
    )


def test_true_hands_leave_only_what_their_own_contact_costs():
    actions = made_actions()
    tokens = tokens_of(actions)
    points, _, normals = points_of(actions, tokens, SOMEWHERE, 24)
    alone = RefinerWeights(penetration=0.0, contact=0.0)
    assert refiner_loss(tokens, tokens, tokens, points, normals, alone) == 0
    moved = tokens.with_hands(tokens.hands + 0.02)
    assert refiner_loss(moved, tokens, tokens, points, normals, alone) > 0
