"""The three stages on world keypoints: window, canonicalise, denoise via diffusion, blend back.

Windows and samples share one batch. Diffusion runs on the whole track in the object's frame: each
denoiser call cuts the track into windows and blends what they answer, so windows agree at every
noise level and no seam forms, and a rigid motion of the scene moves the result and nothing else.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.denoisers.base import HAND_SCALE, POINTS, Observation
from geneoh.denoisers.motion import MotionDenoiser, ObservedMotion
from geneoh.denoisers.spatial import SpatialDenoiser
from geneoh.denoisers.temporal import TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryDenoiser
from geneoh.diffusion.samplers import OnStep, denoise_via_diffusion
from geneoh.diffusion.schedule import descending_sigmas
from geneoh.fitting.align import AlignConfig, align_to_relations
from geneoh.pipeline.presets import StagePlan
from geneoh.representation.nearest_surface import nearest_points
from geneoh.representation.parameters import HandParameters, turned
from geneoh.representation.region import ContactRegion, contact_region, surface_to_world
from geneoh.representation.spatial import decode_spatial, encode_spatial
from geneoh.representation.temporal import PairStatistics, encode_temporal
from geneoh.sequence.windows import WINDOW, fold, unfold, window_starts

SELECT_EVERY = 4
"""Frames skipped when contact points are chosen, as in training."""


ALIGN_POINTS = 16
"""Contact points whose relations the keypoints are moved to, those nearest to the hand: far ones
weigh next to nothing there."""


@dataclass(frozen=True)
class StageContext:
    """What the stages know besides the hand: the object's surface and motion, and trust."""

    points: Float[Tensor, "P 3"]
    """Object surface points in the frame of their part, with `normals` and `part` index."""
    normals: Float[Tensor, "P 3"]
    part: Int[Tensor, " P"]
    rotation: Float[Tensor, "T Q 3 3"]
    translation: Float[Tensor, "T Q 3"]
    trust: Float[Tensor, "T 21"]
    fps: float
    canonical: bool = True
    """False for the ablation whose canonical frame stands still in the world."""

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.rotation)

    @cached_property
    def starts(self) -> list[int]:
        """First frame of each window."""
        return window_starts(self.frames)

    @property
    def size(self) -> int:
        """Frames of a window: a short track is one window of its own length."""
        return min(WINDOW, self.frames)

    def to_object(self, world: Float[Tensor, "S T 21 3"]) -> Float[Tensor, "S T 21 3"]:
        """Keypoints in the frame of the object's first part, frame by frame."""
        return (world - self.translation[:, :1]) @ self.rotation[:, 0]

    def to_world(self, local: Float[Tensor, "S T 21 3"]) -> Float[Tensor, "S T 21 3"]:
        """Inverse of `to_object`."""
        return local @ self.rotation[:, 0].transpose(-1, -2) + self.translation[:, :1]

    def cut(self, values: Float[Tensor, "..."], axis: int) -> Float[Tensor, "..."]:
        """Windows of a tensor whose frames lie on `axis`, a window axis W in front of it."""
        moved = values.movedim(axis, 0)
        windows = unfold(moved.flatten(1).movedim(0, -2), self.starts, self.size)
        windows = windows.unflatten(-1, moved.shape[1:])
        return windows.movedim((0, 1), (axis, axis + 1))

    def windows(self, values: Float[Tensor, "S T ..."]) -> Float[Tensor, "B N ..."]:
        """All windows of all samples as one batch, samples outermost."""
        return self.cut(values, 1).flatten(0, 1)

    def blend(self, windows: Float[Tensor, "B N ..."]) -> Float[Tensor, "S T ..."]:
        """Inverse of `windows`: overlapping windows cross smoothly."""
        parted = windows.flatten(2).unflatten(0, (-1, len(self.starts)))
        return fold(parted, self.starts, self.frames).unflatten(-1, windows.shape[2:])

    def region(self, joints: Float[Tensor, "S T 21 3"]) -> ContactRegion:
        """Contact points of each window of each sample, from that sample's own hand."""
        windows = self.windows(joints)
        batch, samples = len(windows), len(joints)

        def of_each(values: Tensor) -> Tensor:
            return values.expand(batch, *values.shape)

        def in_windows(values: Tensor) -> Tensor:
            cut = self.cut(values, 0)
            return cut.expand(samples, *cut.shape).flatten(0, 1)

        region = contact_region(
            windows,
            of_each(self.points),
            of_each(self.normals),
            of_each(self.part),
            in_windows(self.rotation),
            in_windows(self.translation),
            count=POINTS,
            every=SELECT_EVERY,
        )
        return region if self.canonical else region.held_still()

    def observation(
        self, joints: Float[Tensor, "S T 21 3"], region: ContactRegion, given: bool
    ) -> Observation:
        """The hand that a stage starts from, as the networks' condition."""
        windows = self.windows(joints)
        trust = self.cut(self.trust, 0).repeat(len(joints), 1, 1)
        return Observation(
            region.to_canon(windows), trust, torch.full((len(windows),), float(given)).to(joints)
        )

    def observed_motion(self, hand: HandParameters, region: ContactRegion) -> ObservedMotion:
        """Windows of a hand of the world (one sample), as MotionDiff is shown them."""
        world, normals = surface_to_world(
            self.points, self.normals, self.part, self.rotation, self.translation
        )
        nearest, outward = nearest_points(hand.joints[0], world, normals)
        windows = HandParameters(
            self.windows(hand.wrist),
            self.windows(hand.turn),
            self.windows(hand.fingers),
            hand.offsets.expand(len(region.center), 20, 3),
        )
        return ObservedMotion(
            windows.to_canon(region),
            self.cut(self.trust, 0).mean(-1),
            region.to_canon(self.cut(nearest, 0)),
            self.cut(outward, 0) @ region.rotation,
            region.rotation,
            region.center,
        )


def denoise_motion(
    model: MotionDenoiser,
    hand: HandParameters,
    context: StageContext,
    plan: StagePlan,
    *,
    samples: int,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> HandParameters:
    """MotionDiff: `samples` hands of the world with natural canonical trajectories.

    Args:
        model: the denoiser of changes of the observed hand.
        hand: the observed hand in the world, one sample, gaps filled.
        context: the object and the windows.
        plan: how it is denoised.
        samples: diffusion chains to draw.
        generator: source of the noise.
        on_step: called with (done, total) after each denoiser call.
    """
    seen = context.observed_motion(hand, context.region(hand.joints))
    seen = seen.repeated(samples)

    def clean(x: Tensor, sigma: float) -> Tensor:
        windows = context.windows(x)
        return context.blend(model(windows, windows.new_full((len(windows),), sigma), seen))

    change = denoise_via_diffusion(
        clean,
        hand.wrist.new_zeros(samples, context.frames, 51),
        descending_sigmas(plan.level, plan.steps),
        sampler=plan.sampler,
        samples=samples,
        generator=generator,
        on_step=on_step,
    )
    if context.canonical:  # the wrist moves in the axes of the object's first part
        change = turned(change, context.rotation[:, 0].mT)
    return hand.map(lambda value: value.expand(samples, *value.shape[1:])).moved(change)


def denoise_trajectory(
    model: TrajectoryDenoiser,
    joints: Float[Tensor, "S T 21 3"],
    context: StageContext,
    plan: StagePlan,
    *,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """MotionDiff as the paper has it: world keypoints with natural canonical trajectories."""
    return _denoise_keypoints(
        model,
        joints,
        context,
        context.region(joints),
        plan,
        generator=generator,
        on_step=on_step,
    )


def _denoise_keypoints(
    clean_windows: Callable[[Tensor, Tensor], Tensor],
    joints: Float[Tensor, "S T 21 3"],
    context: StageContext,
    region: ContactRegion,
    plan: StagePlan,
    *,
    generator: torch.Generator,
    on_step: OnStep | None,
) -> Float[Tensor, "S T 21 3"]:
    """World keypoints denoised as one track by a denoiser of its canonical windows.

    `clean_windows` maps noisy windows (B, N, 21, 3) and noise levels (B,), metres, to clean ones.
    """

    def clean(x: Tensor, sigma: float) -> Tensor:
        canon = region.to_canon(context.windows(context.to_world(x * HAND_SCALE)))
        level = canon.new_full((len(canon),), sigma * HAND_SCALE)
        world = context.blend(region.to_world(clean_windows(canon, level)))
        return context.to_object(world) / HAND_SCALE

    cleaned = denoise_via_diffusion(
        clean,
        context.to_object(joints) / HAND_SCALE,
        descending_sigmas(plan.level, plan.steps),
        sampler=plan.sampler,
        samples=len(joints),
        generator=generator,
        on_step=on_step,
    )
    return context.to_world(cleaned * HAND_SCALE)


def denoise_spatial(
    model: SpatialDenoiser,
    joints: Float[Tensor, "S T 21 3"],
    context: StageContext,
    plan: StagePlan,
    *,
    observed: bool,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """SpatialDiff: world keypoints with natural relations to the surface (eq. 8).

    With the observation all contact points share the hand's noise and are averaged at every step;
    withheld, each is a chain of its own and the average is taken at the end, as in the paper.
    """
    region = context.region(joints)
    observation = context.observation(joints, region, observed)

    if observed:

        def clean_hand(canon: Tensor, level: Tensor) -> Tensor:
            return decode_spatial(model(encode_spatial(canon, region), level, observation))

        return _denoise_keypoints(
            clean_hand, joints, context, region, plan, generator=generator, on_step=on_step
        )

    start = encode_spatial(region.to_canon(context.windows(joints)), region)

    def clean_hands(hands: Float[Tensor, "B N K 21 3"], sigma: float) -> Tensor:
        level = hands.new_full((len(hands),), sigma * HAND_SCALE)
        noisy = replace(start, hands=hands * HAND_SCALE)
        return model(noisy, level, observation).hands / HAND_SCALE

    hands = denoise_via_diffusion(
        clean_hands,
        start.hands / HAND_SCALE,
        descending_sigmas(plan.level, plan.steps),
        sampler=plan.sampler,
        samples=len(joints),
        generator=generator,
        on_step=on_step,
    )
    hand = decode_spatial(replace(start, hands=hands))
    return context.blend(region.to_world(hand * HAND_SCALE))


def denoise_temporal(
    model: TemporalDenoiser,
    joints: Float[Tensor, "S T 21 3"],
    context: StageContext,
    plan: StagePlan,
    *,
    observed: bool,
    correct: bool,
    align: AlignConfig,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """TemporalDiff: world keypoints whose relative motion is natural (eq. 9); needs two frames.

    Args:
        model: autoencoder and latent denoiser.
        joints: the hand after the stage before.
        context: the object and the windows.
        plan: how the latent is denoised.
        observed: whether the denoiser is shown the latent of `joints`.
        correct: aim at the relations of `joints` plus the change that denoising makes to the
            decoded ones, so what the autoencoder cannot carry is not lost; False aims at the
            decoded ones themselves.
        align: the optimisation of the keypoints.
        generator: source of the noise.
        on_step: called with (done, total) after each denoiser call.
    """
    if context.frames < 2:
        return joints
    region = context.region(joints)
    windows = context.windows(joints)
    relations = encode_temporal(windows, region, context.fps)
    latent = model.autoencoder.encode(relations, region.points_canon[:, :-1])
    given = latent.new_full((len(latent),), float(observed))

    def clean(x: Tensor, sigma: float) -> Tensor:
        return model(x, x.new_full((len(x),), sigma), latent, given)

    cleaned = denoise_via_diffusion(
        clean,
        latent,
        descending_sigmas(plan.level, plan.steps),
        sampler=plan.sampler,
        samples=len(joints),
        generator=generator,
        on_step=on_step,
    )

    near = region.nearest(windows, ALIGN_POINTS)
    relations = encode_temporal(windows, near, context.fps)
    points = near.points_canon[:, :-1]

    def decoded(code: Tensor) -> PairStatistics:
        return model.autoencoder.decode(code, relations.object_velocity, relations.normals, points)

    target = decoded(cleaned)
    if correct:
        target = _corrected(relations, target, decoded(latent))
    return context.blend(align_to_relations(windows, near, target, context.fps, config=align))


def _corrected(now: PairStatistics, clean: PairStatistics, noisy: PairStatistics) -> PairStatistics:
    """`now` plus the difference between two decoded sets; lengths stay non-negative."""
    return PairStatistics(
        distance=(now.distance + clean.distance - noisy.distance).clamp(min=0),
        velocity=now.velocity + clean.velocity - noisy.velocity,
        tangential=(now.tangential + clean.tangential - noisy.tangential).clamp(min=0),
        normal=(now.normal + clean.normal - noisy.normal).clamp(min=0),
    )
