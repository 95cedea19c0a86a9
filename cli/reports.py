"""Results as lines of text."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from geneoh.errors import numbered
from geneoh.metrics.report import before_and_after, through_walls
from geneoh.pipeline.results import Denoised
from geneoh.sequence.sequence import Sequence

NOTED_DISTANCE_MM = 5.0
"""Distance in millimetres of a body's wrists from those of its hands above which it is printed."""

if TYPE_CHECKING:
    from geneoh.generators.both2hands.on_body import BodyWithHands
    from geneoh.generators.text2hoi.generate import Generated


def denoised(sequence: Sequence, result: Denoised, output: Path) -> Iterator[str]:
    """What was read, the time of each stage, what changed, and notes."""
    parts, frames = len(sequence.object.meshes), numbered(sequence.frames, "frame")
    yield (
        f"read {sequence.source}: {frames} at {sequence.fps:g} frames a second, "
        + (f"object of {numbered(parts, 'part')}" if parts else "no object")
    )
    yield from result.lines()
    yield f"wrote {output}"


def generated(made: "Generated", output: Path) -> Iterator[str]:
    """What was understood and generated, and the measures of the cleaner."""
    sequence, prompt = made.sequence, made.prompt
    for note in prompt.notes:
        yield f"note: {note}"
    hands = " and ".join(hand.side for hand in sequence.hands)
    frames, seconds = numbered(sequence.frames, "frame"), sequence.frames / sequence.fps
    yield f"{prompt.verb} with the {hands} hand: {frames}, {seconds:.1f} s"
    yield from mended_hands(made.refined)
    yield f"wrote {output}"


def mended_hands(result: Denoised | None) -> Iterator[str]:
    """Measures of generated hands before and after the cleaner; none where it was not used."""
    for side, hand in ({} if result is None else result.hands).items():
        yield f"{side} hand:"
        for line in before_and_after(hand.before, hand.after):
            yield f"  {line}"
        for note in through_walls(hand.before, hand.after):
            yield f"  note: {note}"
    if result is not None:
        yield from result.between_hands()


def hands_on_body(made: "BodyWithHands", outputs: Iterable[Path]) -> Iterator[str]:
    """What was read and assumed, the measures of the cleaner, and what was written."""
    body = made.body
    frames = numbered(body.frames, "frame")
    yield f"read {body.source}: {frames} at {body.fps:g} frames a second"
    for note in body.notes:
        yield f"note: {note}"
    yield from mended_hands(made.refined)
    if (apart := 1000 * made.wrists_apart()) > NOTED_DISTANCE_MM:
        yield (
            f"note: the arms of the body stay: a wrist is up to {apart:.0f} mm off that of its "
            "hand, and a BVH and the names of smplx have the body's"
        )
    for output in outputs:
        yield f"wrote {output}"
