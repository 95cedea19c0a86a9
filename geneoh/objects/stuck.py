"""Poses of an object that stay behind the palm that moves it, until they leap after it; and poses
of a hand that stay behind what it holds.

A tracker that loses an object under a hand may keep its last pose, with some jitter, or follow too
slowly, and find the object again later. In the frame of the object the hand then seems to leave it,
and the object's poses are centimetres off. That shows once the object is found again: it leaps to
where the palm would have carried it. So do hands, whose trackers lose them behind objects.
"""

from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation
from torch import Tensor

from geneoh.errors import numbered
from geneoh.geometry.rigid import Rigid
from geneoh.objects.evidence import radius
from geneoh.objects.movers import Mover, pose_distance
from geneoh.objects.palms import RigidMotion
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import runs

LEAP, LEAP_RATIO, COMPARED_STEPS = 0.04, 3.0, 5
"""Least leap of the object's surface, metres, and its least ratio to the other steps of so many
frames before and after it."""
MEETING = 0.035
"""Distance of the object's surface from where the palm would carry it, metres, up to which it was
with the palm."""
SLOW_FRAMES, NEAREST = 10, (0.002, 0.01)
"""Excess of this distance over its least, metres, up to which the object has not stayed behind:
twice its median step, within these bounds."""
NOISE_RATIO = 2.5
"""What is added to `MEETING` for a noisy hand, in standard deviations of the noise per axis."""
BEHIND = 0.6
"""Largest ratio of the motion of an object that stays behind to that of one that is carried."""
LONGEST_SECONDS = 5.0


def without_stuck_poses(
    motion: ObjectTrack, palms: Iterable[RigidMotion], fps: float
) -> tuple[ObjectTrack, tuple[str, ...]]:
    """The track in which poses that stay behind a palm are missing, filled evenly; and notes.

    The same track object if there are none. `motion` has finite poses in all frames. Palms count if
    they are seen for long enough to tell noise from motion.
    """
    calm = [Mover.of(palm, motion.rotation) for palm in palms if palm.is_long]
    known, notes = motion.observed.clone(), []
    for part in motion.seen_parts:
        center = motion.meshes[part].center().to(motion.rotation)
        turns = motion.rotation[:, part]
        path = Rigid(turns.double(), (turns @ center + motion.translation[:, part]).double())
        size, seen = radius(motion.meshes[part]), known[:, part].clone()
        for palm in calm:
            for stuck in stuck_runs(path, seen, palm, size, fps):
                known[stuck, part] = False
        count = int((seen & ~known[:, part]).sum())
        if count:
            notes.append(
                f"the pose of {motion.name_of(part)} stays behind the hand that moves it, and then "
                f"leaps after it, in {numbered(count, 'frame')}: taken as missing"
            )
    return (fill_object(motion, known), tuple(notes)) if notes else (motion, ())


def stuck_runs(
    path: Rigid, seen: Bool[Tensor, " T"], palm: Mover, size: float, fps: float
) -> Iterator[slice]:
    """The frames in which an object stays behind a palm, before it leaps to where the palm has it
    or has put it down.

    `path` has the poses of the object with its centre as origin, and `size` is its radius, metres.
    """
    for span in before_leaps(path, seen, size, fps):
        left = left_behind(path, palm, span, size)
        if left is not None:
            yield slice(left + 1, span.stop)


def behind_object(
    hand: RigidMotion, size: float, motion: ObjectTrack, fps: float
) -> Bool[Tensor, " T"]:
    """Frames in which a palm stays behind an object that it holds, before it leaps after it, as of
    a tracker that lost the hand. `size` is the radius of the hand, metres."""
    seen = torch.from_numpy(hand.seen)
    found = torch.zeros_like(seen)
    turns = torch.from_numpy(hand.turns.as_matrix())
    path = Rigid(turns, torch.from_numpy(hand.places))
    meeting = MEETING + NOISE_RATIO * hand.place_noise()
    for part in motion.seen_parts if motion.meshes else ():
        middles = motion.rotation[:, part] @ motion.meshes[part].center().to(motion.rotation)
        places = (middles + motion.translation[:, part]).double().cpu().numpy()
        turns = Rotation.from_matrix(motion.rotation[:, part].double().cpu().numpy())
        carrier = RigidMotion(turns, places, motion.observed[:, part].cpu().numpy())
        if carrier.is_long:
            mover = Mover.of(carrier, path.rotation)
            for span in before_leaps(path, seen, size, fps):
                left = left_behind(path, mover, span, size, meeting, found_there=True)
                if left is not None:
                    found[left + 1 : span.stop] = True
    return found


def before_leaps(path: Rigid, seen: Bool[Tensor, " T"], size: float, fps: float) -> Iterator[slice]:
    """The frames before each leap of a track, up to the leap before it."""
    steps = pose_distance(path.at(slice(0, -1)), path.at(slice(1, None)), size).cpu().numpy()
    longest = round(LONGEST_SECONDS * fps)
    for before, last in pairwise([-1, *leaps_among(steps, seen, fps)]):
        yield slice(max(before + 1, last - longest), last + 1)


def left_behind(
    path: Rigid,
    mover: Mover,
    span: slice,
    size: float,
    meeting: float = MEETING,
    *,
    found_there: bool = False,
) -> int | None:
    """The frame in which a mover leaves behind what leaps after it at the end of `span`; None if it
    does not. What rests after the leap may have been put down before, unless it is `found_there`.
    """
    found, after = (path.at(slice(span.stop, span.stop + n)) for n in (1, 1 + COMPARED_STEPS))
    rests = not found_there and bool((pose_distance(found, after, size) < meeting).all())
    first = span.start + 1 if rests else span.stop
    put = torch.arange(first, span.stop + 1, device=path.translation.device)
    own = mover.pose.at(put).inverse().compose(found)
    given, there = path.at(span), mover.pose.at(span)
    carried = Rigid(there.rotation[:, None], there.translation[:, None]).compose(own)
    among = Rigid(given.rotation[:, None], given.translation[:, None])
    off = pose_distance(carried, among, size).cpu().numpy()  # [in a frame, as put down in one]
    moved = pose_distance(given, given.at(slice(-1, None)), size).cpu().numpy()
    would = pose_distance(carried, found, size).cpu().numpy()
    away = mover.holds(path).translation.norm(dim=-1)[put.clamp(max=span.stop - 1)]
    near = (own.translation.norm(dim=-1) <= away + meeting).cpu().numpy()
    best: tuple[float, int] | None = None
    for at in np.flatnonzero(near)[::-1].tolist():
        left = last_together(off[: int(put[at]) - span.start, at], meeting)
        if left is None or moved[left] >= BEHIND * would[left, at]:
            continue
        if best is None or off[left, at] < best[0]:
            best = float(off[left, at]), span.start + left
        if put[at] == span.stop:  # it is with the mover
            break
    return None if best is None else best[1]


def leaps_among(steps: Float[np.ndarray, " N"], seen: Bool[Tensor, " T"], fps: float) -> list[int]:
    """The frames after which an object leaps; `steps` are its steps to the next frame, metres."""
    both, found = (seen[1:] & seen[:-1]).cpu().numpy(), []
    for step in np.flatnonzero(both & (steps > LEAP * max(1.0, 30 / fps))).tolist():
        before, after = steps[max(0, step - COMPARED_STEPS) : step], steps[step + 1 :]
        around = np.concatenate([before, after[:COMPARED_STEPS]])
        if steps[step] > LEAP_RATIO * around.max(initial=0.0):
            found.append(step)
    return found


def last_together(off: Float[np.ndarray, " N"], meeting: float) -> int | None:
    """The last frame before an object stays behind its mover, None if it does not; `off` are its
    distances from where that would carry it, metres, at most `meeting` where it is with it."""
    together = runs(off < meeting)
    if not together or together[-1].stop == len(off):
        return None
    near = off[together[-1]]
    jitter = np.median(np.abs(np.diff(near, prepend=near[0])))
    nearest = near <= near[-SLOW_FRAMES:].min() + np.clip(2 * jitter, *NEAREST)
    return together[-1].start + int(np.flatnonzero(nearest)[-1])
