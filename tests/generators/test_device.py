"""The generators on another device: a pretended one, and CUDA where there is a GPU."""

import bodies
import pytest
import torch
import trimesh
from made_actions import WordEncoder, made_actions
from made_bodies import SKELETON, made_motion, tiny_networks
from made_networks import TINY, answering
from made_tasks import ALL_STAGES, made_task
from stage_runs import heard_losses

from geneoh.generators.both2hands import on_body
from geneoh.generators.both2hands import sampling as hands
from geneoh.generators.text2hoi import generate as acting
from geneoh.generators.text2hoi import sampling as interactions
from geneoh.generators.text2hoi.generate import GenerateOptions
from geneoh.generators.text2hoi.networks.autoencoders import (
    ContactNetwork,
    LengthConfig,
    LengthNetwork,
)
from geneoh.generators.text2hoi.networks.library import Text2HoiNetworks
from geneoh.generators.text2hoi.networks.objects import Objects
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.training import loop
from geneoh.training.loop import train

CPU = torch.device("cpu")


@pytest.mark.parametrize("stage", ALL_STAGES)
def test_a_network_learns_and_is_validated_alike_on_every_device(
    stage, training_device, tmp_path, monkeypatch
):
    # rounding of bfloat16 would decide on the direction of the first steps of small gradients
    monkeypatch.setattr(loop, "quick_precision", lambda device: torch.float32)

    def run(place):
        with heard_losses() as (losses, errors):
            train(made_task(stage), tmp_path / place.type, device=place)
        return [*losses, errors[-1]]

    assert run(training_device) == pytest.approx(run(CPU), rel=1e-3)


def test_interactions_are_generated_alike_on_every_device(device):
    length = LengthNetwork(LengthConfig(text=WordEncoder.width)).eval()
    contact, interaction = ContactNetwork(TINY.contact).eval(), answering(TINY.interaction)
    objects = Objects.of(made_actions(count=2))
    said = "Lift a mug with the right hand.", "Push the drawer."
    lengths, config = torch.tensor([12, 7]), interactions.Text2HoiSampling(steps=2, draws=2)

    def made(place):
        networks = Text2HoiNetworks(WordEncoder(), contact.to(place), interaction.to(place), length)
        actions, _ = interactions.sample_actions(
            networks,
            objects.to(place),
            said,
            ("right hand", "left hand"),
            lengths,
            config,
            generator=torch.Generator().manual_seed(0),
        )
        assert actions.wrist.device.type == torch.device(place).type
        return actions.to(CPU)

    there, here = made(device), made(CPU)
    torch.testing.assert_close(there.wrist, here.wrist, atol=1e-4, rtol=0)
    torch.testing.assert_close(there.translation, here.translation, atol=1e-4, rtol=0)


@pytest.mark.parametrize(
    ("sentence", "refine"),
    [("Lift the box.", "paper"), ("Pass the box from the left hand to the right hand.", "none")],
)
def test_a_sentence_is_acted_out_on_the_device_that_is_named(device, monkeypatch, sentence, refine):
    length = LengthNetwork(LengthConfig(text=WordEncoder.width)).eval()
    contact, interaction = ContactNetwork(TINY.contact).eval(), answering(TINY.interaction)

    def loaded(folder, *, text_encoder, device):
        heard.append(str(device))
        return Text2HoiNetworks(WordEncoder(), contact.to(device), interaction.to(device), length)

    heard = list[str]()
    monkeypatch.setattr(acting, "load_text2hoi", loaded)
    mesh = from_trimesh(trimesh.creation.box((0.05, 0.06, 0.1)))

    def made(place):
        asked = GenerateOptions(frames=20, steps=3, draws=2, refine=refine, device=place)
        return acting.generate(sentence, mesh, asked)

    there, here = made(str(device)), made("cpu")
    assert heard == [str(device), "cpu"]
    assert there.contact.device == there.sequence.hands[0].valid.device == CPU
    torch.testing.assert_close(there.contact, here.contact, atol=1e-4, rtol=0)
    joints = (each.sequence.hands[0].joints for each in (there, here))
    torch.testing.assert_close(*joints, atol=1e-4, rtol=0)


def test_hands_are_given_to_a_body_on_the_device_that_is_named(device, monkeypatch):
    def loaded(folder, *, text_encoder, device):
        networks = tiny_networks()
        for network in (networks.body, networks.text, networks.blend):
            network.to(device)
        return networks

    monkeypatch.setattr(on_body, "load_both2hands", loaded)

    def made(place):
        asked = on_body.BodyOptions(steps=2, device=place)
        return on_body.generate_on_body("the right hand waves", bodies.recording(), asked)

    there, here = (made(place).body.motion.rotations for place in (str(device), "cpu"))
    assert there.device == CPU
    torch.testing.assert_close(there, here, atol=1e-4, rtol=0)


def test_hands_of_a_body_are_generated_alike_on_every_device(device):
    motion = made_motion(frames=10)

    def made(place):
        networks = tiny_networks()
        for network in (networks.body, networks.text, networks.blend):
            network.to(place)
        said, config = (
            ["the right hand waves", "both hands clap"],
            hands.Both2HandsSampling(steps=2),
        )
        generator = torch.Generator().manual_seed(0)
        found = hands.sample_hands(
            networks, motion.to(place), SKELETON, said, config, generator=generator
        )
        assert found.rotations.device.type == torch.device(place).type
        return found.rotations.to(CPU)

    torch.testing.assert_close(made(device), made(CPU), atol=1e-4, rtol=0)
