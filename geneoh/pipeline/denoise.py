"""The whole cleaning pipeline, from a noisy interaction to a clean one."""

import logging
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from geneoh.arguments import checked_call
from geneoh.choices import Side
from geneoh.denoisers.library import load_denoisers
from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.subject import subject_of
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.openings import SHEET_THICKNESS
from geneoh.hand.library import hand_of_betas
from geneoh.hand.mano import mano_folder
from geneoh.hand.model import HandModel
from geneoh.nn.devices import named_device
from geneoh.objects.camera_motion import steady_camera
from geneoh.objects.held_in_gaps import held_in_gaps
from geneoh.objects.palms import palm_of
from geneoh.objects.refine import refine_object
from geneoh.pipeline.examination.examined import with_missing_poses
from geneoh.pipeline.examination.exchange import without_exchange
from geneoh.pipeline.examination.faults import without_faults
from geneoh.pipeline.examination.following import without_following
from geneoh.pipeline.examination.shots import common_shots, joined_shots, shot_of, told_of
from geneoh.pipeline.fitted import FittedHand, kept_apart
from geneoh.pipeline.hand_run import HandRun
from geneoh.pipeline.inputs import as_sequence, checked_interaction, left_out
from geneoh.pipeline.options import Options, with_settings
from geneoh.pipeline.preparation import (
    OF_FILLED_POSES,
    OF_OTHER_POSES,
    Prepared,
    brought_to_world,
    prepared,
    told_of_camera,
)
from geneoh.pipeline.results import Denoised, HandResult
from geneoh.progress import OnProgress
from geneoh.readers.checks.convention import doubts
from geneoh.readers.npz.hands import with_keypoints
from geneoh.sequence.normalisation import NormalisedHand, normalised_hands
from geneoh.sequence.resample import nearest_frames, with_hands_earlier
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

LOG = logging.getLogger(__name__)

POSES = "rotation", "translation"
EXACT = "poses of the object are left as they are (--refine-object): they count as exact"


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
    return cleaned(as_sequence(sequence, obj), options, on_progress)


def cleaned(
    taken: Sequence,
    options: Options,
    on_progress: OnProgress | None = None,
    *,
    tell: Callable[..., None] = LOG.warning,
) -> Denoised:
    """Clean a sequence as `denoise` does, which describes the arguments; `tell` logs the doubts."""
    sequence = checked_interaction(taken)
    folder = mano_folder(options.mano_dir)
    hands = tuple(with_keypoints(hand, folder) for hand in sequence.hands)
    sequence = replace(sequence, hands=hands)
    if taken.object.meshes and taken.object.is_seen:
        sequence = with_hands_earlier(sequence, options.hand_delay)
    given, camera = sequence, steady_camera(sequence)
    repeated: tuple[str, ...] = ()
    if camera is not None:
        sequence, repeated = brought_to_world(given, camera, options)
    name = sequence.source.partition(" (")[0] or "the sequence"
    sequence, exchange = without_exchange(sequence)
    sequence, followed = without_following(sequence)
    sequence, lost = without_faults(sequence)
    shots = [slice(0, sequence.frames)]
    if isinstance(options.resolved().fit, FitConfig):  # the paper's finds one shape for all
        shots = common_shots(sequence)
    notes = (*left_out(taken), *exchange, *followed, *lost)
    notes = (*notes, *told_of(sequence, shots))
    doubtful = (*notes, *doubts(_as_observed(sequence, options), name))
    for words in doubtful:
        tell("%s: %s", name, words)
    if len(shots) < 2:
        result = clean_interaction(sequence, options, on_progress, stored=given.object)
    else:
        alike = with_one_shape(sequence, options)
        parts = [
            clean_interaction(shot_of(alike, shot), options, on_progress, stored=given.object[shot])
            for shot in shots
        ]
        result = joined_shots(parts, shots)
    if camera is not None:
        result = result.seen_from(camera, given)
        notes = told_of_camera((*repeated, *result.notes), camera, sequence.fps)
        result = replace(result, notes=notes)
    return replace(result, doubts=doubtful)


def _as_observed(sequence: Sequence, options: Options) -> Sequence:
    """The sequence as doubts look at it: without poses of the object that the cleaning leaves out,
    as behind those of a tracker that lost it the hand seems late."""
    motion = sequence.object
    if not motion.meshes or not motion.is_seen or not options.resolved().clean_object:
        return sequence
    found, _ = with_missing_poses(sequence.hands, motion, sequence.fps)
    return replace(sequence, object=found)


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
    sequence: Sequence,
    options: Options,
    on_progress: OnProgress | None = None,
    *,
    stored: ObjectTrack | None = None,
) -> Denoised:
    """Clean a sequence that has been checked; see `denoise`. Missing poses are told of `stored`,
    the object as it was given, where repeated poses were taken out of that of the sequence."""
    ready = prepared(sequence, options, stored or sequence.object)
    chosen, examination = ready.preset, ready.examined.examination
    denoisers = load_denoisers(options.weights, device=options.device, paper=not chosen.observed)
    noise = None if examination is None else examination.white_noise
    run = HandRun(denoisers, chosen, noise, options.seed, on_progress)
    fitted, in_each_other = kept_apart(_fitted(ready, run, options))
    notes = [*ready.notes, *open_meshes(ready.examined.object, fitted[0].surface)]
    results: dict[Side, HandResult] = {
        hand.side: ready.as_given(found.result(), hand)
        for found, hand in zip(fitted, ready.hands, strict=True)
    }
    hands = tuple(results[hand.side].track for hand in sequence.hands)
    met = ready.examined.object
    if options.refine_object and examination is not None:
        kept = refine_object(met, examination, hands, sequence.fps)
        notes += [EXACT] if _same_poses(kept, sequence.object) else []
    else:
        filled = sequence.object.filled_from(met)
        kept = sequence.object.filled_from(held_in_gaps(met, map(palm_of, hands)))
        notes += [] if _same_poses(met, filled) else [OF_OTHER_POSES]
        notes += [] if _same_poses(filled, kept) else [OF_FILLED_POSES]
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


def _fitted(ready: Prepared, run: HandRun, options: Options) -> list[FittedHand]:
    """Each hand after its fit, on `options.device`; see `HandRun.fitted`."""
    tracks = {hand.side: hand.track for hand in ready.undone}
    fitted: list[FittedHand] = []
    for hand in ready.hands:
        there, found = hand.to(options.device), ready.examined
        relied = found.relied if hand.track.camera_ray is None else found.relied_by_ray
        at = relied[nearest_frames(len(relied), hand.track.frames)].to(options.device)
        fitted.append(run.fitted(there, _model(there, options), at, tracks.get(hand.side)))
    return fitted


def _model(hand: NormalisedHand, options: Options) -> HandModel:
    """The hand model of a normalised hand, as a right hand."""
    model = hand_of_betas(
        hand.side, hand.track.hand_model, asked=options.hand, mano_dir=options.mano_dir
    )
    return hand.right_model(model)
