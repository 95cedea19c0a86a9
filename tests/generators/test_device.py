"""The generators on another device: a pretended one, and CUDA where there is a GPU."""

import pytest
import torch
from made_actions import WordEncoder, made_actions
from made_bodies import SKELETON, made_motion, tiny_networks
from made_networks import TINY, answering
from made_tasks import ALL_STAGES, made_task

from geneoh.generators.both2hands import sampling as hands
from geneoh.generators.text2hoi import sampling as interactions
from geneoh.generators.text2hoi.contact import ContactNetwork
from geneoh.generators.text2hoi.length import LengthConfig, LengthNetwork
from geneoh.generators.text2hoi.library import Networks
from geneoh.generators.text2hoi.objects import Objects
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
        heard = []
        train(made_task(stage), tmp_path / place.type, device=place, on_step=heard.append)
        return [step.loss for step in heard] + [heard[-1].error_left]

    assert run(training_device) == pytest.approx(run(CPU), rel=1e-3)


def test_interactions_are_generated_alike_on_every_device(device):
    length = LengthNetwork(LengthConfig(text=WordEncoder.width)).eval()
    contact, interaction = ContactNetwork(TINY.contact).eval(), answering(TINY.interaction)
    objects = Objects.of(made_actions(count=2))
    said = "Lift a mug with the right hand.", "Push the drawer."
    lengths, config = torch.tensor([12, 7]), interactions.SamplingConfig(steps=2, draws=2)

    def made(place):
        networks = Networks(WordEncoder(), contact.to(place), interaction.to(place), length)
        actions, _ = interactions.sample(
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


def test_hands_of_a_body_are_generated_alike_on_every_device(device):
    motion = made_motion(frames=10)

    def made(place):
        networks = tiny_networks()
        for network in (networks.body, networks.text, networks.blend):
            network.to(place)
        said, config = ["the right hand waves", "both hands clap"], hands.SamplingConfig(steps=2)
        generator = torch.Generator().manual_seed(0)
        found = hands.sample(
            networks, motion.to(place), SKELETON, said, config, generator=generator
        )
        assert found.rotations.device.type == torch.device(place).type
        return found.rotations.to(CPU)

    torch.testing.assert_close(made(device), made(CPU), atol=1e-4, rtol=0)
