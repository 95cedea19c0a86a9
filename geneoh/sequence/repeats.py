"""Poses of an object that repeat the one before while it moves, as of a slower sensor or video.

Programs that bring poses to the rate of the hand often take the nearest one. The object then stands
still for a frame and leaps in the next, and shakes the hand that is seen from it.
"""

from collections.abc import Iterator

import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from geneoh.errors import numbered
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import runs

LEAP, LEAP_TURN = 0.002, 0.02
"""Metres and radians of a step from which on the object moves."""
FEWEST, LONGER = 5, 2
"""Stops between leaps that are no chance, and how many times as long as usual one of them may be:
what is longer is a rest."""


def without_repeats(motion: ObjectTrack) -> ObjectTrack:
    """The track with poses between the others in place of repeated ones, which are not `valid`."""
    repeats = repeated_poses(motion)
    return fill_object(motion, ~repeats) if bool(repeats.any()) else motion


def repeats_told(motion: ObjectTrack, cure: str) -> Iterator[str]:
    """What a user should know of repeated poses, part by part, with what is done or to do."""
    for part, count in enumerate(repeated_poses(motion).sum(0).tolist()):
        if count:
            yield (
                f"the pose of {motion.name_of(part)} repeats the one before, between two leaps, in "
                f"{numbered(count, 'frame')}: {cure}"
            )


def repeated_poses(motion: ObjectTrack) -> Bool[Tensor, "T Q"]:
    """Poses that are exactly the one before, between leaps; none where that is rare."""
    found = torch.zeros(motion.rotation.shape[:2], dtype=torch.bool)
    seen = torch.ones_like(found) if motion.valid is None else motion.valid.cpu()
    shift = motion.translation.diff(dim=0).norm(dim=-1)
    # of small angles, the norm of the difference of two rotations is the square root of 2 of it
    turn = motion.rotation.diff(dim=0).flatten(2).norm(dim=-1) / 2**0.5
    leaps = np.pad(((shift > LEAP) | (turn > LEAP_TURN)).cpu().numpy(), ((1, 1), (0, 0)))
    still = (shift == 0) & (turn == 0)
    for part in range(found.shape[1]):
        stays = (still[:, part].cpu() & seen[1:, part] & seen[:-1, part]).numpy()
        stops = [s for s in runs(stays) if leaps[s.start, part] and leaps[s.stop + 1, part]]
        if len(stops) >= FEWEST:
            lengths = [stop.stop - stop.start for stop in stops]
            usual = float(np.median(lengths))
            for stop, length in zip(stops, lengths, strict=True):
                found[stop.start + 1 : stop.stop + 1, part] = length <= LONGER * usual
    return found.to(motion.rotation.device)
