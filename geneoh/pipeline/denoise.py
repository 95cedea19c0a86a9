"""The whole cleaning pipeline, from a noisy interaction to a clean one."""

import logging
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.arguments import checked_call
from geneoh.choices import Side
from geneoh.denoisers.library import load_denoisers
from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.subject import subject_of
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.openings import SHEET_THICKNESS
from geneoh.geometry.rigid import Rigid
from geneoh.hand.library import hand_of_betas
from geneoh.hand.mano import mano_folder
from geneoh.hand.model import HandModel
from geneoh.modes import undisturbed
from geneoh.nn.devices import named_device
from geneoh.objects.refine import refine_object
from geneoh.objects.still_frame import placed, placed_hand, still_frame
from geneoh.pipeline.examination.examined import Examined, examined
from geneoh.pipeline.examination.exchange import without_exchange
from geneoh.pipeline.examination.faults import without_faults
from geneoh.pipeline.examination.following import without_following
from geneoh.pipeline.examination.rays import with_found_rays
from geneoh.pipeline.examination.shots import common_shots, joined_shots, told_of
from geneoh.pipeline.fitted import FittedHand, kept_apart
from geneoh.pipeline.hand_run import HandRun
from geneoh.pipeline.inputs import as_sequence, checked_interaction, collapsed_sentences
from geneoh.pipeline.options import Options, with_settings
from geneoh.pipeline.results import Denoised, HandResult
from geneoh.progress import OnProgress
from geneoh.readers.checks.convention import doubts
from geneoh.readers.npz.hands import with_keypoints
from geneoh.sequence.gaps import filled_poses, moved
from geneoh.sequence.normalisation import NETWORK_FPS, NormalisedHand, normalised_hands
from geneoh.sequence.resample import nearest_frames, poses_over_frames, with_hands_earlier
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

LOG = logging.getLogger(__name__)

NO_OBJECT = (
    "no mesh or no pose of an object was given: the hand was cleaned by the prior of hand motion "
    "alone, and nothing is known of contact; --obj MESH names a mesh"
)
OF_AN_OBJECT = ("trust_object", "refine_object", "hand_delay")
"""Options that have no effect without an object."""
MOVING_CAMERA = (
    "the camera moves: its motion was removed before the hand was cleaned, by the object while no "
    "hand moves with it, and accelerations are measured without it"
)
POSES = "rotation", "translation"
EXACT = "poses of the object are left as they are (--refine-object): they count as exact"
OF_OTHER_POSES = (
    "measures are against the cleaned poses of the object; a page measures against the poses in "
    "the file, which are the input's (--refine-object writes clean ones)"
)


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

    The stages process right hands at 30 frames a second only: left hands are mirrored and other
    frame rates resampled, and the result is converted back. The stages see the hand in the object
    frame, so noisy or jumping object poses are cleaned first (`geneoh.objects.cleaning`), and a
    low-pass filter that was applied to only one of hand and object is undone
    (`geneoh.objects.sharpening`); the report is measured against that object. The same input,
    options, seed and number of torch's threads give the same result. The work is done on
    `options.device`; the result is on the device of the sequence. Doubts about the input are logged
    as warnings before the work. The caller's random state and torch modes are neither used nor
    changed.

    Args:
        sequence: up to two hands and an object with its meshes, in metres, or the npz file of it.
            Without a mesh the hands are cleaned by the prior of hand motion alone, and the result's
            notes say so.
        options: the settings; the default preset without them.
        obj: mesh file of the object, or one per rigid part, where `sequence` brings none.
        on_progress: called with the stage ("motion", "spatial", "temporal" or "fit"), the number
            of its steps that are done and their total; two hands are cleaned one after the other.
        settings: fields of `Options` by name, such as preset="fast", instead of those of `options`.

    Raises:
        InputError: the sequence cannot be a hand-object interaction.
        ConfigError: an option does not exist, is out of range, or names no device of this machine.
        MissingAssetError: a MANO hand is requested and there is no MANO file.
        CheckpointError: the folder of weights holds no weights of this version, or damaged ones.
    """
    options = with_settings(options, settings)
    named_device(options.device)
    with undisturbed():
        taken = as_sequence(sequence, obj)
        sequence = checked_interaction(taken)
        folder = mano_folder(options.mano_dir)
        hands = tuple(with_keypoints(hand, folder) for hand in sequence.hands)
        sequence = replace(sequence, hands=hands)
        if taken.object.meshes and taken.object.is_seen:
            sequence = with_hands_earlier(sequence, options.hand_delay)
        name = sequence.source.partition(" (")[0] or "the sequence"
        sequence, exchange = without_exchange(sequence)
        sequence, followed = without_following(sequence)
        sequence, lost = without_faults(sequence)
        shots = [slice(0, sequence.frames)]
        if isinstance(options.resolved().fit, FitConfig):  # the paper's finds one shape for all
            shots = common_shots(sequence)
        notes = (*collapsed_sentences(taken), *exchange, *followed, *lost)
        notes = (*notes, *told_of(sequence, shots))
        doubtful = (*notes, *doubts(sequence, name))
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
    """The sequence with betas fitted over all frames, for each hand that has keypoints."""
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
    motion = sequence.object
    if not motion.meshes or not motion.is_seen:
        motion = replace(motion, meshes=())
        chosen = chosen.alone()
        notes.append(NO_OBJECT)
        notes += [
            f"--{name.replace('_', '-')} had no effect: it needs mesh and poses of an object"
            for name in OF_AN_OBJECT
            if getattr(options, name)
        ]
    notes += filled_poses(motion) if chosen.has_object else ()
    ready = Examined(sequence.hands, motion, torch.ones(len(motion.rotation), 1))
    if chosen.clean_object:
        ready = examined(sequence.hands, motion, sequence.fps)
    sequence = replace(sequence, hands=ready.hands)
    seen, ray_notes = with_found_rays(replace(sequence, object=ready.met), chosen)
    notes += [*ready.notes, *ray_notes]
    still = None
    if chosen.clean_object:
        still = still_frame(seen.hands, seen.object, seen.fps, ready.relied)
    undone = ready.undone
    if still is not None:
        seen = placed(seen, still)
        undone = tuple(placed_hand(hand, still) for hand in undone)
        notes.append(MOVING_CAMERA)
    normalised = normalised_hands(seen)
    if normalised[0].track.frames != sequence.frames:
        how = "averaged" if sequence.fps > NETWORK_FPS else "resampled"
        notes.append(
            f"{how} from {sequence.fps:g} to {NETWORK_FPS:g} frames a second and back: measures, "
            f"and how far keypoints moved, are at {NETWORK_FPS:g}, on a page at {sequence.fps:g}"
        )
    examination = ready.examination
    noise = None if examination is None else examination.white_noise
    run = HandRun(denoisers, chosen, noise, options.seed, on_progress)
    raw = normalised_hands(replace(seen, hands=undone)) if undone else ()
    fitted, in_each_other = kept_apart(_fitted(normalised, raw, ready.relied, run, options))
    notes += open_meshes(motion, fitted[0].surface)
    results: dict[Side, HandResult] = {
        hand.side: _as_given(found.result(), hand, sequence.hand(hand.side), still)
        for found, hand in zip(fitted, normalised, strict=True)
    }
    hands = tuple(results[hand.side].track for hand in sequence.hands)
    kept = sequence.object
    if options.refine_object and examination is not None:
        kept = refine_object(ready.object, examination, hands, sequence.fps)
        notes += [EXACT] if _same_poses(kept, sequence.object) else []
    elif not _same_poses(ready.object, kept):
        notes.append(OF_OTHER_POSES)
    clean = replace(sequence, hands=hands, object=kept)
    return Denoised(clean, results, tuple(notes), options, examination, in_each_other)


def _same_poses(one: ObjectTrack, other: ObjectTrack) -> bool:
    """Whether two objects have exactly the same poses."""
    return all(getattr(one, name).equal(getattr(other, name)) for name in POSES)


def open_meshes(motion: ObjectTrack, surface: MovingSurface | None) -> Iterator[str]:
    """A sentence for each part that was ever seen, of the given surface, whose mesh is so open that
    it is taken for a sheet: depth in its wall tells nothing of the depth in a solid."""
    if surface is None:
        return
    wall = 1000 * SHEET_THICKNESS
    for part, field in zip(motion.seen_parts, surface.fields, strict=True):
        if field.solid.walled:
            name = motion.name_of(part)
            yield (
                f"the mesh of {name} is open and taken for a sheet with a wall of {wall:g} mm, in "
                f"which no depth exceeds {wall / 2:g} mm; if {name} is solid there, close its mesh"
            )


def _fitted(
    hands: tuple[NormalisedHand, ...],
    undone: tuple[NormalisedHand, ...],
    relied: Float[Tensor, "T Q"],
    run: HandRun,
    options: Options,
) -> list[FittedHand]:
    """Each hand after its fit, on `options.device`; see `HandRun.fitted`."""
    tracks = {hand.side: hand.track for hand in undone}
    fitted: list[FittedHand] = []
    for hand in hands:
        moved = hand.to(options.device)
        at = relied[nearest_frames(len(relied), hand.track.frames)].to(options.device)
        fitted.append(run.fitted(moved, _model(moved, options), at, tracks.get(hand.side)))
    return fitted


def _as_given(
    result: HandResult, hand: NormalisedHand, given: HandTrack, still: Rigid | None
) -> HandResult:
    """The result of a normalised hand at the frame rate, side and position of the input track, and
    in its frame, which is at the poses `still` in the frame of the result."""
    result = result.to(given.valid.device)
    track, samples = hand.track_to_user(result.track), hand.points_to_user(result.samples)
    if still is not None:
        track = moved(track, still.inverse())
        samples = poses_over_frames(still, samples.shape[1]).inverse().apply(samples)
    return replace(
        result,
        track=replace(track, camera_ray=given.camera_ray),
        filled=~given.observed,
        samples=samples,
        contact=None if result.contact is None else hand.frames_to_user(result.contact),
        evidence=hand.frames_to_user(result.evidence),
    )


def _model(hand: NormalisedHand, options: Options) -> HandModel:
    """The hand model of a normalised hand, as a right hand."""
    model = hand_of_betas(
        hand.side, hand.track.hand_model, asked=options.hand, mano_dir=options.mano_dir
    )
    return hand.right_model(model)
