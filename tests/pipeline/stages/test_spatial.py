"""SpatialDiff and its form of the paper with stand-in networks, whose right answers are known."""

import math
from dataclasses import replace

import networks
import torch
from ball_scenes import LONG, PLAN, canonical, hands_at, parameters_at, scene
from draws import normal, seeded
from torch import Tensor

from geneoh.denoisers.relations import RelationConfig, RelationDenoiser
from geneoh.denoisers.sliding import INDEPENDENT
from geneoh.denoisers.spatial import SpatialConfig, SpatialDenoiser
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.pipeline.presets import PlacePlan, StagePlan
from geneoh.pipeline.stages.context import StageContext
from geneoh.pipeline.stages.denoising import denoise_spatial
from geneoh.pipeline.stages.paper import denoise_relations
from geneoh.representation.parameters import HandParameters
from geneoh.representation.spatial import SpatialRelations


class KnownPlace(SpatialDenoiser):
    """The density of a shift is normal around a given one, the same for all windows."""

    def __init__(self, shift: Tensor, width: float = 0.004) -> None:
        super().__init__(SpatialConfig(width=16, frames=4))
        self.shift, self.spread, self.seen = shift, width, []

    def forward(self, shifts, evidence):
        self.seen.append(evidence)
        return -0.5 * ((shifts - self.shift) / self.spread).square().sum(-1)


class KnownRelations(RelationDenoiser):
    """Answers with `hand` of the noisy relations."""

    def __init__(self, hand) -> None:
        super().__init__(RelationConfig(width=16, depth=1, heads=2, point_width=8))
        self.hand = hand

    def forward(self, noisy, sigma, scale):
        return self.hand(noisy)


def test_spatial_moves_the_hand_to_the_mean_of_the_density_it_asks():
    context = scene(LONG)
    hand, shift = parameters_at(context), torch.tensor([0.012, -0.004, 0.006])
    samples = hand.map(lambda value: value.expand(4, *value.shape[1:]))
    got, width = denoise_spatial(
        KnownPlace(shift).requires_grad_(False),
        hand,
        samples,
        context,
        PlacePlan(400, 3, sliding=False),
        generator=seeded(),
    )
    moved_by = got.joints - samples.joints
    torch.testing.assert_close(moved_by.mean((0, 1, 2)), shift, atol=5e-4, rtol=0)
    # a sample of the density each: the deviation over samples is that of the density
    assert 0.002 < float(moved_by.std(0).mean()) < 0.006
    torch.testing.assert_close(width, torch.full_like(width, 3**0.5 * 0.004), rtol=0.2, atol=0)
    assert torch.equal(got.turn, samples.turn)


def test_a_hand_that_slides_over_what_it_holds_goes_to_where_it_does_not():
    context, error = scene(LONG, parts=1), torch.tensor([0.012, -0.004, 0.006])
    right = held_hand(context)
    held, wrist = replace(right, wrist=right.wrist + error), right.wrist

    def off(sliding: bool, relied: Tensor | None = None) -> float:
        """Distance from the place where it does not slide."""
        got, _ = denoise_spatial(
            KnownPlace(torch.zeros(3), 0.02).requires_grad_(False),
            held,
            held,
            replace(context, relied=relied),
            PlacePlan(400, 3, sliding=sliding),
            generator=seeded(),
        )
        return float((got.wrist - wrist).norm(dim=-1).mean() / error.norm())

    assert off(True) < 0.5
    assert off(False) > 0.9
    assert off(True, torch.zeros(LONG)) == off(False), "poses that are not relied on say nothing"


def test_what_drifts_over_what_is_held_is_taken_away():
    context = scene(LONG, parts=1)
    right = held_hand(context)
    time = torch.linspace(0, 6 * LONG / 60, LONG)[:, None]
    error = 0.012 * torch.cat([time.sin(), (1.3 * time).cos(), (0.8 * time + 1).sin()], dim=-1)
    error = error - error.mean(0)

    def off(sliding: bool) -> float:
        """Distance from the place where it does not drift."""
        got, _ = denoise_spatial(
            KnownPlace(torch.zeros(3)).requires_grad_(False),
            replace(right, wrist=right.wrist + error),
            replace(right, wrist=right.wrist + error),
            context,
            PlacePlan(400, 3, sliding=sliding),
            generator=seeded(),
        )
        return float((got.wrist - right.wrist).norm(dim=-1).mean())

    assert off(True) < 0.6 * off(False)


def held_hand(context: StageContext) -> HandParameters:
    """A hand that holds the object from the first frame to the last."""
    first = parameters_at(context)[:1]
    turn = context.rotation[None, :, 0] @ (context.rotation[0, 0].mT @ first.turn)
    place = (first.wrist[0, 0] - context.translation[0, 0]) @ context.rotation[0, 0]
    wrist = (context.rotation[:, 0] @ place + context.translation[:, 0])[None]
    return HandParameters(wrist, turn, first.fingers.expand(1, LONG, 15, 3), first.offsets)


def test_sliding_is_looked_at_in_five_seconds_around_each_window():
    context, frames = scene(270), 150
    joints = hands_at(context)[0]
    track = normal(len(context.starts), 12)
    seen = context.sliding(joints, track)
    around = slice(15, 15 + frames)  # of the window that begins with frame 60
    own = context[around]
    one = replace(own, chosen=(45,)).sliding(joints[around], track[2:3])
    assert context.starts[2] == 60
    for name in ("square", "line", "still", "least"):
        torch.testing.assert_close(
            getattr(seen, name)[2:3], getattr(one, name), atol=2e-5, rtol=0.1
        )
    assert 0 < float(seen.count[2]) < 60 / frames * (INDEPENDENT * frames - 1)


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


def test_carrying_an_object_to_and_fro_makes_no_hand_look_noisy():
    moving = scene(LONG)
    still = replace(
        moving,
        rotation=moving.rotation[:1].expand_as(moving.rotation),
        translation=moving.translation[:1].expand_as(moving.translation),
    )
    hand = parameters_at(still)
    angle = 1.2 * torch.sin(torch.arange(LONG) * 0.8)
    turn = axis_angle_to_matrix(angle[:, None] * torch.eye(3)[0])
    away = torch.tensor([0.0, 0.4, 0.0])

    def carried(places: Tensor) -> Tensor:
        return torch.einsum("tij,...tj->...ti", turn, places - away) + away

    shaken = replace(
        still,
        rotation=turn[:, None] @ still.rotation,
        translation=carried(still.translation.transpose(0, 1)).transpose(0, 1),
    )
    held = replace(hand, wrist=carried(hand.wrist), turn=turn @ hand.turn)
    quiet, loud = (where.evidence(it, it).track for where, it in ((still, hand), (shaken, held)))
    assert float((loud - quiet).max()) <= math.log(10) + 1e-3
    alone = still.evidence(held, held).track  # the object does not move with it
    assert float((alone - quiet).max()) > math.log(12)


def test_places_are_asked_a_few_windows_at_a_time_as_all_at_once(monkeypatch):
    context = scene(LONG + 40)
    hand = parameters_at(context)
    model = networks.awake(SpatialDenoiser(SpatialConfig(width=16, frames=4)))

    def answer() -> Tensor:
        plan = PlacePlan(40, 2)
        return denoise_spatial(model, hand, hand, context, plan, generator=seeded())[0].wrist

    whole = answer()
    monkeypatch.setattr("geneoh.pipeline.stages.context.WINDOWS_AT_ONCE", 1)
    monkeypatch.setattr("geneoh.denoisers.spatial.HANDS_AT_ONCE", 1)
    torch.testing.assert_close(answer(), whole, atol=1e-5, rtol=0)


def test_spatial_averages_the_hands_of_all_contact_points():
    """Equation (8): what the points say beyond their common hand cancels in the mean."""
    context = scene(LONG)
    joints, goal = hands_at(context), hands_at(context, seed=20)
    windows = canonical(context, joints, goal)

    def answer(noisy: SpatialRelations) -> SpatialRelations:
        apart = normal(noisy.hands.shape[2], 21, 3, seed=9)
        common = noisy.of_hand(windows)
        return replace(common, hands=common.hands + 0.01 * (apart - apart.mean(0)))

    model = KnownRelations(answer)
    got = denoise_relations(model, joints, context, PLAN, generator=seeded())
    torch.testing.assert_close(got, goal, atol=1e-5, rtol=0)


def test_each_contact_point_has_its_own_noise():
    context = scene()
    joints, seen = hands_at(context), []

    def answer(noisy: SpatialRelations) -> SpatialRelations:
        seen.append(noisy.hands)
        return noisy

    denoise_relations(
        KnownRelations(answer), joints, context, StagePlan(200, 1), generator=seeded()
    )
    assert float(seen[0].std(dim=2).mean()) > 0.01
