"""Videos with cuts: find the shots, which are cleaned one by one, and join their results."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import torch

from geneoh.bundle import concatenated
from geneoh.errors import shortened
from geneoh.metrics.report import over_shots, through_walls
from geneoh.objects.examination import ObjectExamination
from geneoh.pipeline.results import Denoised, HandResult
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.sequence.shots import paths_of, shots_of

COUNTS = re.compile(r"\d frames?\b(?! a second)")
"""A number of frames in a note, which is that of one shot."""


def cuts_in(sequence: Sequence) -> list[int]:
    """First frames of all shots but the first: a leap of one hand cuts all hands, unless the other
    hand or the object goes on evenly."""
    cuts: set[int] = set()
    for hand in sequence.hands:
        beside = paths_of((h for h in sequence.hands if h is not hand), sequence.object)
        cuts |= {shot.start for shot in shots_of(hand, sequence.fps, beside)}
    return sorted(cuts - {0})


def common_shots(sequence: Sequence) -> list[slice]:
    """Shots that can be cleaned independently: in each, every hand is observed, and so is the
    object if it is observed in any frame. A shot that lacks one is merged with its neighbour."""

    def is_whole(shot: slice) -> bool:
        part = sequence[shot]
        hands = all(bool(hand.observed.any()) for hand in part.hands)
        return hands and part.object.is_seen == sequence.object.is_seen

    starts, stop = [0], sequence.frames
    for cut in cuts_in(sequence):
        if is_whole(slice(starts[-1], cut)) and is_whole(slice(cut, stop)):
            starts.append(cut)
    return [slice(start, end) for start, end in pairwise([*starts, stop])]


def shot_of(sequence: Sequence, shot: slice) -> Sequence:
    """One shot of a video. Before the first and after the last observed pose of a part in it, the
    part rests: between shots, missing poses lead from one place to another. A part that is in no
    frame of the shot keeps its poses, none of which counts."""
    part = sequence[shot]
    seen = part.object.observed
    between = (seen.cumsum(0) > 0) & (seen.flip(0).cumsum(0).flip(0) > 0)
    return replace(part, object=fill_object(part.object, between | ~seen.any(0)))


def told_of(sequence: Sequence, shots: list[slice]) -> Iterator[str]:
    """Sentences for the user about cuts: between `shots`, and inside of them."""
    within = [shot.start + cut for shot in shots for cut in cuts_in(sequence[shot])]
    for where, cure in (
        ([shot.start for shot in shots[1:]], "each shot is cleaned by itself"),
        (
            within,
            "frames beside it may be mixed; clean each shot by itself, in a file of its own with "
            "the hands that it shows",
        ),
    ):
        if where:
            yield (
                "cuts: a hand leaps to another place before frame "
                f"{shortened(', '.join(map(str, where)), 60)}, as at a cut of the video: {cure}"
            )


def joined_shots(parts: list[Denoised], shots: list[slice]) -> Denoised:
    """Concatenate the results of all shots; their hands have the same betas."""
    first = parts[0]
    depths = [part.hands_in_each_other for part in parts if part.hands_in_each_other]
    examined = [part.examined for part in parts if part.examined]
    objects = with_masks(part.sequence.object for part in parts)
    sequences = [
        replace(part.sequence, object=track) for part, track in zip(parts, objects, strict=True)
    ]
    return replace(
        first,
        sequence=concatenated(sequences),
        hands={side: _joined_hand([p.hands[side] for p in parts], shots) for side in first.hands},
        notes=_said([part.notes for part in parts], shots),
        examined=_joined_examination(examined) if examined else None,
        hands_in_each_other=tuple(map(max, zip(*depths, strict=True))) if depths else None,
    )


def with_masks(tracks: Iterable[ObjectTrack]) -> list[ObjectTrack]:
    """The tracks, all with the mask `valid` if any of them has one: a shot in which poses are
    repeated gets one."""
    found = list(tracks)
    if all(track.valid is None for track in found):
        return found
    return [replace(track, valid=track.observed) for track in found]


def _joined_hand(parts: list[HandResult], shots: list[slice]) -> HandResult:
    """Concatenate one hand over all shots, with the kept sample of each shot first; the share of
    frames in which it goes through a wall is told of all shots at once."""
    parts = [replace(part, samples=part.samples.roll(-max(part.chosen, 0), 0)) for part in parts]
    seen = [int((~part.filled).sum()) for part in parts]
    moved = sum(count * part.moved for count, part in zip(seen, parts, strict=True)) / sum(seen)
    notes = [
        tuple(note for note in part.notes if note not in through_walls(part.before, part.after))
        for part in parts
    ]
    before = over_shots([part.before for part in parts])
    after = over_shots([part.after for part in parts])
    return replace(
        concatenated(parts),
        samples=concatenated(parts, "N").samples,
        chosen=min(parts[0].chosen, 0),
        before=before,
        after=after,
        moved=moved,
        moved_most=max(part.moved_most for part in parts),
        windows=sum(part.windows for part in parts),
        seconds=dict(sum((Counter(part.seconds) for part in parts), Counter())),
        notes=(*_said(notes, shots), *through_walls(before, after)),
    )


def _joined_examination(parts: list[ObjectExamination]) -> ObjectExamination:
    """Concatenate the examinations of all shots."""
    aligned = with_masks(part.aligned for part in parts)
    masked = [replace(part, aligned=track) for part, track in zip(parts, aligned, strict=True)]
    return replace(
        concatenated(masked),
        is_noisy=torch.stack([part.is_noisy for part in parts]).any(0),
    )


def _said(notes: list[tuple[str, ...]], shots: list[slice]) -> tuple[str, ...]:
    """Notes that all shots share once, and others, and those that count frames, with the frames of
    their shot."""
    sentences: dict[str, None] = {}
    for own, shot in zip(notes, shots, strict=True):
        frames = f"frames {shot.start} to {shot.stop - 1}"
        for words in own:
            everywhere = all(words in each for each in notes) and not COUNTS.search(words)
            sentences[words if everywhere else f"{frames}: {words}"] = None
    return tuple(sentences)
