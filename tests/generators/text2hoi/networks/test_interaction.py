from dataclasses import replace

import pytest
import torch
from made_actions import made_actions
from made_networks import TINY, answering, in_paper_form

from geneoh.generators.text2hoi.networks.interaction import (
    Condition,
    InteractionConfig,
    InteractionNetwork,
    moments,
)
from geneoh.generators.text2hoi.networks.objects import Objects, PointConfig
from geneoh.generators.text2hoi.networks.principal_axes import Waves
from geneoh.generators.text2hoi.networks.tokens import tokens_of
from geneoh.nn.blocks import in_steps, sinusoid

FORMS = {
    "ours": TINY.interaction,
    "without places": replace(TINY.interaction, object_tokens=0),
    "paper": in_paper_form(TINY.interaction),
}


def network_of(form: str) -> InteractionNetwork:
    return answering(FORMS[form])


def condition_of(seed: int = 1) -> Condition:
    """Six clips: a right hand, a left one and both in turn."""
    actions = made_actions()
    draw = torch.Generator().manual_seed(seed)
    told = torch.ones(6, dtype=torch.bool)
    text, contact = torch.randn(6, 8, generator=draw), torch.rand(6, 48, generator=draw)
    return Condition(text, Objects.of(actions), contact, actions.hands, actions.valid, told, told)


def answer(network: InteractionNetwork, x: torch.Tensor, condition: Condition) -> torch.Tensor:
    with torch.no_grad():
        return network.denoised(x, torch.full((6,), 300.0), network.encode(condition))


def own_of(network: InteractionNetwork, x: torch.Tensor) -> list[torch.Tensor]:
    """The numbers of each agent in each step, as the network embeds them."""
    steps = in_steps(x, network.config.frames_per_token).split([99, 99, 10], dim=-1)
    own = [agent.flatten(-2) for agent in steps]
    pairs = zip(network.codecs, own, strict=True) if network.codecs else ()
    waves = Waves.of(torch.ones(6, own[0].shape[1], dtype=torch.bool), 38)
    return [torch.cat(axes.read(n, torch.ones(6), waves), -1) for axes, n in pairs] or own


def noise(seed: int = 0) -> torch.Tensor:
    return torch.randn(6, 20, 208, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("form", FORMS)
def test_what_stands_in_padded_frames_and_in_absent_hands_changes_nothing(form):
    network, condition = network_of(form), condition_of()
    told = tokens_of(made_actions()).defined
    first = answer(network, noise(), condition)
    second = answer(network, torch.where(told, noise(), 100 * noise(1)), condition)
    assert first.equal(second)
    assert not first[~told].any()
    assert first[told].abs().min() > 0


@pytest.mark.parametrize("form", FORMS)
def test_more_padding_changes_nothing(form):
    network, condition = network_of(form), condition_of()
    more = replace(condition, valid=torch.nn.functional.pad(condition.valid, (0, 9)))
    x = torch.nn.functional.pad(noise(), (0, 0, 0, 9), value=7.0)
    longer = answer(network, x, more)
    torch.testing.assert_close(longer[:, :20], answer(network, noise(), condition))
    assert not longer[:, 20:].any()


@pytest.mark.parametrize("form", FORMS)
def test_the_answer_depends_on_sentence_object_contact_and_level(form):
    network, condition = network_of(form), condition_of()
    before = answer(network, noise(), condition)
    changes = (
        replace(condition, text=condition.text + 1),
        replace(condition, contact=1 - condition.contact),
        replace(condition, objects=replace(condition.objects, points=2 * condition.objects.points)),
        condition.without_text(),
    )
    for other in changes:
        assert (answer(network, noise(), other) - before).abs().amax((1, 2)).min() > 1e-5
    with torch.no_grad():
        level = network.denoised(noise(), torch.full((6,), 900.0), network.encode(condition))
    assert not level.allclose(before)


@pytest.mark.parametrize("form", FORMS)
def test_an_object_that_is_not_told_has_no_effect(form):
    network, condition = network_of(form), condition_of()
    untold = replace(condition, object_given=torch.zeros(6, dtype=torch.bool))
    moved = replace(condition.objects, points=condition.objects.points.flip(0))
    first = answer(network, noise(), untold)
    second = answer(network, noise(), replace(untold, objects=moved, contact=1 - untold.contact))
    torch.testing.assert_close(first, second)


def test_tokens_are_the_condition_then_left_right_and_object_step_by_step():
    network, condition = network_of("paper"), condition_of()
    for layer in network.inputs:
        torch.nn.init.zeros_(layer.weight)
    for value, layer in enumerate(network.inputs, 1):
        torch.nn.init.constant_(layer.bias, float(value))
    told = network.encode(condition)
    tokens, position = network.sequence(own_of(network, noise()), told)
    assert tokens.shape == (6, 1 + 3 * 20, 16)
    assert position.tolist() == [0.0] + [s for s in range(1, 21) for _ in range(3)]
    agents = sinusoid(torch.tensor([1.0, 1666.0, 3333.0]), 16)
    expected = torch.tensor([[1.0], [2.0], [3.0]]) + agents
    for step in (0, 7, 19):
        torch.testing.assert_close(tokens[0, 1 + 3 * step : 4 + 3 * step], expected)
    assert tokens[:, :1].equal(told.tokens)


def test_several_frames_of_an_agent_make_one_token():
    network, condition = network_of("ours"), condition_of()
    told = network.encode(condition)
    assert told.tokens.shape == (6, 1 + 5, 16)
    tokens, position = network.sequence(own_of(network, noise()), told)
    assert tokens.shape == (6, 6 + 3 * 5, 16)
    assert position.tolist() == [0.0] * 6 + [s for s in range(1, 6) for _ in range(3)]
    changed = noise()
    changed[:, 4:8, 100] += 1  # the right hand in the second token
    moved = (network.sequence(own_of(network, changed), told)[0] - tokens).abs().amax((0, 2)) > 1e-4
    assert moved.nonzero().flatten().tolist() == [6 + 3 + 1]


def test_a_step_is_seen_if_any_of_its_frames_is_before_the_end():
    told = network_of("ours").encode(condition_of())
    assert told.step_seen[0].tolist() == [[False, True, True]] * 5
    assert told.step_seen[1].tolist() == [[True, False, True]] * 4 + [[False] * 3]
    assert told.step_seen[2].tolist() == [[True, True, True]] * 5


def test_moments_tell_the_time_from_the_start_and_to_the_end():
    steps = torch.tensor([[[True] * 10, [True] * 10, [True] * 10, [False] * 10]])
    found = moments(steps)[0]
    torch.testing.assert_close(found[:, 0], torch.tensor([5.0, 15, 25, 35]) / 30)
    torch.testing.assert_close(found[:, 1] * 150, torch.tensor([5.0, 15, 25, 35]))
    torch.testing.assert_close(found[:, 2] * 150, torch.tensor([25.0, 15, 5, 0]))
    torch.testing.assert_close(found[0, 3:].log(), torch.tensor([-0.5, -2.5]))


def test_the_paper_s_network_has_the_paper_s_size():
    """About 19.0 million, without the PointNet, which is that of the contact network."""
    config = InteractionConfig(
        form="paper",
        width=512,
        depth=8,
        heads=4,
        frames_per_token=1,
        text=512,
        object_points=1024,
        points=PointConfig(64, 128, 1024, turned=True),
    )
    network = InteractionNetwork(config)
    counted = {n: p.numel() for n, p in network.named_parameters()}
    own = sum(c for n, c in counted.items() if not n.startswith("object.points."))
    layers = 8 * (4 * 512**2 + 4 * 512 + 2 * 512 * 1024 + 1024 + 512 + 4 * 512)
    told = 2 * (512**2 + 512) + (512**2 + 512) + (2052 * 512 + 512)
    ends = 2 * (99 * 512 + 512) + (10 * 512 + 512) + 2 * (1024 * 99 + 99) + (512 * 10 + 10)
    assert own == layers + told + ends
    assert round(own / 1e6, 1) == 19.0
