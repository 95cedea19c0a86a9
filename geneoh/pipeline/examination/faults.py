"""Detect frames in which a tracker lost the hand without marking them, and make them missing.

Trackers that lose a hand repeat their last output, follow another hand, flip it, or confuse its
side. Networks trained with noise around the true hand would follow such frames, but can fill
missing ones.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation
from torch import Tensor

from geneoh.choices import Side
from geneoh.errors import numbered
from geneoh.objects.consistency import (
    longest_chain,
    possible_places,
    there_and_back,
    turned_there_and_back,
)
from geneoh.objects.palms import RigidMotion, palm_at
from geneoh.objects.smoothing import increments
from geneoh.objects.stuck import behind_object
from geneoh.objects.symmetry import Symmetry
from geneoh.pipeline.examination.stray import without_strays
from geneoh.readers.checks.hands import finger_curls, palm_length
from geneoh.sequence.gaps import filled_keypoints, observed_around
from geneoh.sequence.keypoints import PALM, palm_axes
from geneoh.sequence.lines import on_lines
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.shots import SHOT_SECONDS, paths_of, shots_of
from geneoh.sequence.windows import runs

FEWEST_OBSERVED = 5  # observed frames that are needed to distinguish faults from motion
IS_FINGER = torch.tensor([point not in PALM for point in range(21)])
PLACE_CHANGE, TURN_CHANGE = 0.1, 1.0
LARGEST_PLACE, LARGEST_TURN = 0.25, 2.0
"""Limits of the change of the palm's displacement (metres) and rotation (radians) between two
consecutive steps: 10 cm and 57 degrees at 30 frames a second, more at lower frame rates, or `BENDS`
times the lower quartile of all changes; but at most 25 cm (more at lower frame rates) and 115
degrees. Noise that the networks can remove stays below."""
BENDS = 4.2
SAME, LEAP = 2e-5, 0.003
"""A point is at rest if no coordinate moves farther than `SAME`, metres, which allows for rounding.
No hand stops abruptly after a step longer than `LEAP`, metres at 30 frames a second."""
AWAY_LEAP = 0.08
"""Least step of a palm that leaves for a while and comes back, metres at 30 frames a second."""
AWAY_TURN = 1.5
"""Least turn of a palm in one frame that turns over for a while and back, radians; more at lower
frame rates, up to `LARGEST_TURN`."""
BACKWARD, CURL_JUMP = -0.2, 0.4
"""Curl of the fingers, in palm lengths, below which they bend backward like a hand of the other
side, and its least difference to the neighbouring frames."""
HAND_SIZE = 0.07  # radius of a hand, metres
GUESSED = 0.05  # factor on the confidence of fingers that are interpolated
ALL_THE_SAME = Symmetry(np.zeros(3), np.eye(3)[None])  # the trivial symmetry group, for a palm


def without_faults(sequence: Sequence) -> tuple[Sequence, tuple[str, ...]]:
    """The sequence with faulty frames marked as missing, and sentences for the user."""
    found = []
    for hand in sequence.hands:
        others = tuple(other for other in sequence.hands if other is not hand)
        found.append(without_faults_of(hand, sequence.fps, sequence.object, others))
    notes = tuple(words for _, each in found for words in each)
    return replace(sequence, hands=tuple(hand for hand, _ in found)), notes


def without_faults_of(
    hand: HandTrack, fps: float, motion: ObjectTrack, others: tuple[HandTrack, ...] = ()
) -> tuple[HandTrack, tuple[str, ...]]:
    """One hand with its faulty frames marked as missing, and sentences for the user.

    The `others` are hands beside it.
    """
    hand, words = without_strays(hand)
    notes = list(words)
    for frames, fault, of_fingers in faults(hand, fps, motion, others):
        if of_fingers:
            hand, cure = _with_other_fingers(hand, frames), "got those of the frames around"
        else:
            hand, cure = replace(hand, valid=hand.valid & ~frames), "taken as missing"
        where = numbered(int(frames.sum()), "frame")
        notes.append(f"the {hand.side} hand {fault} in {where}: {cure}")
    return hand, tuple(notes)


def _with_other_fingers(hand: HandTrack, frames: Bool[Tensor, " T"]) -> HandTrack:
    """The track with fingers interpolated in some frames, with hardly any confidence."""
    around, chosen = observed_around(hand.observed & ~frames), frames[:, None, None]
    pose, joints, trust = hand.pose, hand.joints, hand.trust
    is_finger = IS_FINGER.to(frames.device)
    if pose is not None:
        turned = torch.cat([pose[:, :1], around.pose(pose)[:, 1:]], dim=1)
        pose = torch.where(chosen, turned, pose)
    if joints is not None:
        axes, wrist = palm_axes(joints[:, None]), joints[:, :1]
        inside = around.points((joints - wrist) @ axes)
        joints = torch.where(chosen & is_finger[:, None], wrist + inside @ axes.mT, joints)
    trust = torch.where(frames[:, None] & is_finger, GUESSED * trust, trust)
    return replace(hand, pose=pose, joints=joints, confidence=trust)


def faults(
    hand: HandTrack, fps: float, motion: ObjectTrack, others: tuple[HandTrack, ...] = ()
) -> Iterator[tuple[Bool[Tensor, " T"], str, bool]]:
    """Faults of a track: the mask of its frames (disjoint between faults), a description, and
    whether it concerns the fingers alone."""
    seen = hand.observed
    if int(seen.sum()) < FEWEST_OBSERVED:
        return
    track = keypoint_track(hand, fps, motion)
    elsewhere = away(track) & seen
    flipped = turned_away(track) & seen & ~elsewhere
    behind = behind_object(track.palms[0], HAND_SIZE, motion, fps).to(seen.device)
    behind = behind & seen & ~elsewhere & ~flipped
    if bool(behind.any()):
        yield behind, "stays behind the object that it holds, and then leaps after it,", False
    gone = elsewhere | flipped | behind
    if bool(gone.any()):  # the others are sought in the track without these
        hand, seen = replace(hand, valid=hand.valid & ~gone), seen & ~gone
        track = keypoint_track(hand, fps, motion)
    track = replace(track, shots=shots_of(hand, fps, paths_of(others, motion)))
    for find, words, of_fingers in FAULTS:
        wrong = find(track) & seen
        # only repeated frames may be the majority (slow trackers): else they are how the hand is
        few = find is _repeated or 2 * int(wrong.sum()) <= int(seen.sum())
        wrong = wrong if few else track.nothing
        seen = seen & ~wrong
        if find is displaced:
            wrong = wrong | elsewhere
        if find is turned_over:
            wrong = wrong | flipped
        if bool(wrong.any()):
            yield wrong, words, of_fingers


@dataclass(frozen=True)
class KeypointTrack:
    """Keypoints of a hand with gaps filled, metres, world frame."""

    joints: Float[Tensor, "T 21 3"]
    trusted: Bool[Tensor, "T 21"]  # whether a keypoint has confidence in a frame with the hand
    side: Side
    fps: float
    from_parts: tuple[Float[Tensor, "T 21 3"], ...]  # keypoints in the frame of each object part
    shots: list[slice]  # frames between cuts of the video, across which motion is not compared

    @cached_property
    def palms(self) -> list[RigidMotion]:
        """Rigid motion of the palm in the world frame and in the frame of each object part."""
        return [palm_at(joints, self.trusted) for joints in (self.joints, *self.from_parts)]

    @property
    def nothing(self) -> Bool[Tensor, " T"]:
        """An empty mask of frames."""
        return torch.zeros_like(self.trusted[:, 0])

    def in_all(
        self, views: Iterable[np.ndarray | Rotation], find: Callable[[Any], Bool[np.ndarray, " N"]]
    ) -> Bool[Tensor, " T"]:
        """Frames that `find` detects in every view, in the world and in each part's frame; it is
        called for each shot of each view, with frames on the first axis."""
        frames = ~self.nothing
        for view in views:
            each = np.concatenate([find(view[shot]) for shot in self.shots])
            frames = frames & torch.from_numpy(each).to(frames.device)
            if not frames.any():
                break
        return frames


def keypoint_track(hand: HandTrack, fps: float, motion: ObjectTrack) -> KeypointTrack:
    """The keypoints of a hand as one shot, in the world and seen from each part of the object."""
    joints, parts = filled_keypoints(hand), motion.seen_parts if motion.meshes else ()
    views = tuple(motion.seen_from(part, joints) for part in parts)
    return KeypointTrack(joints, hand.trust > 0, hand.side, fps, views, [slice(0, hand.frames)])


def _repeated(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames that repeat the frame before, while the hand moves before and after."""
    found = track.nothing
    for run in stops(track, track.joints):
        found[run.start + 1 : run.stop + 1] = True
    return found


def interpolated(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames in which the wrist is on a line between others, as where lost frames were filled."""
    return on_lines(track.joints[:, 0], track.trusted[:, 0])


def stiff(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames with a constant finger pose, such as a mean pose, while the hand moves."""
    found, still = track.nothing, standing(track.joints)
    shape = (track.joints - track.joints[:, :1]) @ palm_axes(track.joints[:, None])
    for run in stops(track, shape):
        found[run.start : run.stop + 1] = not bool(still[run].all())
    return found


def standing(points: Float[Tensor, "T 21 3"]) -> Bool[Tensor, " N"]:
    """Whether all points are at rest between each frame and the next."""
    return points.diff(dim=0).abs().flatten(1).amax(1) < SAME


def stops(track: KeypointTrack, points: Float[Tensor, "T 21 3"]) -> Iterator[slice]:
    """Runs of steps between observed frames in which all points are at rest, with steps longer than
    `LEAP` before and after."""
    seen = track.trusted.any(-1)
    steps = points.diff(dim=0).norm(dim=-1).mean(-1)
    leaps = (steps > LEAP * max(1.0, 30 / track.fps) ** 2).cpu().numpy()
    for run in runs((standing(points) & seen[1:] & seen[:-1]).cpu().numpy()):
        around = [step for step in (run.start - 1, run.stop) if 0 <= step < len(leaps)]
        if around and leaps[around].all():
            yield run


def displaced(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames with a palm position that no possible motion reaches; see `possible_places`."""
    middles = [palm.places for palm in track.palms]
    steps = [np.diff(middle, axis=0) for middle in middles]
    limit = change_limit(steps, PLACE_CHANGE, track.fps)
    limit = min(limit, LARGEST_PLACE * max(1.0, 30 / track.fps))
    return track.in_all(
        middles, lambda middle: ~possible_places(middle, limit, track.fps, SHOT_SECONDS)
    )


def away(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames between a leap of the palm and the leap back at most `SHOT_SECONDS` later, as of a
    tracker that follows another person's hand in between.

    A leap that is possible within a few frames is no fault for `possible_places`: these leaps are
    told by the calm before, between and after them.
    """
    middles = [palm.places for palm in track.palms]
    return track.in_all(
        middles, lambda middle: there_and_back(middle, AWAY_LEAP, track.fps, SHOT_SECONDS)
    )


def turned_over(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames with a palm orientation that no possible motion reaches; see `longest_chain`."""
    palms = [palm.turns for palm in track.palms]
    limit = change_limit([increments(palm) for palm in palms], TURN_CHANGE, track.fps)
    limit = min(limit, LARGEST_TURN)
    return track.in_all(
        palms, lambda palm: ~longest_chain(palm, limit, ALL_THE_SAME, track.fps, SHOT_SECONDS).kept
    )


def turned_away(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames between a sudden turn of the palm and the turn back at most `SHOT_SECONDS` later, as
    of an estimator that takes the back of the hand for the palm in between.

    The longer they last, the more easily `longest_chain` takes them for motion, and leaves out
    frames beside them, in which the hand could turn over.
    """
    least = min(AWAY_TURN * max(1.0, 30 / track.fps), LARGEST_TURN)
    palms = [palm.turns for palm in track.palms]
    return track.in_all(
        palms, lambda palm: turned_there_and_back(palm, least, track.fps, SHOT_SECONDS)
    )


def change_limit(steps: Iterable[Float[np.ndarray, "N 3"]], change: float, fps: float) -> float:
    """Limit of the change between consecutive steps, radians or metres; `steps` are those of one
    motion in several frames of reference."""
    # not the median: a track that flickers between two hands jumps in more than half of its frames
    changes = [np.linalg.norm(np.diff(step, axis=0), axis=1) for step in steps]
    usual = min(float(np.quantile(change, 0.25)) for change in changes)
    return max(change * max(1.0, 30 / fps), BENDS * usual)


def curls(
    joints: Float[Tensor, "T 21 3"], trusted: Bool[Tensor, "T 21"], side: Side
) -> Float[Tensor, " T"]:
    """Forward curl of the fingers in palm lengths; NaN where keypoints are not trusted."""
    known = joints.masked_fill(~trusted[..., None], torch.nan)
    return finger_curls(known, side) / palm_length(known)


def other_side(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames in which the fingers bend backward, unlike in the neighbouring frames."""
    curl = curls(track.joints, track.trusted, track.side).cpu().numpy()
    found = track.nothing
    for run in runs(curl < BACKWARD):
        around = [frame for frame in (run.start - 1, run.stop) if 0 <= frame < len(curl)]
        if around and curl[around].min() > curl[run].mean() + CURL_JUMP:
            found[run] = True
    return found


FAULTS = (
    (_repeated, "repeats the frame before, between two leaps,", False),
    (interpolated, "moves on straight lines at an exactly even speed", False),
    (stiff, "has fingers that keep still, between two leaps,", True),
    (displaced, "leaps farther than a hand can move", False),
    (turned_over, "turns faster than a hand can turn", False),
    (other_side, "is bent backward, as one of the other side,", False),
)
"""Detector of each fault, its description, and whether it concerns the fingers alone."""
