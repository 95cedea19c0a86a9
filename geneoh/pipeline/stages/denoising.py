"""The three stages on world-frame hands: window, canonicalise, denoise, blend back.

Windows and samples form one batch, limited by `StageContext.pieces`. In `denoise_motion` the whole
track is diffused in the object frame: each denoiser call cuts the track into windows and blends
their results, so that windows agree at every noise level and no seam forms. All stages are
equivariant under rigid motions of the scene. Their paper's form is in
`geneoh.pipeline.stages.paper`.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.baselines.filters import Filter, smooth
from geneoh.bundle import concatenated
from geneoh.denoisers.motion import MotionDenoiser
from geneoh.denoisers.spatial import SpatialDenoiser
from geneoh.denoisers.temporal import TemporalDenoiser
from geneoh.diffusion.posterior import Posterior, along_a_track
from geneoh.diffusion.samplers import Model, denoise_via_diffusion
from geneoh.diffusion.schedule import descending_sigmas
from geneoh.fitting.align import align_to_steps
from geneoh.pipeline.presets import PlacePlan, StagePlan
from geneoh.pipeline.stages.context import StageContext, repeated
from geneoh.progress import OnStep, counted, steps
from geneoh.representation.parameters import HandParameters, turned
from geneoh.sequence.keypoints import palm_axes
from geneoh.sequence.windows import blocks

WRIST = 6  # components of the wrist's translation and rotation, the first of a change
CONSTANT_SHARE = 0.85
"""Correlation of the shifts of two windows far apart: most errors that are constant in a window are
constant over the whole clip, such as errors of a camera's depth estimates."""
TOGETHER = 64
"""Windows whose shifts are solved for jointly, about a minute: the cost is cubic in them."""
DRIFT_FILTER, LARGEST_DRIFT = Filter("gaussian", 10.0), 0.008
"""Low-pass filter and limit, metres, of the slow part of TemporalDiff's shift: 5 mm are usual."""


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
    """MotionDiff: `samples` world-frame hands with natural canonical trajectories.

    `hand` is the observed hand in the world frame, one sample, gaps filled. The network takes a
    frame of little trust for a gap, in which it moves the hand to its path through the frames
    around. Where hidden fingers have little trust and the palm has more, the wrist is denoised by
    that of the palm.
    """
    pieces = context.pieces(samples)
    advance = counted(on_step, plan.calls * len(pieces))

    seen = [piece.observed_motion(hand[frames]) for _, frames, piece in pieces]
    palms = [piece.trust_of_palm() for _, _, piece in pieces]

    def clean(x: Tensor, sigma: float) -> Tensor:
        def answer(index: int) -> Tensor:
            _, frames, piece = pieces[index]
            windows = piece.windows(x[:, frames])
            # a copy, so that its cached network input is freed: it is too large on long tracks
            level, palm = windows.new_full((len(windows),), sigma), palms[index]
            found = model(windows, level, replace(seen[index]))
            if palm is not None:
                own = model(windows, level, replace(seen[index], trust=palm))
                found = torch.cat([own[..., :WRIST], found[..., WRIST:]], dim=-1)
            advance()
            return found

        return context.joined(map(answer, range(len(pieces))), samples)

    still = hand.wrist.new_zeros(samples, context.frames, 51)
    change = diffused(clean, still, plan, samples, generator)
    if context.canonical:  # wrist changes are in the axes of the object's first part
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
    """SpatialDiff: world-frame hands, shifted to where their relations to the surface are natural.

    Each window has one shift, because the errors that it corrects are constant over a window. The
    density of the shift is evaluated for the mean of the samples. Each sample gets a shift drawn
    from it, such that the mean over samples is the mean of the density. Then the drift over a held
    object is subtracted from all samples.

    `observed` is the input, one sample, gaps filled; `hand` has the samples of the stage before.
    Also returns the standard deviation of the shift in each frame, metres.
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
    """Standard deviation of the shift in each window, metres.

    Along a camera ray (zero if unknown) the shift is uncertain even for a hand that holds, so the
    result is then the deviation across the ray, scaled from two to three dimensions.
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
    """Joint posteriors of the shifts of `TOGETHER` windows at a time, which are correlated."""
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


def denoise_temporal(
    model: TemporalDenoiser,
    observed: Float[Tensor, "1 T 21 3"],
    whole: Float[Tensor, "S T 21 3"],
    context: StageContext,
    *,
    on_step: OnStep | None = None,
) -> Float[Tensor, "S T 21 3"]:
    """TemporalDiff: world keypoints whose displacements over the object are natural.

    The correction is computed for the mean of the samples and added to all of them, so their
    differences stay. A track of one frame is unchanged.

    `observed` is the hand before MotionDiff, gaps filled; `whole` has the samples of the stage
    before.
    """
    if context.frames < 2:
        return whole
    middle = whole.mean(0, keepdim=True)
    each = [
        model(piece.steps(observed[:, piece.frames], middle[:, piece.frames]))
        for piece in steps(context.pieces(1), on_step)
    ]
    found = concatenated(each, "B").map(context.blend)
    shift = without_drift(align_to_steps(found.change, found.steps, found.places), context.fps)
    return whole + shift @ context.rotation[:, 0].mT


def without_drift(shift: Float[Tensor, "S T 21 3"], fps: float) -> Float[Tensor, "S T 21 3"]:
    """A shift that was integrated from displacements, with its slow part at most `LARGEST_DRIFT`.

    Displacements do not determine positions: in motion that is faster than in training, small
    errors of many displacements add up to centimetres.
    """
    lasting = smooth(shift.movedim(1, 0), DRIFT_FILTER, fps).movedim(0, 1)
    size = lasting.norm(dim=-1, keepdim=True)
    return shift - lasting * (1 - LARGEST_DRIFT / size.clamp(min=LARGEST_DRIFT))


def diffused(
    model: Model,
    start: Tensor,
    plan: StagePlan,
    samples: int,
    generator: torch.Generator,
    on_step: OnStep | None = None,
    *,
    noise: Tensor | None = None,
) -> Tensor:
    """`start`, denoised via diffusion with the noise level, steps and sampler of a plan."""
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
