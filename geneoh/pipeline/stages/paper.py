"""The three stages in the paper's form, on world keypoints (3.2; appendices A.2, C.4, C.5).

Each window is diffused independently, and windows are blended at the end. Only the preset `paper`
uses these functions.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.latent import LatentDenoiser
from geneoh.denoisers.relations import RelationDenoiser
from geneoh.denoisers.trajectory import TrajectoryDenoiser
from geneoh.diffusion.samplers import antithetic_noise
from geneoh.fitting.align import AlignConfig, align_to_relations
from geneoh.pipeline.presets import StagePlan
from geneoh.pipeline.stages.context import Piece, StageContext
from geneoh.pipeline.stages.denoising import diffused
from geneoh.progress import OnStep, part_of
from geneoh.representation.spatial import decode_spatial, encode_spatial
from geneoh.representation.temporal import encode_temporal
from geneoh.representation.window_scale import WindowScale

ALIGN_POINTS = 16
"""Number of contact points, nearest to the hand, that keypoints are aligned to; others would have
almost no weight."""


def denoise_trajectory(
    model: TrajectoryDenoiser,
    whole: Float[Tensor, "S T 21 3"],
    context: StageContext,
    plan: StagePlan,
    *,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """MotionDiff: world keypoints with natural canonical trajectories.

    All samples of `whole` are the input. Every window is diffused in units of its own standard
    deviation, in `plan.chains` chains but at least one per sample. Of each window the chains that
    end closest to the input are kept, the closest first, or the mean of as many chains for each
    sample (`plan.kept`), and windows are blended afterwards. The paper keeps the closest, after the
    last stage; here it is done before the later stages, which change less.
    """
    samples = len(whole)
    chains = max(samples, plan.chains)
    if plan.kept == "mean":
        chains = samples * math.ceil(chains / samples)

    def one_piece(piece: Piece, on_step: OnStep | None) -> Tensor:
        context, joints = piece.context, whole[:1, piece.frames]
        region = context.region(joints)
        canon = region.to_canon(context.windows(joints))
        scale = WindowScale.of(canon)
        deviation = scale.deviation.flatten().repeat(chains)

        def clean(x: Tensor, sigma: float) -> Tensor:
            return model(x, x.new_full((len(x),), sigma), deviation)

        start = scale.normalised(canon).repeat(chains, 1, 1, 1)
        cleaned = diffused(clean, start, plan, chains, generator, on_step)
        each = torch.stack([scale.metres(one) for one in cleaned.unflatten(0, (chains, -1))])
        if plan.kept == "mean":
            kept = each.unflatten(0, (samples, -1)).mean(1)
        else:
            kept = _closest(each, canon, context.cut(context.trust, 0), samples)
        return torch.cat([region.to_world(one) for one in kept])

    return _piece_by_piece(one_piece, context, on_step, samples, at_once=chains)


def _closest(
    each: Float[Tensor, "C W T 21 3"],
    observed: Float[Tensor, "W T 21 3"],
    trust: Float[Tensor, "W T 21"],
    count: int,
) -> Float[Tensor, "S W T 21 3"]:
    """The `count` chains of each window that are closest to the trusted input, closest first."""
    order = (trust * (each - observed).norm(dim=-1)).mean((2, 3)).argsort(0)[:count]
    return each[order, torch.arange(each.shape[1], device=each.device)]


def denoise_relations(
    model: RelationDenoiser,
    whole: Float[Tensor, "S T 21 3"],
    context: StageContext,
    plan: StagePlan,
    *,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """SpatialDiff: world keypoints with natural offsets to the contact points.

    Each contact point has its own diffusion chain, in units of the window's standard deviation; the
    resulting hands of all contact points are averaged at the end (eq. 8).
    """

    def one_piece(piece: Piece, on_step: OnStep | None) -> Tensor:
        context, joints = piece.context, whole[:, piece.frames]
        region = context.region(joints)
        start = encode_spatial(region.to_canon(context.windows(joints)), region)
        scale = WindowScale.of(start.hands)

        def clean_hands(hands: Float[Tensor, "B N K 21 3"], sigma: float) -> Tensor:
            noisy = replace(start, hands=scale.metres(hands))
            level = hands.new_full((len(hands),), sigma)
            return scale.normalised(model(noisy, level, scale).hands)

        hands = scale.normalised(start.hands)
        hands = diffused(clean_hands, hands, plan, len(joints), generator, on_step)
        return region.to_world(decode_spatial(replace(start, hands=scale.metres(hands))))

    return _piece_by_piece(one_piece, context, on_step, len(whole))


def denoise_latent(
    model: LatentDenoiser,
    whole: Float[Tensor, "S T 21 3"],
    context: StageContext,
    plan: StagePlan,
    *,
    align: AlignConfig | None = None,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """TemporalDiff: world keypoints near decoded relations (eq. 9).

    A track of one frame stays as it is.
    """
    if context.frames < 2:
        return whole
    align, noise = align or AlignConfig(), None
    if plan.sampler != "direct":  # noise of the whole track at once, independent of the pieces
        pairs = (len(whole) * len(context.starts), context.size - 1, model.config.latent)
        noise = antithetic_noise(whole.new_empty(pairs), samples=len(whole), generator=generator)
        noise = noise.unflatten(0, (len(whole), -1))

    def one_piece(piece: Piece, on_step: OnStep | None) -> Tensor:
        context, joints = piece.context, whole[:, piece.frames]
        region = context.region(joints)
        windows = context.windows(joints)
        relations = encode_temporal(windows, region, context.fps)
        latent = model.autoencoder.encode(relations, region.points_canon[:, :-1])

        def clean(x: Tensor, sigma: float) -> Tensor:
            return model(x, x.new_full((len(x),), sigma))

        own = None if noise is None else noise[:, piece.windows].flatten(0, 1)
        cleaned = diffused(clean, latent, plan, len(joints), generator, on_step, noise=own)
        near = region.nearest(windows, ALIGN_POINTS)
        relations = encode_temporal(windows, near, context.fps)
        around = relations.object_velocity, relations.normals, near.points_canon[:, :-1]
        target = model.autoencoder.decode(cleaned, *around)
        return align_to_relations(windows, near, target, context.fps, config=align)

    return _piece_by_piece(one_piece, context, on_step, len(whole))


def _piece_by_piece(
    work: Callable[[Piece, OnStep | None], Tensor],
    context: StageContext,
    on_step: OnStep | None,
    samples: int,
    *,
    at_once: int | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """Apply `work` to each piece and blend the resulting windows, which are independent.

    `at_once` is the number of copies of each window in a batch, by default `samples`.
    """
    pieces = context.pieces(at_once or samples)
    made = (work(piece, part_of(on_step, index, len(pieces))) for index, piece in enumerate(pieces))
    return context.joined(made, samples)
