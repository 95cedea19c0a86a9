"""The stages with stand-in networks, whose right answers are known in closed form."""

import math
from dataclasses import replace

import networks
import pytest
import torch
from torch import Tensor, nn

from geneoh.denoisers.latent import LatentConfig, LatentDenoiser
from geneoh.denoisers.motion import MotionConfig, MotionDenoiser
from geneoh.denoisers.relations import RelationConfig, RelationDenoiser
from geneoh.denoisers.spatial import SpatialConfig, SpatialDenoiser
from geneoh.denoisers.temporal import StepCorrection, TemporalConfig, TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryConfig, TrajectoryDenoiser
from geneoh.fitting.align import AlignConfig
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.pipeline.context import StageContext
from geneoh.pipeline.presets import PlacePlan, StagePlan
from geneoh.pipeline.stages import (
    ALIGN_POINTS,
    denoise_latent,
    denoise_motion,
    denoise_relations,
    denoise_spatial,
    denoise_temporal,
    denoise_trajectory,
)
from geneoh.representation.parameters import HandParameters
from geneoh.representation.spatial import SpatialRelations
from geneoh.representation.temporal import PairStatistics, encode_temporal

PLAN = StagePlan(400, 3)
ALIGN = AlignConfig(steps=20)
LEFT = 5e-4
"""Metres that the alignment may move a hand whose relations agree: Adam enlarges rounding."""
LONG = 90
"""Frames of two windows, which share the frames 30 to 59."""
TURN, SHIFT = axis_angle_to_matrix(torch.tensor([0.3, -0.8, 0.5])), torch.tensor([0.4, 1.0, -0.2])


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def normal(*shape: int, seed: int = 0) -> Tensor:
    return networks.normal(*shape, seed=seed)


def smooth(frames: int, *shape: int, seed: int = 0) -> Tensor:
    """Numbers of order one that change slowly over the frames."""
    time = torch.linspace(0, 0.05 * frames, frames).view(-1, *[1] * len(shape))
    return torch.sin(time + 3 * normal(*shape, seed=seed))


def scene(frames: int = 12, parts: int = 2) -> StageContext:
    """A ball of 4 cm whose parts move by themselves."""
    normals = torch.nn.functional.normalize(normal(60, 3, seed=1), dim=-1)
    return StageContext(
        points=0.04 * normals,
        normals=normals,
        part=torch.arange(60) % parts,
        rotation=axis_angle_to_matrix(0.5 * smooth(frames, parts, 3, seed=2)),
        translation=0.1 * smooth(frames, parts, 3, seed=3),
        trust=torch.ones(frames, 21),
        fps=30.0,
    )


def hands_at(context: StageContext, samples: int = 1, seed: int = 4) -> Tensor:
    """Keypoints within a centimetre of the ball, world frame."""
    around = torch.nn.functional.normalize(normal(21, 3, seed=seed), dim=-1)
    local = 0.046 * around + 0.003 * smooth(context.frames, 21, 3, seed=seed + 1)
    world = local @ context.rotation[:, 0].mT + context.translation[:, :1]
    return world.expand(samples, -1, -1, -1)


def parameters_at(context: StageContext, seed: int = 6) -> HandParameters:
    """A hand at the ball as parameters, world frame, one sample."""
    frames = context.frames
    turn = axis_angle_to_matrix(0.5 * smooth(frames, 3, seed=seed + 1))
    return HandParameters(
        (context.translation[:, 0] + 0.05 * smooth(frames, 3, seed=seed))[None],
        turn[None],
        0.3 * smooth(frames, 15, 3, seed=seed + 2)[None],
        load_hand("right").shaped(torch.zeros(1, 10)).offsets,
    )


def moved(context: StageContext) -> StageContext:
    """The same scene elsewhere in the world."""
    return replace(
        context, rotation=TURN @ context.rotation, translation=context.translation @ TURN.T + SHIFT
    )


class KnownChange(MotionDenoiser):
    """Answers with the change that leads from the observed windows to those of `goal`."""

    def __init__(self, goal: HandParameters) -> None:
        super().__init__(MotionConfig(width=16, depth=1, heads=2))
        self.goal = goal

    def forward(self, x, sigma, observed):
        times = len(x) // len(self.goal.wrist)
        goal = self.goal.map(lambda v: v.repeat(times, *[1] * (v.ndim - 1)))
        return observed.hand.change_to(goal)


class KnownWindows(TrajectoryDenoiser):
    """Answers with the same canonical windows whatever the input."""

    def __init__(self, windows: Tensor) -> None:
        super().__init__(TrajectoryConfig(width=16, depth=1, heads=2))
        self.windows = windows

    def forward(self, x, sigma):
        return self.windows


class KnownRelations(RelationDenoiser):
    """Answers with `hand` of the noisy relations and the observation, which it keeps."""

    def __init__(self, hand) -> None:
        super().__init__(RelationConfig(width=16, depth=1, heads=2, point_width=8))
        self.hand, self.given = hand, []

    def forward(self, noisy, sigma, observation):
        self.given.append(observation.given)
        return self.hand(noisy, observation)


class TableAutoencoder(nn.Module):
    """Decodes every latent to the same statistics."""

    def __init__(self, statistics: PairStatistics) -> None:
        super().__init__()
        self.statistics = statistics

    def encode(self, relations, points):
        return points.new_zeros(*points.shape[:2], 6)

    def decode(self, latent, object_velocity, normals, points):
        return self.statistics


class KnownLatent(LatentDenoiser):
    """Answers with a latent of ones, which is decoded to given statistics."""

    def __init__(self, statistics: PairStatistics) -> None:
        super().__init__(LatentConfig(latent=6, point_width=8, width=16, depth=1, heads=2))
        self.autoencoder = TableAutoencoder(statistics)
        self.given = []

    def forward(self, x, sigma, observed, given):
        self.given.append(given)
        return torch.ones_like(x)


def canonical(context: StageContext, joints: Tensor, goal: Tensor) -> Tensor:
    """Windows of `goal` in the canonical frames of the windows of `joints`."""
    return context.region(joints).to_canon(context.windows(goal))


def relations_of(context: StageContext, joints: Tensor, hand: Tensor) -> PairStatistics:
    """Statistics of `hand` around the points that `joints` is aligned at."""
    region = context.region(joints).nearest(context.windows(joints), ALIGN_POINTS)
    return encode_temporal(context.windows(hand), region, context.fps)


# MotionDiff


def test_motion_gives_the_hand_that_the_network_answers():
    context = scene(LONG)
    hand, goal = parameters_at(context), parameters_at(context, seed=20)
    region = context.region(hand.joints)
    windows = HandParameters(
        *(context.windows(getattr(goal, name)) for name in ("wrist", "turn", "fingers")),
        goal.offsets.expand(len(region.center), 20, 3),
    )
    model = KnownChange(windows.to_canon(region))
    got = denoise_motion(model, hand, context, PLAN, samples=3, generator=seeded())
    assert got.wrist.shape == (3, LONG, 3)
    torch.testing.assert_close(got.wrist, goal.wrist.expand(3, -1, -1), atol=1e-5, rtol=0)
    torch.testing.assert_close(got.joints, goal.joints.expand(3, -1, -1, -1), atol=1e-4, rtol=0)


def test_motion_without_a_change_leaves_the_hand():
    context = scene(LONG)
    hand = parameters_at(context)
    model = MotionDenoiser(MotionConfig(width=16, depth=1, heads=2))
    model.forward = lambda x, sigma, observed: torch.zeros_like(x)
    got = denoise_motion(model, hand, context, PLAN, samples=1, generator=seeded())
    torch.testing.assert_close(got.joints, hand.joints, atol=1e-6, rtol=0)


# the trajectory form


def test_trajectory_gives_the_hand_that_the_network_answers():
    context = scene(LONG)
    joints, goal = hands_at(context, 2), hands_at(context, 2, seed=20)
    model = KnownWindows(canonical(context, joints, goal))
    got = denoise_trajectory(model, joints, context, PLAN, generator=seeded())
    torch.testing.assert_close(got, goal, atol=1e-6, rtol=0)


@pytest.mark.parametrize("sampler", ["ddim", "ancestral", "direct"])
def test_a_network_that_answers_the_input_changes_nothing(sampler):
    context = scene(LONG)
    joints = hands_at(context)
    model = KnownWindows(canonical(context, joints, joints))
    plan = StagePlan(400, 3, sampler)
    got = denoise_trajectory(model, joints, context, plan, generator=seeded())
    torch.testing.assert_close(got, joints, atol=1e-6, rtol=0)


def test_windows_that_disagree_are_blended_where_they_overlap():
    context = scene(LONG)
    joints, aside = hands_at(context), torch.tensor([0.01, 0.0, 0.0])
    region = context.region(joints)
    other = context.windows(joints).clone()
    other[1] += aside
    got = denoise_trajectory(
        KnownWindows(region.to_canon(other)), joints, context, PLAN, generator=seeded()
    )
    step = (got - joints)[0, :, 0, 0] / aside[0]
    torch.testing.assert_close(step[:30], torch.zeros(30), atol=1e-4, rtol=0)
    torch.testing.assert_close(step[60:], torch.ones(30), atol=1e-4, rtol=0)
    assert bool((step[29:61].diff() > -1e-4).all())
    assert 0.4 < float(step[44:46].mean()) < 0.6


# SpatialDiff


class KnownPlace(SpatialDenoiser):
    """The density of a shift is normal around a given one, the same for all windows."""

    def __init__(self, shift: Tensor, width: float = 0.004) -> None:
        super().__init__(SpatialConfig(width=16, frames=4))
        self.shift, self.spread, self.seen = shift, width, []

    def forward(self, shifts, evidence):
        self.seen.append(evidence)
        return -0.5 * ((shifts - self.shift) / self.spread).square().sum(-1)


def test_spatial_moves_the_hand_to_the_mean_of_the_density_it_asks():
    context = scene(LONG)
    hand, shift = parameters_at(context), torch.tensor([0.012, -0.004, 0.006])
    samples = hand.map(lambda value: value.expand(4, *value.shape[1:]))
    got = denoise_spatial(
        KnownPlace(shift).requires_grad_(False),
        hand,
        samples,
        context,
        PlacePlan(400, 3),
        generator=seeded(),
    )
    moved_by = got.joints - samples.joints
    torch.testing.assert_close(moved_by.mean((0, 1, 2)), shift, atol=5e-4, rtol=0)
    # a sample of the density each: the deviation over samples is that of the density
    assert 0.002 < float(moved_by.std(0).mean()) < 0.006
    assert torch.equal(got.turn, samples.turn)


def test_spatial_knows_the_ray_of_the_camera_and_the_noise_of_the_object():
    ray = torch.nn.functional.normalize(torch.tensor([1.0, 2.0, -1.0]), dim=0)
    context = replace(scene(LONG), ray=ray.expand(LONG, 3), object_noise=torch.tensor([0.1, 0.01]))
    hand = parameters_at(context)
    known, unknown = (where.evidence(hand, hand) for where in (context, replace(context, ray=None)))
    torch.testing.assert_close(known.ray, ray.expand(2, 3))
    assert known.knows_ray.tolist() == [1, 1]
    assert unknown.knows_ray.tolist() == [0, 0]
    still = replace(context, object_noise=None).evidence(hand, hand)
    assert bool((known.track[:, 9:11] > still.track[:, 9:11]).all())
    assert torch.equal(known.track[:, :9], still.track[:, :9])


def test_spatial_averages_the_hands_of_all_contact_points():
    """Equation (8): what the points say beyond their common hand cancels in the mean."""
    context = scene(LONG)
    joints, goal = hands_at(context), hands_at(context, seed=20)
    windows = canonical(context, joints, goal)

    def answer(noisy: SpatialRelations, seen) -> SpatialRelations:
        apart = normal(noisy.hands.shape[2], 21, 3, seed=9)
        common = noisy.of_hand(windows)
        return replace(common, hands=common.hands + 0.01 * (apart - apart.mean(0)))

    model = KnownRelations(answer)
    got = denoise_relations(model, joints, context, PLAN, generator=seeded())
    torch.testing.assert_close(got, goal, atol=1e-5, rtol=0)
    assert all(bool((given == 0).all()) for given in model.given)


def test_each_contact_point_has_its_own_noise():
    context = scene()
    joints, seen = hands_at(context), []

    def answer(noisy: SpatialRelations, _) -> SpatialRelations:
        seen.append(noisy.hands)
        return noisy

    denoise_relations(
        KnownRelations(answer), joints, context, StagePlan(200, 1), generator=seeded()
    )
    assert float(seen[0].std(dim=2).mean()) > 0.01


# TemporalDiff


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


def random_statistics(like: PairStatistics, seed: int) -> PairStatistics:
    names = PairStatistics.__dataclass_fields__
    values = {
        name: 0.05 * normal(*getattr(like, name).shape, seed=seed + i).abs()
        for i, name in enumerate(names)
    }
    return PairStatistics(**values)


def run_latent(model, joints: Tensor, context: StageContext, seed: int = 0) -> Tensor:
    return denoise_latent(model, joints, context, PLAN, align=ALIGN, generator=seeded(seed))


def test_decoded_relations_of_the_hand_itself_leave_it():
    context = scene()
    joints = hands_at(context)
    model = KnownLatent(relations_of(context, joints, joints))
    got = run_latent(model, joints, context)
    assert float((got - joints).norm(dim=-1).max()) < LEFT
    assert all(bool((given == 0).all()) for given in model.given)


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
    models = random_networks()
    assert run_latent(models["latent"], joints, context) is joints
    assert denoise_temporal(models["temporal"], joints, joints, context) is joints


# all stages


def random_networks() -> dict[str, nn.Module]:
    small = {"width": 16, "depth": 1, "heads": 2}
    return {
        "trajectory": networks.awake(TrajectoryDenoiser(TrajectoryConfig(**small))),
        "relations": networks.awake(RelationDenoiser(RelationConfig(**small, point_width=8))),
        "temporal": networks.awake(TemporalDenoiser(TemporalConfig(**small))),
        "latent": networks.awake(LatentDenoiser(LatentConfig(**small, latent=6, point_width=8))),
    }


def run_stage(stage: str, joints: Tensor, context: StageContext, seed: int = 0) -> Tensor:
    model, generator = random_networks()[stage], seeded(seed)
    if stage == "trajectory":
        return denoise_trajectory(model, joints, context, PLAN, generator=generator)
    if stage == "temporal":
        # an input that shook: every other frame has the hand, the ones between have another
        same = torch.arange(context.frames)[:, None, None] % 2 == 0
        observed = torch.where(same, joints[:1], joints[:1].roll(1, dims=2))
        return denoise_temporal(model, observed, joints, context)
    if stage == "latent":
        return run_latent(model, joints, context, seed)
    return denoise_relations(model, joints, context, PLAN, generator=generator)


STAGES = ("trajectory", "relations", "temporal", "latent")


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_moves_with_a_rigid_motion_of_the_whole_scene(stage):
    context = scene()
    joints = hands_at(context, 2)
    here = run_stage(stage, joints, context)
    there = run_stage(stage, joints @ TURN.T + SHIFT, moved(context))
    assert float((here - joints).norm(dim=-1).mean()) > 1e-4
    torch.testing.assert_close(there, here @ TURN.T + SHIFT, atol=2e-5, rtol=0)


@pytest.mark.parametrize("stage", STAGES)
def test_a_seed_fixes_the_answer_of_a_stage(stage):
    context = scene()
    joints = hands_at(context, 2)
    first, again, other = (run_stage(stage, joints, context, seed) for seed in (0, 0, 1))
    assert torch.equal(first, again)
    assert torch.equal(first, other) == (stage == "temporal")  # which draws nothing
    assert math.isfinite(float(first.sum()))


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_answers_window_by_window_as_on_all_at_once(stage, monkeypatch):
    context = scene(LONG + 40)
    joints = hands_at(context, 2)
    model = random_networks()[stage]
    plan = StagePlan(100, 2)  # its noise is drawn before, or there is none to draw

    def answer() -> Tensor:
        if stage in ("temporal", "latent"):
            return run_stage(stage, joints, context)
        # each chain starts at the input itself, which has the same noise in any order
        run = denoise_trajectory if stage == "trajectory" else denoise_relations
        return run(model, joints, context, replace(plan, sampler="direct"), generator=seeded())

    whole = answer()
    monkeypatch.setattr("geneoh.pipeline.context.WINDOWS_AT_ONCE", 2)
    assert len(context.pieces(2)) > 2
    torch.testing.assert_close(answer(), whole, atol=1e-6, rtol=0)


def test_motion_answers_window_by_window_as_on_all_at_once(monkeypatch):
    context, heard = scene(LONG + 40), []
    model = networks.awake(MotionDenoiser(MotionConfig(width=16, depth=1, heads=2)))
    given = (model, parameters_at(context), context, PLAN)
    whole = denoise_motion(*given, samples=2, generator=seeded())
    monkeypatch.setattr("geneoh.pipeline.context.WINDOWS_AT_ONCE", 2)
    parts = denoise_motion(
        *given, samples=2, generator=seeded(), on_step=lambda *at: heard.append(at)
    )
    torch.testing.assert_close(parts.joints, whole.joints, atol=1e-5, rtol=0)
    total = PLAN.steps * len(context.starts)
    assert heard == [(done, total) for done in range(1, total + 1)]


def test_places_are_asked_a_few_windows_at_a_time_as_all_at_once(monkeypatch):
    context = scene(LONG + 40)
    hand = parameters_at(context)
    model = networks.awake(SpatialDenoiser(SpatialConfig(width=16, frames=4)))

    def answer() -> Tensor:
        plan = PlacePlan(40, 2)
        return denoise_spatial(model, hand, hand, context, plan, generator=seeded()).wrist

    whole = answer()
    monkeypatch.setattr("geneoh.pipeline.context.WINDOWS_AT_ONCE", 1)
    monkeypatch.setattr("geneoh.denoisers.spatial.HANDS_AT_ONCE", 1)
    torch.testing.assert_close(answer(), whole, atol=1e-5, rtol=0)
