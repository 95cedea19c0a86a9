"""The three stages on world keypoints: window, canonicalise, denoise via diffusion, blend back.

Windows and samples share one batch. Diffusion runs on the whole track in the object's frame: each
denoiser call cuts the track into windows and blends their results, so that windows agree at every
noise level and no seam forms. A rigid motion of the scene moves the result rigidly.
"""

from collections.abc import Callable
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.base import HAND_SCALE
from geneoh.denoisers.motion import MotionDenoiser
from geneoh.denoisers.spatial import SpatialDenoiser
from geneoh.denoisers.temporal import TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryDenoiser
from geneoh.diffusion.samplers import denoise_via_diffusion
from geneoh.diffusion.schedule import descending_sigmas
from geneoh.fitting.align import AlignConfig, align_to_relations
from geneoh.pipeline.context import StageContext
from geneoh.pipeline.presets import StagePlan
from geneoh.progress import OnStep
from geneoh.representation.parameters import HandParameters, turned
from geneoh.representation.region import ContactRegion
from geneoh.representation.spatial import decode_spatial, encode_spatial
from geneoh.representation.temporal import PairStatistics, encode_temporal

ALIGN_POINTS = 16
"""Number of contact points that keypoints are aligned to, those nearest to the hand; far ones would
hardly count."""


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
        hand: the observed hand in the world frame, one sample, gaps filled.
        context: the object and the windows.
        plan: settings of the diffusion.
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

    With the observation all contact points share the noise of the hand and their results are
    averaged at every step. Without it, as in the paper, each contact point has a diffusion chain of
    its own and the average is taken at the end.
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
        plan: settings of the diffusion of the latent.
        observed: whether the denoiser is shown the latent of `joints`.
        correct: aim at the relations of `joints` plus the change that denoising makes to the
            decoded ones, so that what the autoencoder cannot represent is not lost; False aims at
            the decoded ones themselves, as in the paper.
        align: settings of the optimisation of the keypoints.
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
    """The relations `now` plus the difference of two decoded ones; lengths stay non-negative."""
    return PairStatistics(
        distance=(now.distance + clean.distance - noisy.distance).clamp(min=0),
        velocity=now.velocity + clean.velocity - noisy.velocity,
        tangential=(now.tangential + clean.tangential - noisy.tangential).clamp(min=0),
        normal=(now.normal + clean.normal - noisy.normal).clamp(min=0),
    )
