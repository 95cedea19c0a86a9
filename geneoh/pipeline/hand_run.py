"""Clean one hand: the three stages, the selection among samples, and the fit of parameters."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import Selection
from geneoh.denoisers.library import Denoisers
from geneoh.fitting.adam import AdamFitConfig, fit_with_adam
from geneoh.fitting.fit import fit_hand
from geneoh.fitting.jumps import without_jumps
from geneoh.fitting.subject import Subject, subject_of
from geneoh.fitting.terms import HandState
from geneoh.fitting.twist import untwisted
from geneoh.geometry.distance import MovingSurface
from geneoh.hand.model import HandModel, ShapedHand
from geneoh.objects.carrying import carrier_of, without_sparse_frames
from geneoh.objects.evidence import evidence_at_hand, evidence_of_nearness
from geneoh.objects.left_behind import moving_parts
from geneoh.pipeline.fitted import FittedHand
from geneoh.pipeline.misfit import depth_left, moved_far
from geneoh.pipeline.presets import Preset
from geneoh.pipeline.stages.run import StageRun
from geneoh.progress import OnProgress, OnStep, timed
from geneoh.sequence.keypoints import PALM
from geneoh.sequence.normalisation import NormalisedHand
from geneoh.sequence.sequence import HandTrack


@dataclass(frozen=True)
class HandRun:
    """Networks and settings that all hands of a sequence share."""

    denoisers: Denoisers
    preset: Preset
    object_noise: Float[Tensor, " 2"] | None
    """Standard deviation of white noise on the object's poses, radians and metres; None for an
    object that is trusted."""
    seed: int
    on_progress: OnProgress | None

    @torch.no_grad()
    def fitted(
        self,
        hand: NormalisedHand,
        model: HandModel,
        relied: Float[Tensor, "N Q"],
        raw: HandTrack | None,
    ) -> FittedHand:
        """One normalised hand after the stages and the fit.

        `relied` is the reliability of each part's pose, 0 to 1: a frame of lower reliability is
        cleaned to that extent without the object. `raw` is the input before a filter was undone in
        it, for the report; None if nothing was undone."""
        chosen = self.preset
        surface = hand.object.surface() if hand.object.meshes else None
        against = surface if chosen.has_object else None
        if against is not None:
            hand = replace(hand, track=without_sparse_frames(hand.track, against, relied))
        carrier = None if against is None else carrier_of(hand.track, against, relied)
        observed = subject_of(hand.track, model, carrier)
        subject = untwisted(observed)
        given = subject.parameters()
        # the paper's stages work on keypoints and use no skeleton
        subject, seen = subject.in_own_skeleton(given) if chosen.observed else (subject, given)
        subject = subject.completed(seen)
        near, poses = _reliance(hand, subject, against, relied, chosen)
        seconds: dict[str, float] = {}
        progress_of = timed(self.on_progress, seconds)
        generator = torch.Generator().manual_seed(self.seed)
        stages = StageRun(self.denoisers, subject, seen, progress_of, generator)
        ray, noise = hand.track.camera_ray, self.object_noise
        rests = False
        if chosen.clean_object and ray is not None and surface is not None:
            rests = not bool(moving_parts(surface, hand.fps).any())
        before, joints = given, subject.joints
        if raw is not None:
            observed = subject_of(raw.to(hand.track.valid.device), model, carrier)
            before = given if observed.start is subject.start else observed.parameters()
            joints = observed.completed(before).joints

        def cleaned(near: Float[Tensor, " N"]) -> FittedHand:
            samples, near = stages.relied_on(
                surface, poses, near, chosen, hand.fps, ray=ray, rests=rests, object_noise=noise
            )
            index, target = _select(samples, subject, chosen.selection)
            on_step = progress_of("fit")
            state, shaped, betas = _fit(
                target, subject, given, chosen, surface, near * poses, on_step
            )
            return FittedHand(
                hand=hand,
                subject=subject,
                given=before,
                given_joints=joints,
                preset=chosen,
                surface=surface,
                near=near,
                poses=poses,
                samples=samples,
                chosen=index,
                target=target,
                state=state,
                shaped=shaped,
                betas=betas,
                seconds=seconds,
            )

        found = cleaned(near)
        # even a mesh that is too large shows how far a hand is off along the camera's ray
        if against is None or ray is not None or not (chosen.clean_object and chosen.contact):
            return found
        counted = hand.track.observed & (found.evidence > 0.5)
        was, now = (each[:, list(PALM)].mean(1) for each in (subject.joints, found.target[0]))
        misfits = depth_left(found.fingers_apart(), counted), moved_far(was, now, counted)
        worst = min(filter(None, misfits), key=lambda each: each.evidence, default=None)
        if worst is None or worst.evidence == 1:
            return found
        return replace(cleaned(near * worst.evidence), misfit=worst)


def _reliance(
    hand: NormalisedHand,
    subject: Subject,
    against: MovingSurface | None,
    relied: Float[Tensor, "N Q"],
    chosen: Preset,
) -> tuple[Float[Tensor, " N"], Float[Tensor, " N"]]:
    """Per frame, 0 to 1: whether the hand interacts with the object (`evidence_of_nearness`), and
    the reliability of the poses of the parts near it (`evidence_at_hand`)."""
    if against is None:
        return torch.zeros_like(relied[:, 0]), relied.amin(1)
    near = torch.ones_like(relied[:, 0])
    if chosen.clean_object:
        near = evidence_of_nearness(subject.joints, against, hand.fps, hand.track.camera_ray)
    return near, evidence_at_hand(relied, subject.joints, against)


def _select(
    samples: Float[Tensor, "S T 21 3"], subject: Subject, selection: Selection
) -> tuple[int, Float[Tensor, "1 T 21 3"]]:
    """Index and keypoints of the sample nearest to the trusted input, as in the paper; or -1 and
    the mean of all samples."""
    if selection == "mean":
        return -1, samples.mean(0, keepdim=True)
    apart = ((samples - subject.joints).norm(dim=-1) * subject.trust).sum((1, 2))
    index = int(apart.argmin())
    return index, samples[index : index + 1]


def _fit(
    target: Float[Tensor, "1 T 21 3"],
    subject: Subject,
    given: HandState,
    chosen: Preset,
    surface: MovingSurface | None,
    evidence: Float[Tensor, " T"],
    on_step: OnStep,
) -> tuple[HandState, ShapedHand, Tensor]:
    """Hand parameters, shaped hand and betas fitted to the target, initialised with the input's.
    All frames have trust 1, because the stages have filled the gaps."""
    trust = torch.ones_like(target[..., 0])
    model = subject.shaped.model
    if isinstance(chosen.fit, AdamFitConfig):
        state, betas = fit_with_adam(target, trust, model, config=chosen.fit, on_step=on_step)
        return state, model.shaped(betas[0]), betas[0]
    state = fit_hand(
        target,
        trust,
        subject.shaped,
        given,
        config=chosen.fit,
        surface=surface if chosen.contact else None,
        evidence=evidence,
        on_step=on_step,
    )
    if surface is not None and chosen.contact:
        state = without_jumps(state, target, subject.shaped, chosen.fit)
    return state, subject.shaped, subject.betas
