"""Repeated poses of a moving object, as from a sensor or video with a lower frame rate.

Programs that resample poses to the frame rate of the hand often take the nearest one. The object
then rests for a frame and leaps in the next, and the hand shakes in the object frame. So it does
once where a video has a frame twice and lacks the next, or a tracker keeps its last pose.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.errors import numbered
from geneoh.sequence.gaps import observed_around
from geneoh.sequence.resample import CurvedInterpolation
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import runs

LEAST_LEAP, METRES_PER_ROTATION = 0.002, 0.07
"""Least step of a moving object in metres, and the metres that a unit change of its rotation matrix
counts for: the matrix changes by √2 per radian, so a radian counts like 10 cm."""
FEWEST_STOPS, FEWEST_BRIEF_STOPS, BRIEF_FRAMES, REST_RATIO = 5, 3, 4, 2
"""Least number of stops that are not by chance, in general and where the median stop lasts at most
`BRIEF_FRAMES`; and the largest ratio of a stop to the median: a longer one is a true rest."""
MADE_UP = 0.15
"""Largest ratio of the squared changes of the steps around a stop, with the leap after it spread
over the stop, to those as they are, for a stop that is not by chance even if it is the only one. On
made clips it is below in 87 of 100 stops for which a leap makes up, and 0.196 or more in all that
the object only rests in."""


def without_repeats(
    motion: ObjectTrack, repeats: Bool[Tensor, "T Q"] | None = None
) -> tuple[ObjectTrack, tuple[str, ...]]:
    """The track with repeated poses replaced by interpolated ones, and notes about them.

    `repeats` says which ones they are, if that was found in another frame: poses that repeat in the
    frame of a moving camera do not in the world. The replaced poses are not `valid`. They follow
    cubic curves: five times a second, an object that starts or stops is centimetres off the
    straight line from one pose to the next.
    """
    repeats = repeated_poses(motion) if repeats is None else repeats
    if not bool(repeats.any()):
        return motion, ()
    notes = tuple(repeat_notes(motion, repeats, "taken as missing"))
    rotation, translation = motion.rotation.clone(), motion.translation.clone()
    for part in torch.nonzero(repeats.any(0))[:, 0].tolist():
        known = ~repeats[:, part]
        between, place = observed_around(known), known.cumsum(0) - 1
        curve = CurvedInterpolation(place[between.before], place[between.after], between.fraction)
        rotation[:, part] = curve.rotations(motion.rotation[known, part : part + 1])[:, 0]
        translation[:, part] = curve.points(motion.translation[known, part])
    valid = ~repeats & motion.observed
    return replace(motion, rotation=rotation, translation=translation, valid=valid), notes


def repeat_notes(motion: ObjectTrack, repeats: Bool[Tensor, "T Q"], cure: str) -> Iterator[str]:
    """Notes for the user about repeated poses, one per part; `cure` ends each of them."""
    for part, count in enumerate(repeats.sum(0).tolist()):
        if count:
            yield (
                f"the pose of {motion.name_of(part)} repeats the one before, between two leaps, in "
                f"{numbered(count, 'frame')}: {cure}"
            )


def repeated_poses(motion: ObjectTrack, camera_moves: bool = False) -> Bool[Tensor, "T Q"]:
    """Mask of the poses that exactly equal the one before, between leaps; where that is rare, only
    of those for which the next leap makes up.

    With `camera_moves` the poses are in the frame of a camera that moves, in which nothing rests:
    leaps are not needed."""
    seen = motion.observed.cpu()
    found = torch.zeros_like(seen)
    turns = METRES_PER_ROTATION * motion.rotation.flatten(2)
    steps = torch.cat([motion.translation, turns], -1).diff(dim=0)
    stays = (steps == 0).all(-1).cpu() & seen[1:] & seen[:-1]
    for part in range(found.shape[1]):
        all_stops = runs(stays[:, part].numpy())
        stops = [each for each in all_stops if camera_moves or goes_on(steps[:, part], each)]
        lengths = [stop.stop - stop.start for stop in stops]
        usual = float(np.median(lengths)) if lengths else 0.0
        enough = len(stops) >= (FEWEST_BRIEF_STOPS if usual <= BRIEF_FRAMES else FEWEST_STOPS)
        even = spread_over(steps[:, part], all_stops)
        for stop, length in zip(stops, lengths, strict=True):
            regular = enough and length <= REST_RATIO * usual
            repeats = regular or made_up(steps[:, part], even, stop)
            found[stop.start + 1 : stop.stop + 1, part] = repeats
    return found.to(motion.rotation.device)


def goes_on(steps: Float[Tensor, "N D"], stop: slice) -> bool:
    """Whether leaps before and after a stop are in the same direction, or both between two stops.

    An object that reverses its direction truly rests for a moment, but moves in frames around it.
    """
    if stop.start == 0 or stop.stop == len(steps):
        return False
    before, after = steps[stop.start - 1], steps[stop.stop]
    if min(before.norm(), after.norm()) <= LEAST_LEAP:
        return False
    beyond = torch.cat([steps[: stop.start - 1][-1:], steps[stop.stop + 1 :][:1]])
    alone = len(beyond) == 2 and not bool(beyond.any())
    return alone or bool(before @ after > 0)


def spread_over(steps: Float[Tensor, "N D"], stops: list[slice]) -> Float[Tensor, "N D"]:
    """The steps with the leap after each stop spread evenly over the stop."""
    even = steps.clone()
    for stop in stops:
        if stop.stop < len(steps):
            even[stop.start : stop.stop + 1] = steps[stop.stop] / (stop.stop - stop.start + 1)
    return even


def made_up(steps: Float[Tensor, "N D"], even: Float[Tensor, "N D"], stop: slice) -> bool:
    """Whether the leap after a stop makes up for it, as no motion does: the steps around it change
    far less if it is spread over the stop. `even` are the steps with all leaps spread."""
    if stop.start == 0 or stop.stop >= len(steps) - 1:
        return False
    given, within = even.clone(), slice(stop.start, stop.stop + 1)
    given[within] = steps[within]
    around = slice(stop.start - 1, stop.stop + 2)
    spread, rough = (each[around].diff(dim=0).square().sum() for each in (even, given))
    return bool(spread < MADE_UP * rough)
