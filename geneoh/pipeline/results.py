"""The result of cleaning, and how it is saved and loaded."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.arguments import checked_call
from geneoh.bundle import Bundle, ByValue, Index, show_text
from geneoh.choices import SIDES, Side
from geneoh.errors import InputError, numbered
from geneoh.files.npz import Arrays, read_archive
from geneoh.files.outputs import check_ending, keep_others
from geneoh.fitting.terms import HandState
from geneoh.geometry.rigid import Rigid
from geneoh.metrics.report import (
    InteractionReport,
    before_and_after,
    format_number,
    through_walls,
)
from geneoh.objects.examination import ObjectExamination
from geneoh.pipeline.options import Options
from geneoh.readers.npz.files import save_sequence
from geneoh.sequence.placing import placed_hand, placed_object
from geneoh.sequence.resample import nearest_frames, poses_over_frames
from geneoh.sequence.sequence import HandTrack, Sequence

FROM_ARRAYS = "geneoh.from_arrays makes a Sequence of arrays"
"""Advice for whoever passes arrays where a sequence is expected."""


@runtime_checkable
class Result(Protocol):
    """A sequence that geneoh made: by cleaning (`Denoised`) or by a generator."""

    @property
    def sequence(self) -> Sequence:
        """Hands and object."""
        ...

    def extra_arrays(self) -> Arrays:
        """What a file of the result holds beside the fields of its sequence."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class HandResult(ByValue, Bundle):
    """The result of one hand."""

    track: HandTrack
    """The clean hand, as in the sequence of the result."""
    filled: Bool[Tensor, " T"]
    """Frames in which the input had no hand; there the hand comes from the networks alone."""
    samples: Float[Tensor, "S N 21 3"]
    """Keypoints of every sample after the three stages, before the fit: world frame, metres, not
    mirrored, at 30 frames a second."""
    chosen: int
    """Index of the sample that was kept; -1 for the mean. If the shots of a video were cleaned one
    by one, the kept sample of each shot comes first."""
    before: InteractionReport
    """Measures of the input, at 30 frames a second."""
    after: InteractionReport
    """Measures of the result, at 30 frames a second."""
    moved: float
    """Mean distance in metres between the keypoints of the input and of the result, over the
    observed frames, at 30 frames a second."""
    moved_most: float
    """The largest of the means over the keypoints of each of these frames, metres."""
    windows: int
    """Number of overlapping windows that the track was cut into."""
    seconds: dict[str, float] = field(compare=False)
    """Computing time of each stage, seconds."""
    notes: tuple[str, ...]
    """Assumptions about the hand, as sentences."""
    contact: Float[Tensor, "T 5"] | None
    """Probability that each finger touches the object, from the thumb to the little finger; see
    `geneoh.pipeline.touch`. None without an object."""
    evidence: Float[Tensor, " T"]
    """Share of each frame, 0 to 1, that was cleaned against the object. The rest, where the object
    is not reliable, was cleaned by the prior of hand motion alone."""

    def __getitem__(self, frames: Index) -> "HandResult":
        """The chosen frames, and the samples of their time."""
        samples = samples_during(self.samples, len(self.filled), frames)
        return replace(super().__getitem__(frames), samples=samples)

    def placed(self, pose: Rigid) -> "HandResult":
        """The same hand and samples after a rigid motion in each frame."""
        samples = poses_over_frames(pose, self.samples.shape[1]).apply(self.samples)
        return replace(self, track=placed_hand(self.track, pose), samples=samples)

    def measures(self) -> Iterator[str]:
        """Each measure before and after, indented, for people to read."""
        for line in before_and_after(self.before, self.after):
            yield f"  {line}"

    def lines(self) -> Iterator[str]:
        """What changed, and notes, for people to read."""
        yield from self.measures()
        mean, most = 1000 * self.moved, 1000 * self.moved_most
        yield f"  keypoints moved by {mean:.1f} mm on average, {most:.1f} mm in the frame with most"
        if count := int(self.filled.sum()):
            frames = numbered(count, "unobserved frame")
            yield f"  {frames} filled in; see {self.track.side}_filled in the file"
        for note in self.notes:
            yield f"  note: {note}"

    def work_done(self) -> str:
        """How many windows and samples were drawn, and the computing time of each stage."""
        spent = ", ".join(f"{stage} {took:.1f} s" for stage, took in self.seconds.items())
        drawn = f"{numbered(self.windows, 'window')}, {numbered(len(self.samples), 'sample')}"
        if len(self.samples) > 1:
            kept = "their mean" if self.chosen < 0 else f"number {self.chosen + 1}"
            drawn += f" ({kept} kept)"
        return f"{drawn}; {spent}"


@dataclass(frozen=True, eq=False, repr=False)
class Denoised(ByValue, Bundle):
    """The result of `geneoh.denoise`. As text it is what the command prints."""

    sequence: Sequence
    """The input with clean hands. Its frames are unchanged, and so is its object without
    `Options.refine_object`."""
    hands: dict[Side, HandResult]
    """The result of each hand."""
    notes: tuple[str, ...]
    """Assumptions about the sequence, as sentences."""
    options: Options = field(default_factory=Options)
    """The settings of this result."""
    examined: ObjectExamination | None = None
    """Estimated noise of the object's track; None with `Options.trust_object`, and without one."""
    hands_in_each_other: tuple[float, float] | None = None
    """Largest penetration depth between two hands, metres, before and after cleaning, over all
    frames at 30 frames a second; None for one hand."""
    doubts: tuple[str, ...] = ()
    """Doubts about the input, such as about its side, each with a remedy."""

    _repr_pretty_ = show_text

    def __str__(self) -> str:
        return "\n".join((*(f"note: {doubt}" for doubt in self.doubts), *self.lines()))

    def __getitem__(self, frames: Index) -> "Denoised":
        """The chosen frames; a step of n divides the frame rate by n. Measures stay as they are."""
        hands = {side: hand[frames] for side, hand in self.hands.items()}
        return replace(super().__getitem__(frames), sequence=self.sequence[frames], hands=hands)

    def seen_from(self, camera: Rigid, given: Sequence) -> "Denoised":
        """The result for a sequence that was given in the frame of a moving camera and cleaned in
        the world. Poses of the object stay as they were, unless they were filled or refined."""
        back, examined = camera.inverse(), self.examined
        motion = placed_object(self.sequence.object, back)
        if not self.options.refine_object:
            motion = given.object.filled_from(motion)
        if examined is not None:
            examined = replace(examined, aligned=placed_object(examined.aligned, back))
        hands = {side: hand.placed(back) for side, hand in self.hands.items()}
        tracks = tuple(hands[hand.side].track for hand in self.sequence.hands)
        clean = replace(given, hands=tracks, object=motion)
        return replace(self, sequence=clean, hands=hands, examined=examined)

    def lines(self) -> Iterator[str]:
        """The computing time of each stage, what changed, and notes, for people to read."""
        for side, hand in self.hands.items():
            yield f"{side} hand: {hand.work_done()}"
            yield from hand.lines()
        yield from self._of_clip()

    def measures(self) -> Iterator[str]:
        """Measures of the hands before and after, and notes on the clip, without what concerns the
        input of hands: for people to read of hands that a generator made."""
        for side, hand in self.hands.items():
            yield f"{side} hand:"
            yield from hand.measures()
            for note in through_walls(hand.before, hand.after):
                yield f"  note: {note}"
        yield from self._of_clip()

    def notes_on_made_hands(self) -> tuple[str, ...]:
        """The notes of `measures`: on each hand, and on the clip."""
        through = (
            f"{side} hand: {note}"
            for side, hand in self.hands.items()
            for note in through_walls(hand.before, hand.after)
        )
        return (*through, *self.notes)

    def _of_clip(self) -> Iterator[str]:
        """Penetration depth of two hands in each other, and notes on the sequence."""
        yield from self.between_hands()
        for note in self.notes:
            yield f"note: {note}"

    def between_hands(self) -> Iterator[str]:
        """Penetration depth of two hands in each other, before and after."""
        if self.hands_in_each_other is not None:
            before, after = (format_number(1000 * depth) for depth in self.hands_in_each_other)
            yield f"depth of the hands in each other, deepest: {before} -> {after} mm"

    def notes_of_clip(self) -> tuple[str, ...]:
        """What was assumed of the input, doubts about it, notes on it, and the depth of two hands
        in each other where the input or the result has any."""
        overlap = self.between_hands() if any(self.hands_in_each_other or ()) else ()
        return (*self.sequence.assumed, *self.doubts, *self.notes, *overlap)

    def sentences(self) -> tuple[str, ...]:
        """`notes_of_clip`, and notes on its hands, each once."""
        of_hands = (
            f"{side} hand: {note}" for side, hand in self.hands.items() for note in hand.notes
        )
        return tuple(dict.fromkeys((*self.notes_of_clip(), *of_hands)))

    def extra_arrays(self) -> Arrays:
        """`options`, the settings as JSON; `notes` (N,), the `sentences`; `object_confidence`
        (T, Q), how much the object's poses agree with one another; and per side `filled` (T,),
        frames without a hand in the input; `finger_contact` (T, 5), the probability that each
        finger touches the object; and, if several samples were drawn, `samples` (S, N, 21, 3),
        their keypoints in metres at 30 frames a second before selection and fit.
        """
        options = json.dumps(asdict(self.options), default=str)
        arrays: Arrays = {"options": np.array(options), "notes": np.array(self.sentences(), str)}
        if self.examined is not None:
            arrays["object_confidence"] = self.examined.confidence.detach().cpu().numpy()
        for side, hand in self.hands.items():
            arrays[f"{side}_filled"] = hand.filled.cpu().numpy()
            if hand.contact is not None:
                arrays[f"{side}_finger_contact"] = hand.contact.detach().cpu().numpy()
            if len(hand.samples) > 1:
                arrays[f"{side}_samples"] = hand.samples.detach().cpu().numpy()
        return arrays


def samples_during(
    samples: Float[Tensor, "S N 21 3"], count: int, frames: Index
) -> Float[Tensor, "S M 21 3"]:
    """The samples, which have a rate of their own, from the first to the last of some evenly spaced
    frames of a clip of `count`; of other frames the sample nearest to each."""
    frames = frames.cpu().numpy() if isinstance(frames, Tensor) else frames
    chosen = np.arange(count)[frames]
    at, steps = nearest_frames(samples.shape[1], count).numpy()[chosen], np.diff(chosen)
    if len(at) and (steps > 0).all() and (steps == steps[:1]).all():
        at = np.arange(at[0], at[-1] + 1)
    return samples[:, at]


def clean_track(
    state: HandState,
    joints: Float[Tensor, "T 21 3"],
    betas: Float[Tensor, " S"],
    hand_model: str,
    spread: Float[Tensor, "T 21"] | None,
) -> HandTrack:
    """The track of a fitted right hand, valid in all frames; `spread` is its `joint_spread`."""
    return HandTrack(
        side="right",
        valid=torch.ones_like(joints[:, 0, 0], dtype=torch.bool),
        joints=joints,
        pose=state.pose[0],
        wrist=state.wrist[0],
        betas=betas,
        hand_model=hand_model,
        joint_spread=spread,
    )


@checked_call
def save(result: Result | Sequence, path: Path | str, *, overwrite: bool = False) -> None:
    """Write a result of cleaning or of a generator, or any sequence, as a geneoh-sequence npz,
    atomically.

    For a result the file contains its `extra_arrays` beside the fields of its sequence. Meshes stay
    in their own files, and the npz holds the paths; a mesh without a file is not saved, with a
    logged warning. A file that geneoh did not write is replaced only with `overwrite`. One that it
    wrote is always replaced, even if the result was made from it.

    Raises:
        InputError: the path cannot be written to, is a file that geneoh did not write, or does not
            end in `.npz`; or a sequence has no hand, two of one side, another number of frames than
            its object, or betas of two models.
    """
    if not isinstance(result, Result | Sequence):
        takes = "geneoh.save takes a result or a Sequence, then the path to write to"
        raise InputError(f"{takes}, got {type(result).__name__} first; {FROM_ARRAYS}")
    check_ending(Path(path), (".npz",))
    if not overwrite:
        keep_others(Path(path), remedy="pass overwrite=True to replace it, or choose another name")
    if isinstance(result, Sequence):
        save_sequence(result, path)
    else:
        save_sequence(result.sequence, path, extra=result.extra_arrays())


def kept_arrays(path: Path | str) -> Arrays:
    """The arrays of an npz; empty for a file of another kind, which cannot be a result."""
    return read_archive(Path(path)) if Path(path).suffix.lower() == ".npz" else {}


def kept_samples(arrays: Arrays) -> dict[Side, Float[Tensor, "S N 21 3"]]:
    """Keypoints of the samples among the arrays of a result, by side, at 30 frames a second; empty
    if there are none."""
    found: dict[Side, Tensor] = {}
    for side in SIDES:
        drawn = arrays.get(f"{side}_samples")
        if drawn is not None and drawn.shape[2:] == (21, 3):
            found[side] = torch.from_numpy(drawn).float()
    return found


def kept_filled(arrays: Arrays) -> dict[Side, Bool[Tensor, " T"]]:
    """Frames of each hand of a result that its input lacked, by side; empty if unknown."""
    found: dict[Side, Tensor] = {}
    for side in SIDES:
        filled = arrays.get(f"{side}_filled")
        if filled is not None and filled.dtype == bool and filled.ndim == 1:
            found[side] = torch.from_numpy(filled)
    return found


def kept_notes(arrays: Arrays) -> tuple[str, ...]:
    """The `Denoised.sentences` of a result, or the notes of a generator; empty if unknown."""
    notes = arrays.get("notes")
    if notes is None or notes.dtype.kind != "U" or notes.ndim != 1:
        return ()
    return tuple(notes.tolist())


def kept_confidence(arrays: Arrays) -> Float[Tensor, "T Q"] | None:
    """The confidence of the object's poses of a result; None if it is unknown."""
    kept = arrays.get("object_confidence")
    return None if kept is None or kept.ndim != 2 else torch.from_numpy(kept).float()
