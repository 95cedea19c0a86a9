"""From a noisy interaction to a clean one: the whole pipeline in one place."""

import logging
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.arguments import checked_call
from geneoh.choices import Selection, Side
from geneoh.denoisers.library import Denoisers, load_denoisers
from geneoh.fitting.adam import AdamFitConfig, fit_with_adam
from geneoh.fitting.fit import fit_hand
from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.subject import Subject, subject_of
from geneoh.fitting.terms import HandState
from geneoh.fitting.twist import untwisted
from geneoh.geometry.distance import MovingSurface
from geneoh.hand.library import hand_of_betas
from geneoh.hand.model import HandModel, ShapedHand
from geneoh.modes import undisturbed
from geneoh.nn.devices import named_device
from geneoh.objects.carrying import carrier_of
from geneoh.objects.cleaning import clean_object
from geneoh.objects.evidence import evidence_at_hand, evidence_of_nearness, evidence_of_poses
from geneoh.objects.palms import palm_of
from geneoh.objects.refine import refine_object
from geneoh.objects.sharpening import sharpened
from geneoh.pipeline.exchange import without_exchange
from geneoh.pipeline.faults import without_faults
from geneoh.pipeline.fitted import FittedHand, kept_apart
from geneoh.pipeline.inputs import as_sequence, checked_interaction, collapsed_sentences
from geneoh.pipeline.options import Options, with_settings
from geneoh.pipeline.presets import Preset
from geneoh.pipeline.rays import with_found_rays
from geneoh.pipeline.results import Denoised, HandResult
from geneoh.pipeline.shots import common_shots, joined_shots, told_of
from geneoh.pipeline.stage_run import StageRun
from geneoh.progress import OnProgress, OnStep, timed
from geneoh.readers.convention_check import doubts
from geneoh.readers.delay_check import hand_delay
from geneoh.sequence.gaps import filled_poses
from geneoh.sequence.normalisation import NETWORK_FPS, NormalisedHand, normalised_hands
from geneoh.sequence.repeats import without_repeats
from geneoh.sequence.resample import nearest_frames, with_hands_earlier
from geneoh.sequence.sequence import HandTrack, Sequence

LOG = logging.getLogger(__name__)

NO_OBJECT = (
    "no mesh or no pose of an object was given: the hand was cleaned by the prior of hand motion "
    "alone, and nothing is known of contact; --obj MESH names a mesh"
)
NOT_REFINED = "poses of the object are not refined (--refine-object): there are none, or no mesh"


@checked_call
def denoise(
    sequence: Sequence | Path | str,
    options: Options | None = None,
    *,
    obj: Path | str | Iterable[Path | str] | None = None,
    on_progress: OnProgress | None = None,
    **settings: Any,
) -> Denoised:
    """Clean every hand of a sequence against its object.

        result = geneoh.denoise(sequence, preset="fast")
        result = geneoh.denoise("noisy.npz", obj="mesh.obj")

    The stages know right hands at 30 frames a second only: left hands are mirrored and other rates
    resampled here and back. They see the hand from the object, so an object whose poses shake or
    jump is cleaned first (`geneoh.objects.cleaning`), and a filter that one of hand and object went
    through is undone (`geneoh.objects.sharpening`); the report is measured against that object. The
    same input, options and seed give the same result. The work is done on `options.device`; the
    result is on the device of the sequence. What is doubtful about the input is logged as a warning
    before the work. The caller's random state and modes of torch are neither used nor changed.

    Args:
        sequence: up to two hands and an object with its meshes, in metres, or the npz file of it.
            Without a mesh the hands are cleaned by the prior of hand motion alone, and the result's
            notes say so.
        options: the settings; the default preset without them.
        obj: mesh file of the object, or one per rigid part, where `sequence` brings none.
        on_progress: called with the stage ("motion", "spatial", "temporal" or "fit") and its steps
            done and in all; both hands of a sequence go through the stages one after the other.
        settings: fields of `Options` by name, such as preset="fast", instead of those of `options`.

    Raises:
        InputError: the numbers of the sequence can be no interaction.
        ConfigError: an option does not exist, is out of range, or names no device of this machine.
        MissingAssetError: a MANO hand is asked for and there is no MANO file.
        CheckpointError: the folder of weights holds no weights of this version, or damaged ones.
    """
    options = with_settings(options, settings)
    named_device(options.device)
    with undisturbed():
        given = as_sequence(sequence, obj)
        sequence = with_hands_earlier(checked_interaction(given), options.hand_delay)
        name = sequence.source.partition(" (")[0] or "the sequence"
        sequence, exchange = without_exchange(sequence)
        sequence, lost = without_faults(sequence)
        shots = [slice(0, sequence.frames)]
        if isinstance(options.resolved().fit, FitConfig):  # the paper's finds one shape for all
            shots = common_shots(sequence)
        told = (*collapsed_sentences(given), *exchange, *lost, *told_of(sequence, shots))
        doubtful = (*told, *doubts(sequence, name))
        for words in doubtful:
            LOG.warning("%s: %s", name, words)
        if len(shots) < 2:
            result = clean_interaction(sequence, options, on_progress)
        else:
            alike = with_one_shape(sequence, options)
            parts = [clean_interaction(alike[shot], options, on_progress) for shot in shots]
            result = joined_shots(parts, shots)
        return replace(result, doubts=doubtful)


def with_one_shape(sequence: Sequence, options: Options) -> Sequence:
    """The sequence whose hands with keypoints have the betas that fit those of all frames."""
    subjects = {
        hand.side: subject_of(hand.track, _model(hand, options))
        for hand in normalised_hands(sequence)
    }

    def shaped(hand: HandTrack) -> HandTrack:
        subject = subjects[hand.side]
        return replace(hand, betas=subject.betas, hand_model=subject.shaped.model.name)

    hands = [hand if hand.joints is None else shaped(hand) for hand in sequence.hands]
    return replace(sequence, hands=tuple(hands))


def clean_interaction(
    sequence: Sequence, options: Options, on_progress: OnProgress | None = None
) -> Denoised:
    """Clean a sequence that has been checked; see `denoise`."""
    chosen = options.resolved()
    denoisers = load_denoisers(options.weights, device=options.device, paper=not chosen.observed)
    notes = [sequence.left_out] if sequence.left_out else []
    motion, examined = sequence.object, None
    if not motion.meshes or not motion.is_seen:
        motion = replace(motion, meshes=())
        chosen = chosen.alone()
        notes.append(NO_OBJECT)
        notes += [NOT_REFINED] if options.refine_object else ()
    notes += filled_poses(motion) if chosen.has_object else ()
    evidence, undone = torch.ones(sequence.frames, 1), list[HandTrack]()
    if chosen.clean_object:
        palms = tuple(map(palm_of, sequence.hands))
        motion, repeated = without_repeats(motion)
        motion, examined = clean_object(motion, sequence.fps, palms)
        notes += repeated
        notes += examined.sentences()
        delays = tuple(hand_delay(hand, motion, sequence.fps) for hand in sequence.hands)
        sharp = sharpened(sequence.hands, palms, delays, motion, examined, sequence.fps)
        undone = [h for h, new in zip(sequence.hands, sharp.hands, strict=True) if new is not h]
        sequence, motion = replace(sequence, hands=sharp.hands), sharp.object
        notes += sharp.notes
        relied = evidence_of_poses(examined, motion, sequence.fps, sharp.off)
        evidence = relied[:, motion.seen_parts]
    # a part that was never seen stands at the origin, where a hand must not meet it
    met = motion.of_parts(motion.seen_parts) if motion.meshes else motion
    seen, said = with_found_rays(replace(sequence, object=met), chosen)
    notes += said
    normalised = normalised_hands(seen)
    told = dict[Side, HandTrack]()
    if undone:
        as_told = normalised_hands(replace(seen, hands=tuple(undone)))
        told = {hand.side: hand.track for hand in as_told}
    if normalised[0].track.frames != sequence.frames:
        how = "averaged" if sequence.fps > NETWORK_FPS else "resampled"
        notes.append(f"{how} from {sequence.fps:g} to {NETWORK_FPS:g} frames a second and back")
    fitted: list[FittedHand] = []
    for hand in normalised:
        relied = evidence[nearest_frames(sequence.frames, hand.track.frames)]
        moved = hand.to(options.device)
        found = _fitted(
            moved,
            told.get(hand.side),
            _model(moved, options),
            relied.to(options.device),
            None if examined is None else examined.white_noise,
            denoisers,
            chosen,
            options.seed,
            on_progress,
        )
        fitted.append(found)
    fitted, in_each_other = kept_apart(fitted)
    results: dict[Side, HandResult] = {
        hand.side: _as_given(found.result(), hand, sequence.hand(hand.side))
        for found, hand in zip(fitted, normalised, strict=True)
    }
    hands = tuple(results[hand.side].track for hand in sequence.hands)
    kept = sequence.object
    if options.refine_object and examined is not None:
        kept = refine_object(motion, examined, hands, sequence.fps)
    clean = replace(sequence, hands=hands, object=kept)
    return Denoised(clean, results, tuple(notes), options, examined, in_each_other)


def _as_given(result: HandResult, hand: NormalisedHand, given: HandTrack) -> HandResult:
    """The result of a normalised hand in the frames, the side and the place of the given track."""
    result = result.to(given.valid.device)
    return replace(
        result,
        track=replace(hand.track_to_user(result.track), camera_ray=given.camera_ray),
        filled=~given.observed,
        samples=hand.points_to_user(result.samples),
        contact=None if result.contact is None else hand.frames_to_user(result.contact),
        evidence=hand.frames_to_user(result.evidence),
    )


def _model(hand: NormalisedHand, options: Options) -> HandModel:
    """The model of whose hand it is, as a right one."""
    model = hand_of_betas(
        hand.side, hand.track.hand_model, asked=options.hand, mano_dir=options.mano_dir
    )
    return hand.right_model(model)


@torch.no_grad()
def _fitted(
    hand: NormalisedHand,
    told: HandTrack | None,
    model: HandModel,
    relied: Float[Tensor, "N Q"],
    object_noise: Float[Tensor, " 2"] | None,
    denoisers: Denoisers,
    chosen: Preset,
    seed: int,
    on_progress: OnProgress | None,
) -> FittedHand:
    """One normalised hand: three stages, selection, fit. Frames fall back to the hand alone by as
    much as `relied`, how far the poses of the object's parts are relied on, is below 1. The report
    is about the track that was `told`, where a filter was undone in it."""
    generator = torch.Generator().manual_seed(seed)
    surface = hand.object.surface() if hand.object.meshes else None
    against = surface if chosen.has_object else None  # what the hand is cleaned against
    carrier = None if against is None else carrier_of(hand.track, against, relied)
    asked = subject_of(hand.track, model, carrier)
    subject = untwisted(asked)
    # MotionDiff starts from the parameters of the input
    given = subject.parameters()
    # the paper's stages know no skeleton
    subject, seen = subject.in_own_skeleton(given) if chosen.observed else (subject, given)
    subject = subject.completed(seen)
    near = torch.full_like(relied[:, 0], float(against is not None))
    poses = relied.amin(1)
    if against is not None and chosen.clean_object:
        poses = evidence_at_hand(relied, subject.joints, against)
        near = evidence_of_nearness(subject.joints, against, hand.fps, hand.track.camera_ray)
    seconds: dict[str, float] = {}
    progress_of = timed(on_progress, seconds)
    stages = StageRun(denoisers, subject, seen, progress_of, generator)
    ray = hand.track.camera_ray
    samples, near = stages.relied_on(
        surface, poses, near, chosen, hand.fps, ray=ray, object_noise=object_noise
    )
    index, target = _select(samples, subject, chosen.selection)
    on_step = progress_of("fit")
    state, shaped, betas = _fit(target, subject, given, chosen, surface, near * poses, on_step)
    if told is not None:
        asked = subject_of(told.to(hand.track.valid.device), model, carrier)
    before = given if asked.start is subject.start else asked.parameters()
    return FittedHand(
        hand=hand,
        subject=subject,
        given=before,
        given_joints=subject.joints if told is None else asked.completed(before).joints,
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
    given: HandState,
    chosen: Preset,
    surface: MovingSurface | None,
    evidence: Float[Tensor, " T"],
    on_step: OnStep,
) -> tuple[HandState, ShapedHand, Tensor]:
    """Hand parameters, shape and betas that are fitted to the target, from those of the input on.
    Filled frames count like observed ones, because the stages have filled them."""
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
    return state, subject.shaped, subject.betas
