"""From a moving body and a sentence to hands on it, at any frame rate and in any world."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import torch

from geneoh.arguments import checked_call, given_options
from geneoh.body.motion import BodyMotion, grounded, pose, turned_body
from geneoh.body.skeleton import BODY_JOINTS, FINGER_JOINTS, PARENTS, WRISTS
from geneoh.bundle import ByValue, show_text
from geneoh.choices import GENERATION, STEPS
from geneoh.config import check_fields
from geneoh.errors import InputError, numbered
from geneoh.files.npz import Arrays
from geneoh.generators.both2hands.features import with_other_fingers
from geneoh.generators.both2hands.library import load_both2hands
from geneoh.generators.both2hands.sampling import generate_hands
from geneoh.generators.both2hands.sentences import check_sentence, ruled_out_words, unknown_words
from geneoh.geometry.rotations import axis_angle_to_matrix, turn_up
from geneoh.nn.devices import named_device
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.pipeline.results import Denoised
from geneoh.progress import OnProgress
from geneoh.readers.bodies.base import BodyRecording, body_at_rate
from geneoh.readers.bodies.read import read_body
from geneoh.readers.bodies.smpl import body_fields
from geneoh.readers.checks.holding import TOUCHING_REACH
from geneoh.sequence.body_hands import hand_tracks
from geneoh.sequence.distance_check import distance_to_object
from geneoh.sequence.resample import rotations_over_frames
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.synthesis.actions.action import FPS


@dataclass(frozen=True)
class BodyOptions:
    """The settings of `geneoh.generate_on_body`; the defaults are those of the command."""

    steps: int = STEPS
    """Denoising steps, 1 to 1,000."""
    refine: Literal["geneoh", "none"] = "geneoh"
    """How hands that hold an object are cleaned: "geneoh", by `geneoh.denoise`; or "none"."""
    weights: Path | None = None
    """Folder of networks, as `geneoh train` writes it; missing ones are the shipped ones."""
    text_encoder: Path | None = None
    """Folder of a CLIP or sentence-transformers model, for networks that were trained with it."""
    seed: int = 0
    """Seed of all random numbers; another one makes other hands."""
    device: str = "cpu"
    """Device of the networks and the cleaner, as torch names it. Results are on the CPU."""

    def __post_init__(self) -> None:
        """Take paths given as text, and refuse values that no setting has."""
        check_fields(self, GENERATION)


NOTED_DISTANCE_MM = 5.0
"""Distance in millimetres of a body's wrists from those of its hands above which it is noted."""


@dataclass(frozen=True, eq=False, repr=False)
class BodyWithHands(ByValue):
    """A body whose fingers were made for a sentence. As text it is what the command prints."""

    body: BodyRecording
    """The body that was passed, with fingers; the rest of it is unchanged, except for wrist
    rotations that `denoise` has corrected."""
    sequence: Sequence
    """Both hands, and the object where one was given, in the world of the body's file."""
    sentence: str
    refined: Denoised | None
    """The result of the cleaner; None if it did not run."""

    _repr_pretty_ = show_text

    def __str__(self) -> str:
        body, frames = self.body, numbered(self.body.frames, "frame")
        lines = [f"read {body.source}: {frames} at {body.fps:g} frames a second"]
        lines += [f"note: {note}" for note in body.notes]
        lines += self.refined.measures() if self.refined else ()
        if (apart := 1000 * self.wrists_apart()) > NOTED_DISTANCE_MM:
            lines.append(
                f"note: the arms of the body stay: a wrist is up to {apart:.0f} mm off that of its "
                "hand, and a BVH and the names of smplx have the body's"
            )
        return "\n".join(lines)

    def wrists_apart(self) -> float:
        """Largest distance between a wrist of the body and that of its hand track, metres."""
        places = pose(self.body.skeleton, self.body.file_motion).positions
        change = (
            places[:, WRISTS[h.side]] - h.wrist for h in self.sequence.hands if h.wrist is not None
        )
        return max(float(each.norm(dim=-1).max()) for each in change)

    def extra_arrays(self) -> Arrays:
        """The body by smplx names (`geneoh.readers.bodies.smpl.body_fields`), `prompt` and `notes`
        (N,), for `geneoh.save`."""
        notes = (*self.body.notes, *(self.refined.notes_on_made_hands() if self.refined else ()))
        said = {"prompt": np.array(self.sentence), "notes": np.array(notes, str)}
        return body_fields(self.body) | said


@checked_call
def generate_on_body(
    sentence: str,
    body: BodyRecording | Path | str,
    options: BodyOptions | None = None,
    *,
    held: ObjectTrack | None = None,
    on_progress: OnProgress | None = None,
) -> BodyWithHands:
    """Give a moving body hands that fit its motion and a sentence.

        made = geneoh.generate_on_body("the right hand waves, the left rests", "walk.npz")

    Args:
        sentence: such as "the right hand waves, the left rests"; English.
        body: a recording or its file, see `geneoh.readers.bodies.read.read_body`. Its fingers are
            ignored.
        options: see `BodyOptions`.
        held: an object with meshes, in the world and the frames of the body's file. Hands near it
            are cleaned with `geneoh.denoise`.
        on_progress: called for the stage "hands" and for those of the cleaner.

    Raises:
        InputError: the sentence is empty, too long or not English, or the file holds no body.
        ConfigError: the options are invalid, or they name no device of this machine.
        CheckpointError: weights are missing or damaged.
    """
    chosen, sentence = BodyOptions() if options is None else options, " ".join(sentence.split())
    options = given_options(chosen, BodyOptions, "geneoh.generate_on_body")
    device = named_device(options.device)
    check_sentence(sentence)
    if not isinstance(held, ObjectTrack | None):
        raise InputError(
            "geneoh.generate_on_body: 'held' must be an ObjectTrack or none, got "
            f"{type(held).__name__}; a Sequence has one in .object"
        )
    body, notes = body_of(body), list[str]()
    if held is not None and len(held.rotation) != body.frames:
        raise InputError(
            f"geneoh.generate_on_body: 'held' must have as many frames as the body, {body.frames}, "
            f"got {len(held.rotation)}; cut them to the same frames"
        )
    if words := ruled_out_words(sentence):
        notes.append(f"'{words}' may not be followed; say what the hands do instead")
    is_shipped = options.weights is None and options.text_encoder is None
    if is_shipped and (note := unknown_words(sentence)):
        notes.append(note)
    if held is not None and held.is_seen and not held.meshes:
        notes.append(
            "the object has poses and no mesh, so that no hand is brought to it; --obj names one"
        )
    body = replace(body, notes=(*body.notes, *notes))
    paced = body_at_rate(body, FPS)
    made = generate_hands(
        grounded(paced.skeleton, paced.motion).to(device),
        paced.skeleton,
        sentence,
        steps=options.steps,
        generator=torch.Generator().manual_seed(options.seed),
        networks=load_both2hands(options.weights, text_encoder=options.text_encoder, device=device),
        on_step=on_progress and partial(on_progress, "hands"),
    ).to("cpu")
    fingers = rotations_over_frames(made.rotations[:, BODY_JOINTS:], body.frames)
    body = replace(body, motion=with_other_fingers(body.motion, fingers), has_fingers=True)
    sequence = Sequence(
        hand_tracks(body.skeleton, body.file_motion),
        held or ObjectTrack.resting((), body.frames),
        body.fps,
        f"generated: {sentence}",
    )
    if held is None or not held.meshes or options.refine == "none":
        return BodyWithHands(body, sequence, sentence, None)
    cleaning = Options(seed=options.seed, device=options.device)
    sequence, refined = _cleaned(sequence, cleaning, on_progress)
    return BodyWithHands(with_hands(body, sequence), sequence, sentence, refined)


def body_of(recording: BodyRecording | Path | str) -> BodyRecording:
    """The body itself, or the one in the named file; `InputError` for another type."""
    if isinstance(recording, BodyRecording):
        return recording
    if isinstance(recording, Path | str):
        return read_body(recording)
    raise InputError(
        "geneoh.generate_on_body takes a sentence, then a body or its file, got "
        f"{type(recording).__name__}; geneoh.readers.bodies.read.read_body reads one"
    )


def _cleaned(
    sequence: Sequence, options: Options, on_progress: OnProgress | None
) -> tuple[Sequence, Denoised]:
    """The sequence with cleaned hands; a hand that never comes near the object is not cleaned.

    If neither comes near, both go to the cleaner, which reports this.
    """
    near = [
        hand
        for hand in sequence.hands
        if bool((distance_to_object(hand, sequence.object) < TOUCHING_REACH).any())
    ]
    near_object = replace(sequence, hands=tuple(near) or sequence.hands)
    refined = denoise(near_object, options, on_progress=on_progress)
    hands = {hand.side: hand for hand in (*sequence.hands, *refined.sequence.hands)}
    whole = replace(refined.sequence, hands=tuple(hands.values()), source=sequence.source)
    return whole, refined


def with_hands(body: BodyRecording, sequence: Sequence) -> BodyRecording:
    """The body with the finger and wrist rotations of a sequence in its file's world.

    The arms are kept, so that a wrist may be some millimetres from that of the sequence.
    """
    motion = body.file_motion
    above = pose(body.skeleton, motion).rotations
    turns = motion.rotations.clone()
    for hand in sequence.hands:
        if hand.pose is not None:
            own, wrist = axis_angle_to_matrix(hand.pose), WRISTS[hand.side]
            turns[:, wrist] = above[:, PARENTS[wrist]].transpose(-1, -2) @ own[:, 0]
            turns[:, list(FINGER_JOINTS[hand.side])] = own[:, 1:]
    motion = BodyMotion(motion.root, turns)
    return replace(body, motion=turned_body(motion, turn_up(body.up, "y").to(turns)))
