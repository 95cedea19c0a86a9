from dataclasses import replace

import pytest
import torch
from made_bodies import SKELETON, made_motion, tiny_networks

from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import BODY_JOINTS, Skeleton
from geneoh.errors import CheckpointError
from geneoh.generators.both2hands.sampling import Both2HandsSampling, generate_hands, sample_hands
from geneoh.generators.both2hands.windows import FRAMES

SENTENCES = ["the right hand waves", "both hands clap"]
FEW = Both2HandsSampling(steps=2)


def drawn(networks, motion, sentences=SENTENCES, config=FEW, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return sample_hands(networks, motion, SKELETON, sentences, config, generator=generator)


@pytest.mark.parametrize("form", ["ours", "paper"])
@pytest.mark.parametrize("frames", [2, FRAMES + 10])
def test_bodies_of_any_length_keep_their_motion_and_get_fingers(form, frames):
    motion = made_motion(frames=frames)
    made = drawn(tiny_networks(form), motion)
    assert torch.equal(made.root, motion.root)
    body, fingers = made.rotations.split([BODY_JOINTS, 30], dim=2)
    assert torch.equal(body, motion.rotations[:, :, :BODY_JOINTS])
    unit = torch.eye(3).expand_as(fingers)
    torch.testing.assert_close(fingers @ fingers.mT, unit, atol=1e-4, rtol=0)


@pytest.mark.parametrize("branch", ["blended", "body", "text"])
def test_a_branch_listens_to_what_it_is_told_and_to_nothing_else(branch):
    networks, motion = tiny_networks(), made_motion(frames=10)
    config = replace(FEW, branch=branch)
    made = drawn(networks, motion, config=config).rotations
    said = drawn(networks, motion, SENTENCES[::-1], config).rotations
    flipped = motion.map(lambda x: x.flip(0))
    moved = drawn(networks, flipped, config=config).rotations
    fingers = slice(BODY_JOINTS, None)
    heard = not torch.allclose(made[:, :, fingers], said[:, :, fingers], atol=1e-4)
    saw = not torch.allclose(made[:, :, fingers], moved[:, :, fingers], atol=1e-4)
    assert (heard, saw) == (branch != "body", branch != "text")


def test_the_fingers_of_the_input_do_not_matter():
    motion, networks = made_motion(frames=10), tiny_networks()
    bare = motion.rotations.clone()
    bare[:, :, BODY_JOINTS:] = torch.eye(3)
    found = drawn(networks, BodyMotion(motion.root, bare))
    torch.testing.assert_close(found.rotations, drawn(networks, motion).rotations)


def test_a_body_elsewhere_gets_the_same_hands():
    networks, motion = tiny_networks(), made_motion(frames=10)
    there = BodyMotion(motion.root + torch.tensor([50.0, 0.0, -20.0]), motion.rotations)
    found = drawn(networks, there).rotations
    torch.testing.assert_close(found, drawn(networks, motion).rotations, atol=1e-3, rtol=0)


def test_equal_seeds_make_equal_hands_and_others_other_ones():
    networks, motion = tiny_networks(), made_motion(frames=10)
    first, again, other = (drawn(networks, motion, seed=seed).rotations for seed in (0, 0, 1))
    assert torch.equal(first, again)
    assert not torch.allclose(first, other, atol=1e-4)


def test_smoothing_takes_away_what_shakes():
    motion, networks = made_motion(bodies=1, frames=20), tiny_networks()
    shaking, smooth = (
        drawn(networks, motion, SENTENCES[:1], replace(FEW, smoothing=frames)).rotations
        for frames in (0.0, 1.5)
    )
    one, other = (x[:, :, BODY_JOINTS:].diff(n=2, dim=1).abs().mean() for x in (shaking, smooth))
    assert other < 0.5 * one


def test_the_paper_s_sampler_takes_steps_with_noise():
    motion, config = made_motion(bodies=1, frames=4), Both2HandsSampling("ancestral", steps=3)
    made = drawn(tiny_networks(), motion, SENTENCES[:1], config)
    assert made.rotations.isfinite().all()


def test_damaged_weights_are_told():
    networks = tiny_networks()
    networks.body.outputs[0].bias.fill_(torch.nan)
    with pytest.raises(CheckpointError, match="NaN"):
        drawn(networks, made_motion(frames=4))


def test_one_body_and_a_sentence_become_hands_that_skeletons_pose():
    motion = made_motion(bodies=1, frames=12)
    one = BodyMotion(motion.root[0], motion.rotations[0])
    heard = []
    made = generate_hands(
        one,
        Skeleton(1.1 * SKELETON.offsets),
        "the left hand waves",
        steps=3,
        generator=torch.Generator().manual_seed(0),
        networks=tiny_networks(),
        on_step=lambda done, of: heard.append((done, of)),
    )
    assert made.rotations.shape == (12, 52, 3, 3)
    assert heard == [(1, 3), (2, 3), (3, 3)]
    assert pose(SKELETON, made).positions.isfinite().all()
