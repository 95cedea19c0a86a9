"""The three stages of a preset in order, on one hand."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.denoisers.library import Denoisers
from geneoh.errors import CheckpointError
from geneoh.fitting.subject import Subject
from geneoh.fitting.terms import HandState
from geneoh.geometry.distance import MovingSurface
from geneoh.nn.checkpoint import finite_output
from geneoh.objects.carrying import with_held_part_first
from geneoh.objects.evidence import blended, evidence_of_place
from geneoh.pipeline.presets import DirectPlan, PlacePlan, Preset, StagePlan
from geneoh.pipeline.stages.alone import hand_alone, travelled
from geneoh.pipeline.stages.context import StageContext, repeated, stage_context
from geneoh.pipeline.stages.denoising import denoise_motion, denoise_spatial, denoise_temporal
from geneoh.pipeline.stages.jitter import without_jitter, without_jitter_over_object
from geneoh.pipeline.stages.paper import denoise_latent, denoise_relations, denoise_trajectory
from geneoh.progress import OnStep
from geneoh.representation.parameters import HandParameters
from geneoh.sequence.windows import blocks

LEAST_EVIDENCE = 0.02  # evidence of the object up to which the stages run without it
WITHOUT_RAY = 0.5
"""Factor on the standard deviation that SpatialDiff's shift has without the camera's ray, where the
object rests: from 32 mm on that reduces the evidence of a touch, from 40 mm on it leaves none."""
FARTHEST = 10.0  # distance from the input, metres, that shows damaged network weights
OF_THE_PAPER: dict[str, tuple[str, Callable[..., Tensor]]] = {
    "motion": ("trajectory", denoise_trajectory),
    "spatial": ("relations", denoise_relations),
    "temporal": ("latent", denoise_latent),
}
"""Network name and stage function of each stage in the paper's form."""


@dataclass(frozen=True)
class StageRun:
    """Networks and input of the stages of one hand, for runs with and without the object."""

    denoisers: Denoisers
    subject: Subject
    given: HandState  # pose parameters of the input
    progress_of: Callable[[str], OnStep]  # progress callback of a stage, by its name
    generator: torch.Generator  # source of all noise

    def relied_on(
        self,
        surface: MovingSurface | None,
        poses: Float[Tensor, " T"],
        near: Float[Tensor, " T"],
        chosen: Preset,
        fps: float,
        *,
        ray: Float[Tensor, "T 3"] | None = None,
        rests: bool = False,
        object_noise: Float[Tensor, " 2"] | None = None,
    ) -> tuple[Float[Tensor, "S T 21 3"], Float[Tensor, " T"]]:
        """Samples with the object, blended with samples of the hand alone where it is unreliable.

        `poses` and `near` are as in `geneoh.objects.evidence.blended`; `ray` and `rests` as in
        `StageContext`. Also returns `near` times the evidence from SpatialDiff that the hand
        touches the object.
        """
        samples = None
        if surface is not None and bool((near * poses > LEAST_EVIDENCE).any()):
            seen = with_held_part_first(self.subject.joints, surface)
            context = stage_context(seen, self.subject, fps, generator=self.generator)
            context = replace(
                context,
                canonical=chosen.canonical,
                ray=ray,
                rests=rests,
                object_noise=object_noise,
                relied=poses,
            )
            samples, width = self.samples(context, chosen)
            if chosen.observed and chosen.motion is not None:
                samples = without_jitter_over_object(context, samples, self.subject.joints)
            if width is not None:
                near = near * evidence_of_place(width)
        if samples is None or bool((near * poses < 1).any()):
            free = self._alone(chosen.alone(), fps, ray)
            samples = free if samples is None else blended(free, samples, poses, near, fps)
        return samples, near

    def _alone(
        self, preset: Preset, fps: float, ray: Float[Tensor, "T 3"] | None
    ) -> Float[Tensor, "S T 21 3"]:
        """Samples of the hand alone, in a frame that moves with it where it travels."""
        along = travelled(self.subject.joints, fps)
        subject = replace(self.subject, joints=self.subject.joints - along[:, None])
        given = replace(self.given, wrist=self.given.wrist - along)
        context = replace(hand_alone(subject, fps), ray=ray)
        free, _ = replace(self, subject=subject, given=given).samples(context, preset)
        return without_jitter(free, subject.joints, fps) + along[:, None]

    def samples(
        self, context: StageContext, preset: Preset
    ) -> tuple[Float[Tensor, "S T 21 3"], Float[Tensor, " T"] | None]:
        """MotionDiff, SpatialDiff and TemporalDiff in order, all samples in one batch; and the
        standard deviation of SpatialDiff's shift in each frame, metres, or None without it.

        Raises:
            CheckpointError: a network predicts NaN or infinity, or a hand far from the input.
        """
        if preset.observed:
            joints, width = self._by_parameters(context, preset)
        else:
            joints, width = self._by_paper(context, preset), None
        if isinstance(preset.temporal, DirectPlan):
            joints = denoise_temporal(
                self.denoisers.temporal,
                self.subject.joints[None],
                joints,
                context,
                on_step=self.progress_of("temporal"),
            )
        apart = (finite_output(joints) - self.subject.joints).abs().max()
        if apart > FARTHEST:
            raise CheckpointError(
                f"expected keypoints near the input from the networks, got some {apart:.0f} m "
                "away; their weights are damaged, train or download them again"
            )
        return joints, width

    def _by_parameters(
        self, context: StageContext, preset: Preset
    ) -> tuple[Float[Tensor, "S T 21 3"], Float[Tensor, " T"] | None]:
        """MotionDiff and SpatialDiff on hand parameters."""
        start = self.given
        turn, fingers = start.rotations[..., 0, :, :], start.pose[..., 1:, :]
        observed = HandParameters(start.wrist, turn, fingers, self.subject.offsets)
        hand = repeated(observed, preset.samples)
        if preset.motion is not None:
            hand = denoise_motion(
                self.denoisers.motion,
                observed,
                context,
                preset.motion,
                samples=preset.samples,
                generator=self.generator,
                on_step=self.progress_of("motion"),
            )
            hand.map(finite_output)
        width = None
        if isinstance(preset.spatial, PlacePlan):
            hand, width = self.placed(observed, hand, context, preset.spatial)
        parts = [hand[frames].joints for frames in blocks(context.frames)]
        return torch.cat(parts, dim=1), width

    def placed(
        self, observed: HandParameters, hand: HandParameters, context: StageContext, plan: PlacePlan
    ) -> tuple[HandParameters, Float[Tensor, " T"]]:
        """`denoise_spatial`. Along a camera's ray nearly any hand can be moved to an object; if the
        object rests, contact must determine the position to some extent without the ray, too."""
        place = partial(denoise_spatial, self.denoisers.spatial, observed, hand, plan=plan)
        on_step = self.progress_of("spatial")
        found, width = place(context=context, generator=self.generator, on_step=on_step)
        if context.ray is None or not context.rests:
            return found, width
        # its own generator, so that the samples stay as they are
        again = torch.Generator().manual_seed(self.generator.initial_seed())
        _, wide = place(context=replace(context, ray=None), generator=again)
        return found, width.maximum(WITHOUT_RAY * wide)

    def _by_paper(self, context: StageContext, preset: Preset) -> Float[Tensor, "S T 21 3"]:
        """All three stages on keypoints, in the form of the paper."""
        joints = self.subject.joints.expand(preset.samples, -1, -1, -1)
        for name, (network, stage) in OF_THE_PAPER.items():
            plan, model = getattr(preset, name), getattr(self.denoisers, network)
            if isinstance(plan, StagePlan):
                on_step = self.progress_of(name)
                joints = stage(
                    model, joints, context, plan, generator=self.generator, on_step=on_step
                )
        return joints
