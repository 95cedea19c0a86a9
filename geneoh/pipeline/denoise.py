"""From a noisy interaction to a clean one: the whole way of the data in one place."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.choices import Ablation, HandSource, PresetName, Selection, Side
from geneoh.denoisers.library import Denoisers, load_denoisers
from geneoh.errors import ConfigError, InputError
from geneoh.fitting.adam import AdamFitConfig, fit_with_adam
from geneoh.fitting.fit import fit_hand, fit_keypoints, start_from_keypoints
from geneoh.fitting.terms import HandState
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.mesh import size_warning
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.geometry.sampling import sample_surface
from geneoh.hand.library import hand_of_betas
from geneoh.hand.model import ShapedHand
from geneoh.metrics.report import InteractionReport, measure
from geneoh.pipeline.presets import Preset, preset
from geneoh.pipeline.spread import joint_spread
from geneoh.pipeline.stages import (
    StageContext,
    denoise_motion,
    denoise_spatial,
    denoise_temporal,
    denoise_trajectory,
)
from geneoh.pipeline.subject import Subject, subject_of
from geneoh.representation.parameters import HandParameters
from geneoh.sequence.resample import at_rate, over_frames
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.validation import check_sequence

RATE = 30.0
"""Frames a second that the networks know."""
SURFACE_POINTS = 1024
NEAR = 0.02
"""Vertices farther than this from the object's box need no exact distance in the fit, metres."""

OnProgress = Callable[[str, int, int], None]
"""Called with the stage's name and its steps done and in all."""


@dataclass(frozen=True)
class Options:
    """What a user can choose; see `geneoh denoise --help`."""

    preset: PresetName = "default"
    samples: int | None = None
    """Diffusion chains to draw; None leaves it to the preset."""
    seed: int = 0
    steps: int | None = None
    selection: Selection | None = None
    """Which sample is kept; None leaves it to the preset."""
    without: tuple[Ablation, ...] = ()
    """Parts left out, to see what they are worth."""
    hand: HandSource = "embedded"
    mano_dir: Path | None = None
    weights: Path | None = None
    device: str = "cpu"

    def resolved(self) -> Preset:
        """The preset with the user's changes; `ConfigError` when a number is out of range."""
        chosen = preset(self.preset)
        for name, value in (("samples", self.samples), ("steps", self.steps)):
            if value is not None and value < 1:
                raise ConfigError(
                    f"--{name} must be 1 or more, got {value}; leave it out or raise it"
                )
        if self.steps is not None:
            chosen = chosen.with_steps(self.steps)
        for part in self.without:
            chosen = chosen.without(part)
        return replace(
            chosen,
            samples=self.samples or chosen.samples,
            selection=self.selection or chosen.selection,
        )


@dataclass(frozen=True)
class HandResult:
    """What cleaning did to one hand."""

    track: HandTrack
    filled: Bool[Tensor, " T"]
    """Frames that the input did not hold: the prior's, not the observation's."""
    samples: Float[Tensor, "S N 21 3"]
    """Keypoints of every sample after the three stages, before the fit, at 30 frames a second."""
    chosen: int
    """Index of the sample that was kept; -1 for their mean."""
    before: InteractionReport
    after: InteractionReport
    moved: float
    """Mean distance in metres between the input's keypoints and the output's, observed frames."""
    windows: int
    seconds: dict[str, float]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Denoised:
    """A clean sequence and the story of how it came about."""

    sequence: Sequence
    hands: dict[Side, HandResult]
    notes: tuple[str, ...]


def denoise(
    sequence: Sequence, options: Options | None = None, *, on_progress: OnProgress | None = None
) -> Denoised:
    """Clean every hand of a sequence against its object.

    Left hands are mirrored to right ones here and back, other frame rates become 30 a second here
    and back: nothing below knows of either. The same options and seed give the same result.

    Raises:
        InputError: the sequence cannot be cleaned as it is.
        ConfigError: an option is out of range.
    """
    options = options or Options()
    chosen = options.resolved()
    if not sequence.object.meshes:
        raise InputError(f"{sequence.source}: expected an object mesh, got none; pass --obj MESH")
    check_sequence(sequence, sequence.source)
    denoisers = load_denoisers(
        options.weights, device=options.device, trajectory=not chosen.observed
    )
    notes = [note for mesh in sequence.object.meshes if (note := size_warning(mesh))]
    paced = at_rate(sequence, RATE)
    if paced is not sequence:
        notes.append(f"resampled from {sequence.fps:g} to {RATE:g} frames a second and back")
    results: dict[Side, HandResult] = {}
    for hand in paced.hands:
        left = hand.side == "left"
        track = hand.mirrored() if left else hand
        moving = paced.object.mirrored() if left else paced.object
        model = hand_of_betas(
            hand.side, hand.hand_model, asked=options.hand, mano_dir=options.mano_dir
        )
        subject = subject_of(track, model.mirrored() if left else model)
        result = _clean_right_hand(
            track, moving, subject, denoisers, chosen, options, paced.fps, on_progress
        )
        results[hand.side] = _returned(result, hand.side, sequence.frames, paced)
    hands = tuple(results[hand.side].track for hand in sequence.hands)
    clean = replace(sequence, hands=hands)
    return Denoised(clean, results, tuple(notes))


def _clean_right_hand(
    track: HandTrack,
    moving: ObjectTrack,
    subject: Subject,
    denoisers: Denoisers,
    chosen: Preset,
    options: Options,
    fps: float,
    on_progress: OnProgress | None,
) -> HandResult:
    """One right hand at the networks' rate: three stages, selection, fit, measurement."""
    generator = torch.Generator().manual_seed(options.seed)
    surface = moving.surface()
    context = stage_context(surface, subject, fps, generator=generator)
    context = replace(context, canonical=chosen.canonical)
    seconds: dict[str, float] = {}

    def progress_of(stage: str) -> Callable[[int, int], None]:
        began = time.monotonic()

        def step(done: int, total: int) -> None:
            seconds[stage] = time.monotonic() - began
            if on_progress is not None:
                on_progress(stage, done, total)

        return step

    with torch.no_grad():
        # the input as it came: what MotionDiff starts from, and the mesh of the comparison
        given = subject.start or fit_keypoints(
            subject.joints[None], subject.trust[None], subject.shaped
        )
        samples = _run_stages(
            denoisers, context, subject, given, chosen, progress_of, generator=generator
        )
        index, target = _select(samples, subject, chosen.selection)
        state, shaped, betas = _fit(
            target, subject, chosen, replace(surface, within=NEAR), progress_of("fit")
        )
        posed = shaped.verts_from_rotations(state.rotations, state.wrist)
        raw = subject.shaped.verts_from_rotations(given.rotations, given.wrist)
    clean = HandTrack(
        side="right",
        valid=torch.ones_like(track.valid),
        joints=posed.joints[0],
        pose=matrix_to_axis_angle(state.rotations)[0],
        wrist=state.wrist[0],
        betas=betas,
        hand_model=shaped.model.name,
        joint_spread=joint_spread(samples) if len(samples) > 1 else None,
    )
    seen = subject.trust > 0
    return HandResult(
        track=clean,
        filled=~track.valid,
        samples=samples,
        chosen=index,
        before=measure(raw.verts[0], subject.joints, surface, fps),
        after=measure(posed.verts[0], posed.joints[0], surface, fps),
        moved=float((posed.joints[0] - subject.joints).norm(dim=-1)[seen].mean()),
        windows=len(context.starts),
        seconds=seconds,
        notes=subject.notes,
    )


def stage_context(
    surface: MovingSurface,
    subject: Subject,
    fps: float,
    *,
    generator: torch.Generator,
) -> StageContext:
    """The object's surface and motion; points are shared among parts by area."""
    fields = surface.fields
    areas = torch.stack([field.mesh.face_vectors().norm(dim=-1).sum() for field in fields])
    counts = (SURFACE_POINTS * areas / areas.sum()).round().long().clamp(min=16)
    drawn = [
        sample_surface(field.solid, int(count), generator=generator)
        for field, count in zip(fields, counts, strict=True)
    ]
    return StageContext(
        points=torch.cat([part.points for part in drawn]),
        normals=torch.cat([part.normals for part in drawn]),
        part=torch.arange(len(fields)).repeat_interleave(counts),
        rotation=surface.rotation,
        translation=surface.translation,
        trust=subject.trust,
        fps=fps,
    )


def _run_stages(
    denoisers: Denoisers,
    context: StageContext,
    subject: Subject,
    given: HandState,
    chosen: Preset,
    progress_of: Callable[[str], Callable[[int, int], None]],
    *,
    generator: torch.Generator,
) -> Float[Tensor, "S T 21 3"]:
    """MotionDiff, SpatialDiff and TemporalDiff in order, all samples in one batch."""
    joints = subject.joints.expand(chosen.samples, -1, -1, -1)
    if chosen.motion is not None and chosen.observed:
        joints = denoise_motion(
            denoisers.motion,
            HandParameters(
                given.wrist, given.rotations[..., 0, :, :], given.pose[..., 1:, :], subject.offsets
            ),
            context,
            chosen.motion,
            samples=chosen.samples,
            generator=generator,
            on_step=progress_of("motion"),
        ).joints
    elif chosen.motion is not None:
        assert denoisers.trajectory is not None, "it was asked for"
        joints = denoise_trajectory(
            denoisers.trajectory,
            joints,
            context,
            chosen.motion,
            generator=generator,
            on_step=progress_of("motion"),
        )
    if chosen.spatial is not None:
        joints = denoise_spatial(
            denoisers.spatial,
            joints,
            context,
            chosen.spatial,
            observed=chosen.observed,
            generator=generator,
            on_step=progress_of("spatial"),
        )
    if chosen.temporal is not None:
        joints = denoise_temporal(
            denoisers.temporal,
            joints,
            context,
            chosen.temporal,
            observed=chosen.observed,
            correct=chosen.correct,
            align=chosen.align,
            generator=generator,
            on_step=progress_of("temporal"),
        )
    return joints


def _select(
    samples: Float[Tensor, "S T 21 3"], subject: Subject, selection: Selection
) -> tuple[int, Float[Tensor, "1 T 21 3"]]:
    """The sample nearest to the input where it was seen, as in the paper, or the mean of all."""
    if selection == "mean":
        return -1, samples.mean(0, keepdim=True)
    apart = ((samples - subject.joints).norm(dim=-1) * subject.trust).sum((1, 2))
    index = int(apart.argmin())
    return index, samples[index : index + 1]


def _fit(
    target: Float[Tensor, "1 T 21 3"],
    subject: Subject,
    chosen: Preset,
    surface: MovingSurface,
    on_step: Callable[[int, int], None],
) -> tuple[HandState, ShapedHand, Tensor]:
    """Hand parameters, shape and betas; filled frames count as much, the stages' prior filled
    them."""
    trust = torch.ones_like(target[..., 0])
    model = subject.shaped.model
    if isinstance(chosen.fit, AdamFitConfig):
        state, betas = fit_with_adam(target, trust, model, config=chosen.fit, on_step=on_step)
        return state, model.shaped(betas[0]), betas[0]
    start = subject.start or start_from_keypoints(target, subject.shaped)
    state = fit_hand(
        target,
        trust,
        subject.shaped,
        start,
        config=chosen.fit,
        surface=surface if chosen.contact else None,
        on_step=on_step,
    )
    return state, subject.shaped, subject.betas


def _returned(result: HandResult, side: Side, frames: int, paced: Sequence) -> HandResult:
    """The result in the user's handedness and frame rate."""
    back = over_frames(replace(paced, hands=(result.track,)), frames)
    track = back.hands[0]
    nearest = torch.linspace(0, paced.frames - 1, frames, dtype=torch.float64).round().long()
    if side == "left":
        flip = result.samples.new_tensor([-1.0, 1.0, 1.0])
        track, result = track.mirrored(), replace(result, samples=result.samples * flip)
    return replace(result, track=track, filled=result.filled[nearest])
