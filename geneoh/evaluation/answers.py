"""Running a baseline's network on a sequence: the same way to it and back as the cleaner's own."""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.baselines.library import Baseline
from geneoh.hand.library import load_hand
from geneoh.pipeline.denoise import RATE, stage_context
from geneoh.pipeline.subject import subject_of
from geneoh.representation.spatial import encode_spatial
from geneoh.sequence.resample import at_rate, over_frames
from geneoh.sequence.sequence import HandTrack, Sequence


@torch.no_grad()
def answer(network: Baseline, sequence: Sequence, *, seed: int) -> Float[Tensor, "T 21 3"]:
    """Keypoints that a baseline answers to the first hand of a sequence, all frames.

    Left hands are mirrored, other rates resampled, windows blended as for the cleaner; `seed` draws
    the object's surface points.
    """
    paced = at_rate(sequence, RATE)
    hand, moving = paced.hands[0], paced.object
    left = hand.side == "left"
    if left:
        hand, moving = hand.mirrored(), moving.mirrored()
    subject = subject_of(hand, load_hand("right"))
    generator = torch.Generator().manual_seed(seed)
    context = stage_context(moving.surface(), subject, paced.fps, generator=generator)
    joints = subject.joints[None]
    region = context.region(joints)
    observation = context.observation(joints, region, given=True)
    answered = network(observation, encode_spatial(observation.joints, region))
    world = context.blend(region.to_world(answered))[0]
    track = HandTrack("right", torch.ones_like(hand.valid), joints=world)
    track = track.mirrored() if left else track
    back = over_frames(replace(paced, hands=(track,)), sequence.frames).hands[0].joints
    assert back is not None, "it had joints"
    return back
