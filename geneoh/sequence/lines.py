"""Frames that a program put on a straight line between two observed ones, without a mark.

Many pipelines interpolate the frames in which a tracker lost hand or object before they write the
track. No measured motion follows a line at an exactly even speed for several frames.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.errors import numbered
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import runs

FEWEST = 4
"""Least number of frames on a line, unless there are many lines of one length."""
REGULAR, OFTEN = range(2, 6), 5
"""Frames on each of many lines, and their least number: poses of 5 to 10 Hz were brought to 30."""
LEAST_STEP = 0.001
"""Least step on a line, metres a frame: a slower point may be on one by rounding."""
ROUNDING = 1e-6
"""Largest second difference on a line, metres, beside the rounding of float32."""
MOST = 0.5
"""Largest share of the observed frames on other lines: with more, as in an animation of few key
poses, the motion itself is made so."""


def on_lines(path: Float[Tensor, "T 3"], seen: Bool[Tensor, " T"]) -> Bool[Tensor, " T"]:
    """Mask of the frames in which a point is on a line between others, at an even speed."""
    found = torch.zeros_like(seen)
    if int(seen.sum()) < FEWEST + 2:
        return found
    steps = path.double().diff(dim=0)
    rounding = ROUNDING + 4 * torch.finfo(torch.float32).eps * float(path[seen].abs().max())
    even = (steps.diff(dim=0).abs() <= rounding).all(-1) & (steps[1:].norm(dim=-1) > LEAST_STEP)
    even &= seen[2:] & seen[1:-1] & seen[:-2]
    lines = runs(even.cpu().numpy())
    often, single = Counter(line.stop - line.start for line in lines), 0
    for line in lines:
        length = line.stop - line.start
        regular = length in REGULAR and often[length] >= OFTEN
        if regular or length >= FEWEST:
            found[line.start + 1 : line.stop + 1] = True
            single += 0 if regular else length
    return found if single <= MOST * seen.sum() else torch.zeros_like(found)


def poses_on_lines(motion: ObjectTrack) -> Bool[Tensor, "T Q"]:
    """Mask of the poses that are on a line between others of their part."""
    seen = motion.observed
    parts = range(seen.shape[1])
    return torch.stack([on_lines(motion.translation[:, q], seen[:, q]) for q in parts], dim=1)


def without_lines(
    motion: ObjectTrack, lines: Bool[Tensor, "T Q"] | None = None
) -> tuple[ObjectTrack, tuple[str, ...]]:
    """The track with poses on lines marked as not observed, and notes about them.

    `lines` says which ones they are, if that was found in the frame of a moving camera.
    """
    lines = poses_on_lines(motion) if lines is None else lines
    if not bool(lines.any()):
        return motion, ()
    return replace(motion, valid=motion.observed & ~lines), tuple(line_notes(motion, lines))


def line_notes(motion: ObjectTrack, lines: Bool[Tensor, "T Q"]) -> Iterator[str]:
    """Notes for the user about poses on lines, one per part."""
    for part, count in enumerate(lines.sum(0).tolist()):
        if count:
            yield (
                f"the pose of {motion.name_of(part)} moves on straight lines at an exactly even "
                f"speed in {numbered(count, 'frame')}, as where a program filled in lost ones: "
                "taken as missing"
            )
