"""Frames in which a tracker lost the hand and says so nowhere: they count as missing.

Trackers that lose a hand repeat their last answer, follow another hand, turn it over, or take it
for one of the other side. Networks that have learned from noise around the true hand follow such
frames, and fill in what is missing.
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
from geneoh.objects.consistency import longest_chain, possible_places
from geneoh.objects.palms import RigidMotion, palm_at
from geneoh.objects.smoothing import increments
from geneoh.objects.symmetry import Symmetry
from geneoh.pipeline.examination.stray import without_strays
from geneoh.readers.checks.hands import finger_curls, palm_length
from geneoh.sequence.gaps import filled_keypoints, observed_around
from geneoh.sequence.keypoints import PALM, palm_axes
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.shots import LASTING, shots_of
from geneoh.sequence.windows import runs

SHORTEST = 5  # observed frames below which nothing tells a fault from motion
IS_FINGER = torch.tensor([point not in PALM for point in range(21)])
PLACE_CHANGE, TURN_CHANGE = 0.1, 1.0
LARGEST_PLACE, LARGEST_TURN = 0.25, 2.0
"""From one frame to the next the step of the palm may change by 10 cm and its turn by 57 degrees at
30 frames a second, more at fewer, or by `BENDS` times the lower quartile of its changes; but by
25 cm (more at fewer) and 115 degrees at most. Noise that networks can mend stays below."""
BENDS = 4.2
SAME, LEAP = 2e-5, 0.003
"""Largest coordinate of a step, metres, in which points stand still but for rounding; and the mean
length of steps at 30 frames a second from which to such a stop nothing slows down."""
BACKWARD, CURL_JUMP = -0.2, 0.4
"""Share of the palm's length by which the fingertips of a hand of the other side are bent backward,
and by how much more than in the frames around them."""
GUESSED = 0.05  # confidence of fingers that are those of the frames around them
ALL_THE_SAME = Symmetry(np.zeros(3), np.eye(3)[None])  # of a hand: no turn maps it onto itself


def without_faults(sequence: Sequence) -> tuple[Sequence, tuple[str, ...]]:
    """The sequence whose faulty frames count as missing, and what a user should know of them."""
    found = [without_faults_of(hand, sequence.fps, sequence.object) for hand in sequence.hands]
    said = tuple(words for _, each in found for words in each)
    return replace(sequence, hands=tuple(hand for hand, _ in found)), said


def without_faults_of(
    hand: HandTrack, fps: float, motion: ObjectTrack
) -> tuple[HandTrack, tuple[str, ...]]:
    """One hand without its faults, and what a user should know of them."""
    hand, words = without_strays(hand)
    said = list(words)
    for frames, fault, of_fingers in faults(hand, fps, motion):
        if of_fingers:
            hand, cure = _with_other_fingers(hand, frames), "got those of the frames around"
        else:
            hand, cure = replace(hand, valid=hand.valid & ~frames), "taken as missing"
        where = numbered(int(frames.sum()), "frame")
        said.append(f"the {hand.side} hand {fault} in {where}: {cure}")
    return hand, tuple(said)


def _with_other_fingers(hand: HandTrack, frames: Bool[Tensor, " T"]) -> HandTrack:
    """The track whose fingers in some frames are those around them, with hardly any confidence."""
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
    hand: HandTrack, fps: float, motion: ObjectTrack
) -> Iterator[tuple[Bool[Tensor, " T"], str, bool]]:
    """The faults of a track, of which most have none: its frames, which no other has, what is wrong
    with them in words, and whether that is so of the fingers alone."""
    seen = hand.observed
    if int(seen.sum()) < SHORTEST:
        return
    joints, trusted = filled_keypoints(hand), hand.trust > 0
    parts = motion.seen_parts if motion.meshes else ()
    views, shots = tuple(motion.seen_from(q, joints) for q in parts), shots_of(hand, fps)
    track = KeypointTrack(joints, trusted, hand.side, fps, views, shots)
    for find, words, of_fingers in FAULTS:
        wrong = find(track) & seen
        # a slow tracker repeats most frames; else what is so in most of them is how the hand is
        few = find is _repeated or 2 * int(wrong.sum()) <= int(seen.sum())
        if few and bool(wrong.any()):
            yield wrong, words, of_fingers
            seen = seen & ~wrong


@dataclass(frozen=True)
class KeypointTrack:
    """Keypoints of a hand with gaps filled, metres, world frame."""

    joints: Float[Tensor, "T 21 3"]
    trusted: Bool[Tensor, "T 21"]  # whether a keypoint has confidence in a frame with the hand
    side: Side
    fps: float
    from_parts: tuple[Float[Tensor, "T 21 3"], ...]  # the same, as parts of the object see them
    shots: list[slice]  # stretches between cuts of the video, over which no motion leads

    @cached_property
    def palms(self) -> list[RigidMotion]:
        """The palm as the world sees it, and as each part of the object does."""
        return [palm_at(joints, self.trusted) for joints in (self.joints, *self.from_parts)]

    @property
    def nothing(self) -> Bool[Tensor, " T"]:
        """No frame."""
        return torch.zeros_like(self.trusted[:, 0])

    def in_all(
        self, views: Iterable[np.ndarray | Rotation], find: Callable[[Any], Bool[np.ndarray, " N"]]
    ) -> Bool[Tensor, " T"]:
        """Frames that are found in the world and as each part of the object sees the hand; `find`
        is asked for each shot of each view, frames first."""
        frames = ~self.nothing
        for view in views:
            each = np.concatenate([find(view[shot]) for shot in self.shots])
            frames = frames & torch.from_numpy(each).to(frames.device)
            if not frames.any():
                break
        return frames


def _repeated(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames that repeat the one before, in the middle of motion."""
    found = track.nothing
    for run in stops(track, track.joints):
        found[run.start + 1 : run.stop + 1] = True
    return found


def stiff(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames of one and the same hand shape, such as a mean one, in a hand that moves."""
    found, still = track.nothing, standing(track.joints)
    shape = (track.joints - track.joints[:, :1]) @ palm_axes(track.joints[:, None])
    for run in stops(track, shape):
        found[run.start : run.stop + 1] = not bool(still[run].all())
    return found


def standing(points: Float[Tensor, "T 21 3"]) -> Bool[Tensor, " N"]:
    """Whether points stand still from each frame to the next."""
    return points.diff(dim=0).abs().flatten(1).amax(1) < SAME


def stops(track: KeypointTrack, points: Float[Tensor, "T 21 3"]) -> Iterator[slice]:
    """Runs of steps between observed frames in which points stand still, and which begin and end
    with a leap."""
    seen = track.trusted.any(-1)
    steps = points.diff(dim=0).norm(dim=-1).mean(-1)
    leaps = (steps > LEAP * max(1.0, 30 / track.fps) ** 2).cpu().numpy()
    for run in runs((standing(points) & seen[1:] & seen[:-1]).cpu().numpy()):
        around = [step for step in (run.start - 1, run.stop) if 0 <= step < len(leaps)]
        if around and leaps[around].all():
            yield run


def displaced(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames in which the palm is where no possible motion brings it."""
    middles = [palm.places for palm in track.palms]
    steps = [np.diff(middle, axis=0) for middle in middles]
    limit = change_limit(steps, PLACE_CHANGE, track.fps)
    limit = min(limit, LARGEST_PLACE * max(1.0, 30 / track.fps))
    return track.in_all(middles, lambda middle: ~possible_places(middle, limit, track.fps, LASTING))


def turned_over(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames in which the palm is turned as no possible motion turns it."""
    palms = [palm.turns for palm in track.palms]
    limit = change_limit([increments(palm) for palm in palms], TURN_CHANGE, track.fps)
    limit = min(limit, LARGEST_TURN)
    return track.in_all(
        palms, lambda palm: ~longest_chain(palm, limit, ALL_THE_SAME, track.fps, LASTING).kept
    )


def change_limit(steps: Iterable[Float[np.ndarray, "N 3"]], change: float, fps: float) -> float:
    """How much a step may differ from the one before, radians or metres, where `steps` are those of
    one motion as several see it."""
    # a track that flickers between two hands leaps in more than half of its frames
    changes = [np.linalg.norm(np.diff(step, axis=0), axis=1) for step in steps]
    usual = min(float(np.quantile(change, 0.25)) for change in changes)
    return max(change * max(1.0, 30 / fps), BENDS * usual)


def curls(
    joints: Float[Tensor, "T 21 3"], trusted: Bool[Tensor, "T 21"], side: Side
) -> Float[Tensor, " T"]:
    """By how much the fingers bend forward, in lengths of the palm; NaN where nothing is known."""
    known = joints.masked_fill(~trusted[..., None], torch.nan)
    return finger_curls(known, side) / palm_length(known)


def other_side(track: KeypointTrack) -> Bool[Tensor, " T"]:
    """Frames whose fingers bend backward, while those around them bend forward."""
    curl = curls(track.joints, track.trusted, track.side).cpu().numpy()
    found = track.nothing
    for run in runs(curl < BACKWARD):
        around = [frame for frame in (run.start - 1, run.stop) if 0 <= frame < len(curl)]
        if around and curl[around].min() > curl[run].mean() + CURL_JUMP:
            found[run] = True
    return found


FAULTS = (
    (_repeated, "repeats the frame before, between two leaps,", False),
    (stiff, "has fingers that keep still, between two leaps,", True),
    (displaced, "is where no motion brings it", False),
    (turned_over, "is turned as no motion turns it", False),
    (other_side, "is bent backward, as one of the other side,", False),
)
"""What finds the frames of each fault, its words, and whether it is of the fingers alone."""
