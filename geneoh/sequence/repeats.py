"""Poses of an object that repeat the one before while it moves, as of a slower sensor or video.

Programs that bring poses to the rate of the hand often take the nearest one. The object then stands
still for a frame and leaps in the next, and shakes the hand that is seen from it.
"""

from collections.abc import Iterator

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.errors import numbered
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import runs

LEAP, LEVER = 0.002, 0.07
"""Metres of a step from which on the object moves, and metres for which a change of its rotation
matrix counts: by √2 for each radian, which moves a point that is 10 cm off by as much as 10 cm."""
FEWEST, FEWEST_BRIEF, BRIEF, LONGER = 5, 3, 4, 2
"""Stops between leaps that are no chance, and fewer where most last at most so many frames; and how
many times their median length one may last: a longer one is a rest."""


def without_repeats(motion: ObjectTrack) -> tuple[ObjectTrack, tuple[str, ...]]:
    """The track with poses between the others in place of repeated ones, and what to say of it.

    Repeated poses are not `valid` in it.
    """
    repeats = repeated_poses(motion)
    if not bool(repeats.any()):
        return motion, ()
    said = tuple(repeats_told(motion, repeats, "taken as missing"))
    return fill_object(motion, ~repeats), said


def repeats_told(motion: ObjectTrack, repeats: Bool[Tensor, "T Q"], cure: str) -> Iterator[str]:
    """What a user should know of repeated poses, part by part, with what is done or to do."""
    for part, count in enumerate(repeats.sum(0).tolist()):
        if count:
            yield (
                f"the pose of {motion.name_of(part)} repeats the one before, between two leaps, in "
                f"{numbered(count, 'frame')}: {cure}"
            )


def repeated_poses(motion: ObjectTrack) -> Bool[Tensor, "T Q"]:
    """Poses that are exactly the one before, between leaps; none where that is rare."""
    seen = motion.observed.cpu()
    found = torch.zeros_like(seen)
    steps = torch.cat([motion.translation, LEVER * motion.rotation.flatten(2)], -1).diff(dim=0)
    stays = (steps == 0).all(-1).cpu() & seen[1:] & seen[:-1]
    for part in range(found.shape[1]):
        stops = [each for each in runs(stays[:, part].numpy()) if goes_on(steps[:, part], each)]
        lengths = [stop.stop - stop.start for stop in stops]
        usual = float(np.median(lengths)) if lengths else 0.0
        enough = len(stops) >= (FEWEST_BRIEF if usual <= BRIEF else FEWEST)
        for stop, length in zip(stops, lengths, strict=True):
            found[stop.start + 1 : stop.stop + 1, part] = enough and length <= LONGER * usual
    return found.to(motion.rotation.device)


def goes_on(steps: Float[Tensor, "N D"], stop: slice) -> bool:
    """Whether steps are leaps before and after a stop, in the same direction.

    What turns back does stand still for a moment.
    """
    if stop.start == 0 or stop.stop == len(steps):
        return False
    before, after = steps[stop.start - 1], steps[stop.stop]
    return bool(min(before.norm(), after.norm()) > LEAP and before @ after > 0)
