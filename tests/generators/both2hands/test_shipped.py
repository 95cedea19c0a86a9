"""The weights in the package."""

import pytest
import torch
from made_bodies import SKELETON, made_motion

from geneoh.body.motion import BodyMotion
from geneoh.body.skeleton import BODY_JOINTS
from geneoh.generators.both2hands.generate import generate_hands
from geneoh.generators.both2hands.library import SHIPPED, load_networks


@pytest.fixture(scope="module")
def networks():
    return load_networks()


def fingers(networks, sentence):
    motion = made_motion(bodies=1, frames=30)
    one = BodyMotion(motion.root[0], motion.rotations[0])
    generator = torch.Generator().manual_seed(0)
    how = {"steps": 4, "generator": generator, "networks": networks}
    return generate_hands(one, SKELETON, sentence, **how).rotations[:, BODY_JOINTS:]


def test_the_weights_of_all_networks_take_less_than_ten_megabytes():
    assert sum(path.stat().st_size for path in SHIPPED.iterdir()) < 10_000_000


def test_another_sentence_changes_shipped_hands(networks):
    waves = fingers(networks, "the right hand waves, the left hand rests")
    fist = fingers(networks, "both hands make a fist")
    assert (waves - fist).abs().mean() > 0.002
