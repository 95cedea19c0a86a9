"""Does a file follow its source's convention? Compares redundant data of the file.

A check compares the sequence as it was read with stored keypoints or vertices, with the anatomy of
hands, or with another interpretation of the same numbers. It yields a sentence per contradiction.
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
"""Largest distance in metres from the wrist to the centre of rotation of a stored mesh; J0 is 96 mm
long."""
POSE_LIMIT = 0.015
"""Largest mean distance in metres of stored keypoints from the pose on the best-fit skeleton."""
POINT_LIMIT = 0.005
"""Largest mean distance in metres of a stored object from its mesh moved by its pose."""
J0_SHARE = 0.3
"""Relative difference in the length of J0 between hands."""
LARGEST_CONDITION = 100.0
"""Largest condition number of the fit of the centre of rotation, which needs a hand that turns."""


def contradictions(recording: Recording) -> list[str]:
    """Contradictions of a recording with the convention that it was read by; empty if none."""
    sequence, stored = recording.sequence, recording.cross_checks
    found = list(stored.contradictions)
    try:
        check_sequence(sequence, recording.name)
    except InputError as error:
        words = str(error).removeprefix(f"{recording.name}: ")
        found.append(f"units and frames: {words}")
    found += [f"units: {words}" for words in map(size_warning, sequence.object.meshes) if words]
    for hand in sequence.hands:
        sentences = (
            *check_wrist_position(hand, stored),
            *check_turning_point(hand, stored),
            *check_anatomy(hand),
            *check_pose_against_keypoints(hand, stored),
            *check_wrist_place(hand, sequence.object),
            *check_holding(hand, sequence.object),
        )
        found += [f"{hand.side} hand: {words}" for words in sentences]
    return [*found, *check_object_placement(stored)]


def doubts(sequence: Sequence, name: str) -> Iterator[str]:
    """Warnings on a sequence before it is cleaned, each with the option that corrects the input.

    `InputError` if the keypoints are certainly in another order; `name` is the file's name.
    """
    about = {hand.side: list(doubts_of(hand, sequence, name)) for hand in sequence.hands}
    exchanged = len(about) == 2 and all(
        any(words.startswith(HANDEDNESS) for words in warnings) for warnings in about.values()
    )
    if exchanged:
        yield (
            f"{HANDEDNESS} thumbs and fingers of both hands curl away from their palms; the left "
            "hand is called right and the right one left: exchange the two names; "
            f"or they are {MIRRORED}"
        )
    for side, warnings in about.items():
        for words in warnings:
            if not (exchanged and words.startswith(HANDEDNESS)):
                yield f"{side} hand: {words}"


def doubts_of(hand: HandTrack, sequence: Sequence, name: str) -> Iterator[str]:
    """Warnings on one hand of a sequence; see `doubts`."""
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
    """(T, 21, 3) stored keypoints of a hand, and the (T,) mask of frames with both of them."""
    joints = stored.joints.get(hand.side)
    if joints is None or hand.wrist is None:
        return None
    valid = hand.valid.numpy() & finite_frames(joints)
    return (joints, valid) if valid.any() else None


def check_wrist_position(hand: HandTrack, stored: CrossChecks) -> Iterator[str]:
    """Whether the wrist agrees with that of the stored keypoints."""
    found = stored_keypoints(hand, stored)
    if found is not None and hand.wrist is not None:
        joints, valid = found
        offset = hand.wrist.double().numpy()[valid] - joints[valid, 0]
        if np.median(np.linalg.norm(offset, axis=1)) > stored.tolerance:
            yield wrist_contradiction(offset.mean(0), "the stored keypoints")


def wrist_contradiction(offset: Array, against: str) -> str:
    """The sentence on a constant offset of the wrist, with its probable reason."""
    j0, length = np.linalg.norm(MEAN_WRIST_OFFSET), np.linalg.norm(offset)
    reason = "it is off"
    if abs(length - j0) < J0_SHARE * j0:
        reason = (
            "that is the distance from MANO's origin to its wrist: the translation moves the "
            "wrist where the origin is expected, or the other way round"
        )
    return f"wrist: {1000 * length:.0f} mm from {against}; {reason}"


def check_turning_point(hand: HandTrack, stored: CrossChecks) -> Iterator[str]:
    """Whether the stored mesh rotates about the wrist: b is 0 in the fit rim - wrist = R a + b."""
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
    offsets = (rim - hand.wrist.double().numpy())[usable].reshape(-1)
    shift = np.linalg.lstsq(system, offsets, rcond=None)[0][3:]
    if np.linalg.norm(shift) > WRIST_LIMIT:
        yield wrist_contradiction(shift, "where the stored mesh turns about")


def check_pose_against_keypoints(hand: HandTrack, stored: CrossChecks) -> Iterator[str]:
    """Whether the pose, on the best-fitting constant skeleton, gives the stored keypoints."""
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
    """Whether the mesh, moved by its pose, coincides with the source's stored object."""
    if stored.object_points is None:
        return
    points, own = stored.object_points
    both = np.isfinite(points).all((1, 2)) & np.isfinite(own).all((1, 2))
    if not both.any():
        return
    distance = float(np.linalg.norm(points[both] - own[both], axis=-1).mean())
    if distance > POINT_LIMIT:
        yield (
            f"placement: the mesh moved by its pose is {1000 * distance:.0f} mm from the stored "
            "object; its rotation, units or centre are others"
        )
