"""TemporalDiff and its form of the paper with stand-in networks, whose right answers are known."""

from dataclasses import replace

import pytest
import torch
from ball_scenes import LONG, PLAN, hands_at, scene
from draws import normal, seeded
from torch import Tensor, nn

from geneoh.denoisers.latent import LatentConfig, LatentDenoiser
from geneoh.denoisers.temporal import StepCorrection, TemporalConfig, TemporalDenoiser
from geneoh.fitting.align import AlignConfig
from geneoh.pipeline.stages.context import StageContext
from geneoh.pipeline.stages.denoising import denoise_temporal
from geneoh.pipeline.stages.paper import ALIGN_POINTS, denoise_latent
from geneoh.representation.temporal import PairStatistics, encode_temporal

ALIGN = AlignConfig(steps=20)
LEFT = 5e-4
"""Metres that the alignment may move a hand whose relations agree: Adam enlarges rounding."""


class KnownSteps(TemporalDenoiser):
    """Answers that the keypoints stand still over the surface near them, and is sure of it."""

    def __init__(self, sure: float = 6.0) -> None:
        super().__init__(TemporalConfig(width=16, depth=1, heads=2))
        self.sure, self.seen = sure, []

    def forward(self, evidence):
        self.seen.append(evidence)
        steps = torch.cat([evidence.steps[:, :-1], evidence.steps[:, -2:-1]], dim=1)
        weight = steps.new_full(steps.shape[:-1], self.sure)
        return StepCorrection(-steps, weight, -weight)


class TableAutoencoder(nn.Module):
    """Decodes every latent to the same statistics."""

    def __init__(self, statistics: PairStatistics | None) -> None:
        super().__init__()
        self.statistics = statistics

    def encode(self, relations, points):
        return points.new_zeros(*points.shape[:2], 6)

    def decode(self, latent, object_velocity, normals, points):
        return self.statistics


class KnownLatent(LatentDenoiser):
    """Answers with a latent of ones, which is decoded to given statistics."""

    def __init__(self, statistics: PairStatistics | None) -> None:
        super().__init__(LatentConfig(latent=6, point_width=8, width=16, depth=1, heads=2))
        self.autoencoder = TableAutoencoder(statistics)

    def forward(self, x, sigma):
        return torch.ones_like(x)


def relations_of(context: StageContext, joints: Tensor, hand: Tensor) -> PairStatistics:
    """Statistics of `hand` around the points that `joints` is aligned at."""
    region = context.region(joints).nearest(context.windows(joints), ALIGN_POINTS)
    return encode_temporal(context.windows(hand), region, context.fps)


def random_statistics(like: PairStatistics, seed: int) -> PairStatistics:
    names = PairStatistics.__dataclass_fields__
    values = {
        name: 0.05 * normal(*getattr(like, name).shape, seed=seed + i).abs()
        for i, name in enumerate(names)
    }
    return PairStatistics(**values)


def run_latent(model, joints: Tensor, context: StageContext, seed: int = 0) -> Tensor:
    return denoise_latent(model, joints, context, PLAN, align=ALIGN, generator=seeded(seed))


@pytest.mark.parametrize("frames", [12, LONG])
def test_a_hand_that_is_to_stand_still_over_the_object_does(frames):
    context = scene(frames, parts=1)
    joints = hands_at(context) + 0.002 * normal(2, frames, 21, 3, seed=50)
    got = denoise_temporal(KnownSteps(), joints[:1], joints, context)
    before, after = (
        ((hand - context.translation[:, :1]) @ context.rotation[:, 0]).mean(0)
        for hand in (joints, got)
    )
    assert float(after.diff(dim=0).norm(dim=-1).max()) < 1e-5
    # in the middle of where it was, and the samples differ as before
    torch.testing.assert_close(after.mean(0), before.mean(0), atol=1e-5, rtol=0)
    torch.testing.assert_close(got[0] - got[1], joints[0] - joints[1], atol=1e-6, rtol=0)


@pytest.mark.parametrize("frames", [60, LONG])
def test_many_steps_to_one_side_move_no_hand_away(frames):
    class OneSided(KnownSteps):
        """Answers that every step should lead 2 mm more to one side."""

        def forward(self, evidence):
            change = torch.tensor([0.002, 0.0, 0.0]).expand_as(evidence.steps)
            return replace(super().forward(evidence), change=change)

    context = scene(frames, parts=1)
    joints = hands_at(context)
    got = denoise_temporal(OneSided(), joints, joints, context)
    moved = (got - joints).norm(dim=-1)
    assert float(moved[:, 20:-20].max()) < 0.01
    assert float(moved.max()) < 0.03


def test_a_finger_holds_on_to_the_part_that_it_touches():
    context = scene(12, parts=2)
    turn, shift = context.rotation, context.translation
    other = replace(context, rotation=turn.flip(1), translation=shift.flip(1))
    touches = torch.arange(21) % 2  # the part that each keypoint is at
    joints = torch.where(touches[:, None] == 0, hands_at(context), hands_at(other))
    joints = joints + 0.002 * normal(*joints.shape, seed=50)
    got = denoise_temporal(KnownSteps(), joints, joints, context)
    for part in (0, 1):
        before, after = (
            ((hand[0] - shift[:, None, part]) @ turn[:, part])[:, touches == part].diff(dim=0)
            for hand in (joints, got)
        )
        assert float(after.norm(dim=-1).max()) < 0.1 * float(before.norm(dim=-1).max())


def test_steps_that_are_right_leave_the_hand():
    context = scene(LONG)
    joints = hands_at(context, 2)
    model = TemporalDenoiser(TemporalConfig(width=16, depth=1, heads=2)).requires_grad_(False)
    got = denoise_temporal(model, joints[:1], joints, context)
    torch.testing.assert_close(got, joints, atol=1e-6, rtol=0)


def test_decoded_relations_of_the_hand_itself_leave_it():
    context = scene()
    joints = hands_at(context)
    model = KnownLatent(relations_of(context, joints, joints))
    got = run_latent(model, joints, context)
    assert float((got - joints).norm(dim=-1).max()) < LEFT


def test_the_hand_moves_to_the_relations_that_are_decoded():
    context = scene()
    goal = hands_at(context)
    joints = goal + 0.002 * normal(*goal.shape, seed=50)
    clean = relations_of(context, joints, goal)
    got = run_latent(KnownLatent(clean), joints, context)

    def unlike(hand: Tensor) -> float:
        now = relations_of(context, joints, hand)
        return float((now.velocity - clean.velocity).norm(dim=-1).mean())

    assert unlike(got) < 0.6 * unlike(joints)


def test_nonsense_of_the_decoder_reaches_the_hand():
    context = scene()
    joints = hands_at(context)
    nonsense = random_statistics(relations_of(context, joints, joints), 30)
    got = run_latent(KnownLatent(nonsense), joints, context)
    assert float((got - joints).norm(dim=-1).max()) > 4 * LEFT


def test_a_single_frame_has_no_motion_to_denoise():
    context = scene(1)
    joints = hands_at(context)
    assert run_latent(KnownLatent(None), joints, context) is joints
    assert denoise_temporal(KnownSteps(), joints, joints, context) is joints
