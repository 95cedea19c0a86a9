"""Training of the networks that learn from actions."""

from dataclasses import replace

import pytest
import torch
from made_actions import NAMES, WordEncoder, made_actions, passing
from made_networks import TINY, in_paper_form, tiny_data, tiny_task

from geneoh.errors import CheckpointError, ConfigError
from geneoh.generators.text2hoi.learning.samples import ActionData, draw_samples, sentences
from geneoh.generators.text2hoi.networks.autoencoders import ContactNetwork
from geneoh.generators.text2hoi.networks.interaction import LEAST_DEVIATION, Condition
from geneoh.generators.text2hoi.networks.tokens import tokens_of
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.streamed import Streamed
from geneoh.synthesis.draws import Draws
from geneoh.training.loop import train
from geneoh.training.processes import Team

CPU = torch.device("cpu")


def draws(count: int = 64) -> Draws:
    return Draws(count, torch.Generator().manual_seed(0))


def test_the_paper_s_form_learns_too_and_keeps_the_points_of_the_contact_network(tmp_path):
    points = replace(TINY.contact.points, turned=True)
    contact = ContactNetwork(replace(TINY.contact, points=points, places_alone=True))
    form = replace(in_paper_form(TINY.interaction), points=points)
    config = replace(TINY, steps=2, interaction=form, estimated=0.0)
    path = train(tiny_task("interaction", config, contact=contact), tmp_path, device=CPU)
    saved = load_checkpoint(path).tensors
    for name, tensor in contact.points.state_dict().items():
        torch.testing.assert_close(saved[f"object.points.{name}"], tensor, atol=1e-3, rtol=1e-3)
    assert saved["std"].eq(1).all()


def test_the_paper_s_form_asks_for_a_contact_network_that_reads_points_in_its_way():
    config = replace(TINY, interaction=in_paper_form(TINY.interaction))
    task = tiny_task("interaction", config, contact=ContactNetwork(TINY.contact))
    with pytest.raises(ConfigError, match="train it in the same folder first, with `geneoh train"):
        task.network()


@pytest.mark.parametrize("given", [{"encoder": 0}, {"contact": 1}])
def test_a_run_with_other_networks_before_it_is_not_continued(tmp_path, given):
    train(tiny_task("interaction", replace(TINY, steps=1)), tmp_path, device=CPU)
    task = tiny_task("interaction", replace(TINY, steps=2))
    if "contact" in given:
        task = replace(task, contact=ContactNetwork(TINY.contact))
        words = "contact network"
    else:
        other = WordEncoder()
        other.encode = lambda sentences: torch.ones(len(sentences), 8)
        task, words = replace(task, encoder=other), "text encoder"
    with pytest.raises(CheckpointError, match=f"the saved run has .*{words}"):
        train(task, tmp_path, device=CPU)


def test_a_run_whose_objects_had_other_names_is_not_continued(tmp_path):
    train(tiny_task("contact", replace(TINY, steps=1)), tmp_path, device=CPU)
    task = tiny_task("contact", replace(TINY, steps=2))
    renamed = replace(task.data.training, names=("cup", *NAMES[1:]))
    task = replace(task, data=replace(task.data, training=renamed))
    with pytest.raises(CheckpointError, match="the saved run has words of the data"):
        train(task, tmp_path, device=CPU)


def test_numbers_have_mean_zero_and_unit_variance_on_the_data():
    task = tiny_task("interaction")
    network = task.network()
    actions = task.data.training.actions.take(slice(None))
    both = [tokens_of(a) for a in (actions, actions.mirrored())]
    told = torch.cat([t.defined for t in both])
    found = torch.cat([network.normalise(t.flat) for t in both])
    count = told.sum((0, 1))
    mean = (found * told).sum((0, 1)) / count
    square = (found.square() * told).sum((0, 1)) / count
    torch.testing.assert_close(mean, torch.zeros(208), atol=1e-4, rtol=0)
    wide = network.std > LEAST_DEVIATION
    assert 20 < wide.sum() < 208
    torch.testing.assert_close(square[wide], torch.ones(int(wide.sum())), atol=1e-3, rtol=0)
    assert square.max() < 1.001


def test_sentences_name_the_hand_that_is_seen_also_in_the_mirror():
    data = tiny_data(count=3)
    every = replace(TINY, mirrored=1.0)
    drawn = draw_samples(data, every, WordEncoder(), draws())
    right_then_left = drawn.actions.hands.float().mean(0)
    assert drawn.actions.hands.any(1).all()
    one = ActionData(data.actions.only(slice(1)), NAMES)  # of a right hand
    drawn = draw_samples(one, every, WordEncoder(), draws(20))
    assert drawn.actions.hands.tolist() == [[True, False]] * 20
    said = " ".join(sentences(drawn.actions, one, draws(20))).lower()
    assert "left hand" in said
    assert "right hand" not in said
    assert right_then_left.min() > 0


@pytest.mark.parametrize(("giver", "side", "other"), [(0, "left", "right"), (1, "right", "left")])
def test_sentences_tell_an_object_s_way_from_hand_to_hand_as_it_is(giver, side, other):
    data = ActionData(Streamed.of([passing(giver)]), NAMES)
    for actions, told in ((passing(giver), side), (passing(giver).mirrored(), other)):
        many = actions.take(torch.zeros(40, dtype=torch.long), "B")
        said = " ".join(sentences(many, data, draws(40))).lower()
        assert f"from the {told} hand to" in said
        assert f"from the {({'left', 'right'} - {told}).pop()} hand to" not in said


def test_rare_verbs_are_drawn_more_often_than_their_clips():
    actions = made_actions(count=20)
    rare = torch.zeros(20, dtype=torch.long)
    rare[0] = 1
    hands = torch.tensor([False, True]).expand(20, 2)
    data = ActionData(Streamed.of([replace(actions, verb=rare, hands=hands)]), NAMES)
    for balance, share in ((0.0, 1 / 20), (1.0, 1 / 2), (0.5, 1 / (1 + 19**0.5))):
        config = replace(TINY, balance=balance, mirrored=0.0)
        drawn = draw_samples(data, config, WordEncoder(), draws(600))
        assert drawn.actions.verb.float().mean() == pytest.approx(share, abs=0.06)


def test_true_maps_are_told_in_part_and_otherwise_those_of_the_contact_network():
    data, network = tiny_data(), ContactNetwork(TINY.contact).eval()
    for share in (0.0, 0.5, 1.0):
        drawn = draw_samples(data, replace(TINY, estimated=share), WordEncoder(), draws(), network)
        same = (drawn.contact == drawn.touched).all(1).float().mean()
        assert same == pytest.approx(1 - share, abs=0.15)
        assert drawn.touched.unique().tolist() == [0, 1]


@pytest.mark.parametrize("stage", ["interaction", "refiner"])
@pytest.mark.parametrize("form", ["ours", "paper"])
def test_the_paper_s_form_learns_from_binary_maps_as_it_reads_them_later(stage, form):
    config = TINY
    if form == "paper":
        interaction, refiner = in_paper_form(TINY.interaction), replace(TINY.refiner, form="paper")
        config = replace(TINY, interaction=interaction, refiner=refiner)
    task = tiny_task(stage, config)
    network, samples = task.network(), task.pieces(0, Team(), CPU)[0].samples
    for parameter in network.parameters():  # layers that start at zero would hide the map
        torch.nn.init.normal_(parameter, std=0.1)
    likely, sure = (
        task.loss(network, replace(samples, contact=torch.full_like(samples.contact, p)), draws(6))
        for p in (0.6, 1.0)
    )
    assert likely.equal(sure) == (form == "paper")


def test_pieces_of_a_batch_are_the_batch():
    task = tiny_task("interaction", replace(TINY, accumulate=2))
    whole = tiny_task("interaction").pieces(0, Team(), CPU)[0].samples
    first, second = (piece.samples for piece in task.pieces(0, Team(), CPU))
    assert len(first.text) == len(second.text) == 3
    for name in ("text", "touched"):
        both = torch.cat([getattr(first, name), getattr(second, name)])
        torch.testing.assert_close(both, getattr(whole, name))
    halves = [task.pieces(0, Team(rank, 2), CPU)[0].samples.text for rank in (0, 1)]
    assert not halves[0].equal(halves[1])


def test_clips_of_all_parts_of_a_batch_have_its_longest_ones_frames():
    task = tiny_task("interaction")  # of clips of 15 and 20 frames
    lone = [task.pieces(0, Team(rank, 6), CPU)[0].samples.actions for rank in range(6)]
    assert {int(clip.length) for clip in lone} == {15, 20}
    assert {clip.joint.shape[1] for clip in lone} == {20}


def test_a_generator_s_run_goes_on_with_as_many_pieces_of_a_batch(tmp_path):
    train(tiny_task("contact", replace(TINY, steps=1)), tmp_path, device=CPU)
    other = tiny_task("contact", replace(TINY, steps=2, accumulate=2))
    with pytest.raises(CheckpointError, match="the saved run has accumulate 1 where 2"):
        train(other, tmp_path, device=CPU)


def test_an_untrained_network_leaves_motion_of_little_noise_as_it_is():
    """The clips vary along fewer axes than a token has features."""
    task = tiny_task("interaction", replace(TINY, interaction=replace(TINY.interaction, width=96)))
    network = task.network()
    drawn = draw_samples(task.data.training, task.config, WordEncoder(), draws(6))
    tokens = tokens_of(drawn.actions)
    clean = network.normalise(tokens.flat) * tokens.defined
    told = torch.ones(6, dtype=torch.bool)
    condition = Condition(
        drawn.text, drawn.objects, drawn.contact, tokens.present, tokens.valid, told, told
    )
    with torch.no_grad():
        found = network.denoised(clean, torch.ones(6), network.encode(condition))
    off, size = (each[tokens.defined].square().mean() for each in (found - clean, clean))
    assert off < 0.01 * size
