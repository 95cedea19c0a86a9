"""Does a file follow its source's convention? Compares what the file states more than once.

Every check compares the sequence as it was read with stored keypoints or vertices, with what hands
can do, or with another reading of the same numbers. A check yields a sentence for each
contradiction.
"""

from collections.abc import Iterator

import numpy as np
import torch

from geneoh.errors import InputError
from geneoh.geometry.mesh import size_warning
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics, rest_offsets
from geneoh.readers.base import CrossChecks, Recording, finite_frames
from geneoh.readers.checks.delay import check_delay
from geneoh.readers.checks.hands import HANDEDNESS, MIRRORED, check_anatomy, refuse_other_order
from geneoh.readers.checks.holding import TOUCHING_REACH, check_holding, check_wrist_place
from geneoh.readers.mano import MEAN_WRIST_OFFSET
from geneoh.readers.records import Array
from geneoh.sequence.distance_check import distance_to_object
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.sequence.validation import check_sequence

WRIST_LIMIT = 0.005
"""Metres that the turning point of a stored mesh may be off; J0 is 96 mm long."""
POSE_LIMIT = 0.015
"""Mean metres between stored keypoints and those of the pose with the best constant skeleton."""
POINT_LIMIT = 0.005
"""Metres between a stored object and its mesh moved by its pose."""
J0_SHARE = 0.3
"""Share by which the length of J0 differs from hand to hand."""
LARGEST_CONDITION = 100.0
"""Of the system that tells the turning point of a mesh: a hand that hardly turns shows none."""


def contradictions(recording: Recording) -> list[str]:
    """What contradicts the convention that a recording was read by; nothing when all agrees."""
    sequence, stored = recording.sequence, recording.cross_checks
    found = list(stored.contradictions)
    try:
        check_sequence(sequence, recording.name)
    except InputError as error:
        found.append(f"units and frames: {error}")
    found += [f"units: {words}" for words in map(size_warning, sequence.object.meshes) if words]
    for hand in sequence.hands:
        told = (
            *check_wrist_position(hand, stored),
            *check_turning_point(hand, stored),
            *check_anatomy(hand),
            *check_pose_against_keypoints(hand, stored),
            *check_wrist_place(hand, sequence.object),
            *check_holding(hand, sequence.object),
        )
        found += [f"{hand.side} hand: {words}" for words in told]
    return [*found, *check_object_placement(stored)]


def doubts(sequence: Sequence, name: str) -> Iterator[str]:
    """What is doubtful about a sequence before it is cleaned, each with the option that cures it.

    `InputError` where the keypoints are certainly in another order; `name` is that of the file.
    """
    about = {hand.side: list(doubts_of(hand, sequence, name)) for hand in sequence.hands}
    exchanged = len(about) == 2 and all(
        any(words.startswith(HANDEDNESS) for words in told) for told in about.values()
    )
    if exchanged:
        yield (
            f"{HANDEDNESS} thumbs and fingers of both hands curl away from their palms; the left "
            "hand is called right and the right one left: exchange the two names; "
            f"or they are {MIRRORED}"
        )
    for side, told in about.items():
        for words in told:
            if not (exchanged and words.startswith(HANDEDNESS)):
                yield f"{side} hand: {words}"


def doubts_of(hand: HandTrack, sequence: Sequence, name: str) -> Iterator[str]:
    """What is doubtful about one hand of a sequence; see `doubts`."""
    refuse_other_order(hand, name)
    away = float(distance_to_object(hand, sequence.object)[hand.valid].min())
    if away > TOUCHING_REACH:
        yield (
            f"its wrist stays {away:.2f} m from the object, too far to touch it; check the "
            "object's poses (--object-pose) and the units (--unit)"
        )
    yield from check_wrist_place(hand, sequence.object)
    yield from check_anatomy(hand)
    yield from check_holding(hand, sequence.object)
    yield from check_delay(hand, sequence.object, sequence.fps)


def stored_keypoints(hand: HandTrack, stored: CrossChecks) -> tuple[Array, Array] | None:
    """(T, 21, 3) stored keypoints of a hand, and (T,) the frames that have them and the hand."""
    joints = stored.joints.get(hand.side)
    if joints is None or hand.wrist is None:
        return None
    valid = hand.valid.numpy() & finite_frames(joints)
    return (joints, valid) if valid.any() else None


def check_wrist_position(hand: HandTrack, stored: CrossChecks) -> Iterator[str]:
    """Whether the wrist is that of the stored keypoints."""
    found = stored_keypoints(hand, stored)
    if found is not None and hand.wrist is not None:
        joints, valid = found
        off = hand.wrist.double().numpy()[valid] - joints[valid, 0]
        if np.median(np.linalg.norm(off, axis=1)) > stored.tolerance:
            yield wrist_contradiction(off.mean(0), "the stored keypoints")


def wrist_contradiction(off: Array, against: str) -> str:
    """What a constant offset of the wrist means."""
    j0, length = np.linalg.norm(MEAN_WRIST_OFFSET), np.linalg.norm(off)
    reason = "it is off"
    if abs(length - j0) < J0_SHARE * j0:
        reason = (
            "that is the distance from MANO's origin to its wrist: the translation moves the "
            "wrist where the origin is expected, or the other way round"
        )
    return f"wrist: {1000 * length:.0f} mm from {against}; {reason}"


def check_turning_point(hand: HandTrack, stored: CrossChecks) -> Iterator[str]:
    """Whether the stored mesh turns about the wrist: b is zero in the fit rim - wrist = R a + b."""
    rim, usable = stored.rim.get(hand.side), hand.valid.numpy()
    if rim is None or hand.pose is None or hand.wrist is None:
        return
    joints = stored.joints.get(hand.side)
    usable = usable & finite_frames(rim)
    usable = usable if joints is None else usable & finite_frames(joints)
    turn = axis_angle_to_matrix(hand.pose[torch.from_numpy(usable), 0].double()).numpy()
    system = np.concatenate([turn, np.broadcast_to(np.eye(3), turn.shape)], axis=2).reshape(-1, 6)
    if len(turn) < 3 or np.linalg.cond(system) > LARGEST_CONDITION:
        return
    off = (rim - hand.wrist.double().numpy())[usable].reshape(-1)
    shift = np.linalg.lstsq(system, off, rcond=None)[0][3:]
    if np.linalg.norm(shift) > WRIST_LIMIT:
        yield wrist_contradiction(shift, "where the stored mesh turns about")


def check_pose_against_keypoints(hand: HandTrack, stored: CrossChecks) -> Iterator[str]:
    """Whether the pose, with the best constant skeleton, gives the stored keypoints."""
    found = stored_keypoints(hand, stored)
    if found is None or hand.pose is None:
        return
    joints, valid = found
    turn = axis_angle_to_matrix(hand.pose[torch.from_numpy(valid)].double())
    wanted = torch.from_numpy(joints[valid])
    offsets = rest_offsets(turn, wanted, wanted.new_ones(len(turn), 21)).expand(len(turn), 20, 3)
    made = forward_kinematics(turn, wanted[:, 0], offsets)[0]
    misfit = float((made - wanted).norm(dim=-1).mean())
    if misfit > max(POSE_LIMIT, stored.tolerance):
        yield (
            f"pose: it misses the stored keypoints by {1000 * misfit:.0f} mm; the mean pose, "
            "the side or the order of the joints is another one"
        )


def check_object_placement(stored: CrossChecks) -> Iterator[str]:
    """Whether the mesh, moved by its pose, is where the source has the object."""
    if stored.object_points is None:
        return
    points, own = stored.object_points
    both = np.isfinite(points).all((1, 2)) & np.isfinite(own).all((1, 2))
    if not both.any():
        return
    off = float(np.linalg.norm(points[both] - own[both], axis=-1).mean())
    if off > POINT_LIMIT:
        yield (
            f"placement: the mesh moved by its pose is {1000 * off:.0f} mm from the stored "
            "object; its rotation, units or centre are others"
        )
