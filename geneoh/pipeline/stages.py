"""The three stages on world keypoints: window, canonicalise, denoise via diffusion, blend back.

Windows and samples share one batch, as many as `StageContext.pieces` has at a time. In
`denoise_motion` the whole track is diffused in the object's frame: each denoiser call cuts the
track into windows and blends their results, so that windows agree at every noise level and no seam
forms. The stages in the paper's form diffuse each window alone, and windows are blended at the end.
A rigid motion of the scene moves the result rigidly.
"""

from collections.abc import Callable
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.baselines.filters import Filter, smooth
from geneoh.bundle import concatenated
from geneoh.denoisers.latent import LatentDenoiser
from geneoh.denoisers.motion import MotionDenoiser, ObservedMotion
from geneoh.denoisers.relations import RelationDenoiser
from geneoh.denoisers.spatial import SpatialDenoiser
from geneoh.denoisers.temporal import StepCorrection, TemporalDenoiser
from geneoh.denoisers.trajectory import TrajectoryDenoiser
from geneoh.diffusion.posterior import Posterior, along_a_track
from geneoh.diffusion.samplers import Model, antithetic_noise, denoise_via_diffusion
from geneoh.diffusion.schedule import descending_sigmas
from geneoh.fitting.align import AlignConfig, align_to_relations, align_to_steps
from geneoh.pipeline.context import Piece, StageContext, repeated
from geneoh.pipeline.presets import PlacePlan, StagePlan
from geneoh.progress import OnStep, counted, part_of
from geneoh.representation.parameters import HandParameters, turned
from geneoh.representation.spatial import decode_spatial, encode_spatial
from geneoh.representation.temporal import encode_temporal
from geneoh.representation.window_scale import WindowScale
from geneoh.sequence.keypoints import palm_axes
from geneoh.sequence.windows import blocks

CONSTANT_SHARE = 0.85
"""Correlation of the shifts of two windows far apart: most of what lasts for a window lasts for the
whole clip, as the depth of a camera's estimates does."""
TOGETHER = 64
"""Windows whose shifts are found together, a minute of them: the work grows with their cube."""
ALIGN_POINTS = 16
"""Number of contact points that keypoints are aligned to, those nearest to the hand; far ones would
hardly count."""
LASTING, LARGEST_DRIFT = Filter("gaussian", 10.0), 0.008
"""What of a shift by TemporalDiff lasts, and its largest length in metres: 5 mm are usual."""


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

    `hand` is the observed one in the world frame, one sample, gaps filled.
    """
    pieces = context.pieces(samples)
    advance = counted(on_step, plan.calls * len(pieces))

    def observed(frames: slice, piece: StageContext) -> ObservedMotion:
        own = hand[frames]
        return piece.observed_motion(own, piece.region(own.joints))

    seen = [observed(frames, piece) for _, frames, piece in pieces]

    def clean(x: Tensor, sigma: float) -> Tensor:
        def answer(index: int) -> Tensor:
            _, frames, piece = pieces[index]
            windows = piece.windows(x[:, frames])
            # a copy, so that what the network reads is not kept: on long tracks it is too much
            found = model(windows, windows.new_full((len(windows),), sigma), replace(seen[index]))
            advance()
            return found

        return context.joined(map(answer, range(len(pieces))), samples)

    still = hand.wrist.new_zeros(samples, context.frames, 51)
    change = _diffused(clean, still, plan, samples, generator)
    if context.canonical:  # the wrist moves in the axes of the object's first part
        change = turned(change, context.rotation[:, 0].mT)
    return repeated(hand, samples).moved(change)


def denoise_spatial(
    model: SpatialDenoiser,
    observed: HandParameters,
    hand: HandParameters,
    context: StageContext,
    plan: PlacePlan,
    *,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> tuple[HandParameters, Float[Tensor, " T"]]:
    """SpatialDiff: hands of the world in places where their relations to the surface are natural.

    The place is one shift per window, because the errors that it mends last. All samples ask about
    their mean and get a shift each, drawn from its density, so that their mean is the density's.
    What then drifts over the object that the hand holds is taken away from all of them alike.

    `observed` is the input, one sample, gaps filled; `hand` has the samples of the stage before.
    Also the deviation of the place in each frame, metres.
    """
    count = plan.frames or model.config.frames
    evidence = concatenated(
        [
            piece.evidence(observed[frames], hand[frames]).spread_over(count)
            for _, frames, piece in context.pieces(len(hand.wrist))
        ],
        "B",
    )
    middle = [hand[frames].joints.mean(0) for frames in blocks(context.frames)]
    joints = torch.cat(middle)
    axes = palm_axes(joints[None])[0]
    each = model.posterior(
        evidence,
        axes,
        rounds=plan.steps,
        places=plan.places,
        generator=generator,
        besides=context.sliding(joints, evidence.track).log_density if plan.sliding else None,
        on_step=on_step,
    )
    found = _of_all_windows(each, model.prior_root(evidence, axes), context)
    drawn = [part.cautious(3).samples(len(hand.wrist), generator=generator) for part in found]
    shifts = torch.cat(drawn, dim=-1).view(-1, 3) @ axes.mT
    shift = context.blend(shifts[:, None].expand(-1, context.size, -1))
    width = _width_of_place(found, evidence.ray @ axes)
    width = context.blend(width[:, None, None].expand(-1, context.size, 1))[0, :, 0]
    if plan.sliding:
        shift = shift - context.drift(joints + shift.mean(0)[:, None], evidence.track)
    return replace(hand, wrist=hand.wrist + shift), width


def _width_of_place(found: list[Posterior], ray: Float[Tensor, "W 3"]) -> Float[Tensor, " W"]:
    """Deviation of the place in each window, metres.

    Along the ray of a camera, zero where it is not known, the place is uncertain for hands that
    hold, too: there only the deviation across it counts, as much in all three dimensions.
    """
    widths = list[Tensor]()
    for part, along in zip(found, ray.split(TOGETHER), strict=True):
        each = part.root[0].unflatten(0, (-1, 3))
        known = along.square().sum(-1)
        across = each.square().sum((1, 2)) - (along[..., None] * each).sum(1).square().sum(-1)
        widths.append((across * (1 + known / 2)).sqrt())
    return torch.cat(widths)


def _of_all_windows(
    each: Posterior, prior_root: Float[Tensor, "W 3 3"], context: StageContext
) -> list[Posterior]:
    """The shifts of `TOGETHER` windows at a time as one axis: lasting errors are alike in all."""
    first = torch.tensor(context.starts).to(each.mean)
    fresh = min(1.0, context.frames / (len(first) * context.size))
    found: list[Posterior] = []
    for at in range(0, len(first), TOGETHER):
        group = slice(at, at + TOGETHER)
        apart = (first[group, None] - first[group]).abs() / context.size
        agreement = CONSTANT_SHARE + (1 - CONSTANT_SHARE) * torch.exp(-apart)
        own = Posterior(each.mean[group], each.root[group])
        found.append(along_a_track(own, prior_root[group], agreement, fresh))
    return found


def denoise_trajectory(
    model: TrajectoryDenoiser,
    whole: Float[Tensor, "S T 21 3"],
    context: StageContext,
    plan: StagePlan,
    *,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """MotionDiff as the paper has it: world keypoints with natural canonical trajectories.

    The samples are all the input. Every window has `plan.chains` of its own, or one for each sample
    if these are more, in units of its own deviation; those that end closest to the input are kept,
    the closest first, and windows are blended after. The paper chooses after the last stage: the
    later ones change less.
    """
    samples = len(whole)
    chains = max(samples, plan.chains)

    def one_piece(piece: Piece, on_step: OnStep | None) -> Tensor:
        context, joints = piece.context, whole[:1, piece.frames]
        region = context.region(joints)
        canon = region.to_canon(context.windows(joints))
        scale = WindowScale.of(canon)
        deviation = scale.deviation.flatten().repeat(chains)

        def clean(x: Tensor, sigma: float) -> Tensor:
            return model(x, x.new_full((len(x),), sigma), deviation)

        start = scale.normalised(canon).repeat(chains, 1, 1, 1)
        cleaned = _diffused(clean, start, plan, chains, generator, on_step)
        each = torch.stack([scale.metres(one) for one in cleaned.unflatten(0, (chains, -1))])
        kept = _closest(each, canon, context.cut(context.trust, 0), samples)
        return torch.cat([region.to_world(one) for one in kept])

    return _piece_by_piece(one_piece, context, on_step, samples, at_once=chains)


def _closest(
    each: Float[Tensor, "C W T 21 3"],
    given: Float[Tensor, "W T 21 3"],
    trust: Float[Tensor, "W T 21"],
    count: int,
) -> Float[Tensor, "S W T 21 3"]:
    """The chains of each window that ended closest to the keypoints that were seen, the closest
    first."""
    order = (trust * (each - given).norm(dim=-1)).mean((2, 3)).argsort(0)[:count]
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
    """SpatialDiff as the paper has it: world keypoints with natural offsets to the contact points.

    Each contact point has a diffusion chain of its own, in units of the window's deviation; the
    average of the hands that they imply is taken at the end (eq. 8).
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
        hands = _diffused(clean_hands, hands, plan, len(joints), generator, on_step)
        return region.to_world(decode_spatial(replace(start, hands=scale.metres(hands))))

    return _piece_by_piece(one_piece, context, on_step, len(whole))


def denoise_temporal(
    model: TemporalDenoiser,
    observed: Float[Tensor, "1 T 21 3"],
    whole: Float[Tensor, "S T 21 3"],
    context: StageContext,
    *,
    on_step: OnStep | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """TemporalDiff: world keypoints whose steps over the object are natural; needs two frames.

    All samples ask about their mean, and are moved by the same shift: what they differ in stays.

    `observed` is the hand before MotionDiff, gaps filled; `whole` has the samples of the stage
    before.
    """
    if context.frames < 2:
        return whole
    pieces = context.pieces(1)
    advance = counted(on_step, len(pieces))
    middle = whole.mean(0, keepdim=True)

    def answer(piece: Piece) -> StepCorrection:
        found = model(piece.steps(observed[:, piece.frames], middle[:, piece.frames]))
        advance()
        return found

    found = concatenated([answer(piece) for piece in pieces], "B").map(context.blend)
    shift = without_drift(align_to_steps(found.change, found.steps, found.places), context.fps)
    return whole + shift @ context.rotation[:, 0].mT


def without_drift(shift: Float[Tensor, "S T 21 3"], fps: float) -> Float[Tensor, "S T 21 3"]:
    """A shift made of steps, whose lasting part is at most `LARGEST_DRIFT`.

    Steps tell nothing of a place: where they are faster than the network knows, small errors of
    many of them add up to centimetres.
    """
    lasting = smooth(shift.movedim(1, 0), LASTING, fps).movedim(0, 1)
    size = lasting.norm(dim=-1, keepdim=True)
    return shift - lasting * (1 - LARGEST_DRIFT / size.clamp(min=LARGEST_DRIFT))


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
    """TemporalDiff as the paper has it: world keypoints near decoded relations (eq. 9).

    A track of one frame stays as it is.
    """
    if context.frames < 2:
        return whole
    align, noise = align or AlignConfig(), None
    if plan.sampler != "direct":  # for the whole track, so that it does not depend on the pieces
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
        cleaned = _diffused(clean, latent, plan, len(joints), generator, on_step, noise=own)
        near = region.nearest(windows, ALIGN_POINTS)
        relations = encode_temporal(windows, near, context.fps)
        around = relations.object_velocity, relations.normals, near.points_canon[:, :-1]
        target = model.autoencoder.decode(cleaned, *around)
        return align_to_relations(windows, near, target, context.fps, config=align)

    return _piece_by_piece(one_piece, context, on_step, len(whole))


def _diffused(
    model: Model,
    start: Tensor,
    plan: StagePlan,
    samples: int,
    generator: torch.Generator,
    on_step: OnStep | None = None,
    *,
    noise: Tensor | None = None,
) -> Tensor:
    """`start`, denoised via diffusion from the noise level and in the steps of a plan."""
    return denoise_via_diffusion(
        model,
        start,
        descending_sigmas(plan.level, plan.steps),
        sampler=plan.sampler,
        samples=samples,
        generator=generator,
        noise=noise,
        on_step=on_step,
    )


def _piece_by_piece(
    work: Callable[[Piece, OnStep | None], Tensor],
    context: StageContext,
    on_step: OnStep | None,
    samples: int,
    *,
    at_once: int | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """The windows that `work` makes of each piece, blended; all windows are independent.

    `at_once` is how many times a window is worked on together, where that is not `samples`.
    """
    pieces = context.pieces(at_once or samples)
    made = (work(piece, part_of(on_step, index, len(pieces))) for index, piece in enumerate(pieces))
    return context.joined(made, samples)
