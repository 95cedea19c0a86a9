"""Does a file keep its source's convention? Told in words, from what the file itself says twice.

Every test compares the sequence as it was read with stored keypoints or vertices, with what hands
can do, or with another reading of the same numbers: a hand that holds an object moves with it, and
a reading under which it moves along much better than under the source's own is a contradiction.
"""

from collections.abc import Iterator

import numpy as np
import torch

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import size_warning
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics, rest_offsets
from geneoh.readers.base import Recording, finite_frames
from geneoh.readers.npz_hands import MEAN_WRIST_OFFSET
from geneoh.readers.records import Array
from geneoh.sequence.sequence import HandTrack, ObjectTrack
from geneoh.sequence.validation import check_sequence

WRIST_LIMIT = 0.005
"""Metres that the turning point of a stored mesh may stand off; J0 is 96 mm long."""
POSE_LIMIT = 0.015
"""Mean metres between stored keypoints and those of the pose with the best constant skeleton."""
POINT_LIMIT = 0.005
"""Metres between a stored object and its mesh moved by its pose."""
MIDDLE_JOINTS = (2, 5, 8, 11)
"""Second joints of the four fingers, which bend one way only."""
BACKWARD_LIMIT = 0.05
"""Mean radians that they may bend backward; recordings bend forward by 0.2 and more."""
KNUCKLES, FINGERTIPS = [5, 9, 13, 17], [8, 12, 16, 20]
"""Keypoints of the four fingers."""
LINKS = tuple((start, start + 1) for base in KNUCKLES for start in range(base, base + 3))
LONGEST_LINK = 0.8
"""Share of the palm's length that no bone of a finger reaches; the longest measured is 0.6."""
CURL_LIMIT = 0.1
"""Share of the palm's length that fingers may bend backward at their tips."""
ALONG_STEPS, ALONG_GAIN, ALONG_SHARE = 5, 0.002, 0.4
"""Moving frames that are needed; metres a frame and share by which another reading is better."""
ALONG_SPEED = 0.002
"""Metres a frame from which on a hand moves: one that rests tells nothing about a moving object."""
ALONG_REACH = 0.25
"""Metres from the wrist to the object's ball within which a reading has the hand hold it."""


def contradictions(recording: Recording) -> list[str]:
    """What speaks against the convention that a recording was read by; nothing when all agrees."""
    found = list(recording.evidence.said)
    sequence = recording.sequence
    try:
        check_sequence(sequence, recording.name)
    except InputError as error:
        found.append(f"units and frames: {error}")
    for mesh in sequence.object.meshes:
        if warning := size_warning(mesh):
            found.append(f"units: {warning}")
    for hand in sequence.hands:
        found += [f"{hand.side} hand: {words}" for words in of_hand(hand, recording)]
        if sequence.object.meshes:
            found += [f"{hand.side} hand: {words}" for words in of_holding(hand, sequence.object)]
    found += of_object(recording)
    return found


def of_hand(hand: HandTrack, recording: Recording) -> Iterator[str]:
    """Wrist, pose and side of one hand."""
    joints, rim = recording.evidence.joints.get(hand.side), recording.evidence.rim.get(hand.side)
    wrist = None if hand.wrist is None else hand.wrist.double().numpy()
    valid = hand.valid.numpy()
    if joints is not None and wrist is not None:
        valid = valid & finite_frames(joints)
        off = wrist[valid] - joints[valid, 0]
        if len(off) and np.median(np.linalg.norm(off, axis=1)) > recording.evidence.tolerance:
            yield wrist_words(off.mean(0), "the stored keypoints")
    if rim is not None and hand.pose is not None and wrist is not None:
        yield from of_rim(hand.pose[torch.from_numpy(valid), 0], wrist[valid], rim[valid])
    if hand.joints is not None:
        yield from of_joints(hand.joints[hand.valid], hand.side)
    if hand.pose is None:
        return
    bend = float(hand.pose[hand.valid][:, MIDDLE_JOINTS, 2].mean())
    bend = bend if hand.side == "right" else -bend
    if bend < -BACKWARD_LIMIT:
        other = "left" if hand.side == "right" else "right"
        yield (
            f"handedness: the fingers bend backward by {-bend:.2f} rad on average; these are the "
            f"numbers of a {other} hand, or a mean pose is missing"
        )
    if joints is not None and valid.any():
        stored = torch.from_numpy(joints[valid])
        misfit = pose_misfit(hand.pose[torch.from_numpy(valid)].double(), stored)
        if misfit > max(POSE_LIMIT, recording.evidence.tolerance):
            yield (
                f"pose: it misses the stored keypoints by {1000 * misfit:.0f} mm; the mean pose, "
                "the side or the order of the joints is another one"
            )


def of_joints(joints: torch.Tensor, side: Side) -> Iterator[str]:
    """Side and order of keypoints: fingers curl towards the palm, and their bones are short."""
    span = float((joints[:, KNUCKLES] - joints[:, :1]).norm(dim=-1).median())
    bones = torch.stack(
        [(joints[:, tips] - joints[:, bases]).norm(dim=-1) for bases, tips in LINKS]
    )
    longest = float(bones.median(1).values.max())
    if longest > LONGEST_LINK * span:
        yield (
            f"order: a finger's bone is {1000 * longest:.0f} mm long beside a palm of "
            f"{1000 * span:.0f} mm; the keypoints are in another order"
        )
        return
    palm = torch.linalg.cross(joints[:, 5] - joints[:, 0], joints[:, 17] - joints[:, 0])
    palm = torch.nn.functional.normalize(palm, dim=-1) * (1 if side == "right" else -1)
    curl = ((joints[:, FINGERTIPS] - joints[:, KNUCKLES]) * palm[:, None]).sum(-1)
    if float(curl.mean()) < -CURL_LIMIT * span:
        yield "handedness: the fingers curl away from the palm; these are points of the other hand"


def wrist_words(off: Array, against: str) -> str:
    """What a constant offset of the wrist means."""
    j0 = np.linalg.norm(MEAN_WRIST_OFFSET)
    length = np.linalg.norm(off)
    reason = "it is off"
    if 0.7 * j0 < length < 1.3 * j0:
        reason = (
            "that is the distance from MANO's origin to its wrist: the translation moves the "
            "wrist where the origin is expected, or the other way round"
        )
    return f"wrist: {1000 * length:.0f} mm from {against}; {reason}"


def of_rim(orient: torch.Tensor, wrist: Array, rim: Array) -> Iterator[str]:
    """Fit rim - wrist = R a + b: with the wrist in its place, b is zero."""
    turn = axis_angle_to_matrix(orient.double()).numpy()
    eye = np.broadcast_to(np.eye(3), turn.shape)
    system = np.concatenate([turn, eye], axis=2).reshape(-1, 6)
    if len(turn) < 3 or np.linalg.cond(system) > 100:
        return
    answer = np.linalg.lstsq(system, (rim - wrist).reshape(-1), rcond=None)[0]
    if np.linalg.norm(answer[3:]) > WRIST_LIMIT:
        yield wrist_words(answer[3:], "where the stored mesh turns about")


def pose_misfit(pose: torch.Tensor, joints: torch.Tensor) -> float:
    """Mean metres between keypoints and those of the pose with the best constant skeleton."""
    turn = axis_angle_to_matrix(pose)
    valid = torch.ones(len(pose), dtype=torch.bool)
    offsets = rest_offsets(turn, joints, valid).expand(len(pose), 20, 3)
    made = forward_kinematics(turn, joints[:, 0], offsets)[0]
    return float((made - joints).norm(dim=-1).mean())


def of_holding(hand: HandTrack, motion: ObjectTrack) -> Iterator[str]:
    """Whether the hand rides along with the object better under another reading."""
    point = hand.wrist if hand.wrist is not None else hand.joints[:, 0]  # type: ignore[index]
    wrist = point.double().numpy()
    turn = motion.rotation[:, 0].double().numpy()
    shift = motion.translation[:, 0].double().numpy()
    steps = moving_steps(hand.valid.numpy(), wrist, turn, shift)
    if len(steps) < ALONG_STEPS:
        return
    back = turn.transpose(0, 2, 1)
    read = slip(wrist, turn, shift, steps)
    j0 = np.array(MEAN_WRIST_OFFSET) * ([1, 1, 1] if hand.side == "right" else [-1, 1, 1])
    gl = np.array([1.0, -1.0, -1.0])
    readings: dict[str, tuple[Array, Array, Array]] = {
        "the object's rotation transposed": (wrist, back, shift),
        "the translation as that of the origin": (wrist + j0, turn, shift),
        "the translation as that of the wrist": (wrist - j0, turn, shift),
        "the hand in OpenGL axes": (wrist * gl, turn, shift),
        "the object's translation in millimetres": (wrist, turn, shift / 1000),
        "the object's translation in metres": (wrist, turn, shift * 1000),
    }
    ball = motion.meshes[0].verts.double().numpy()
    others = {
        words: slip(point, way, place, steps)
        for words, (point, way, place) in readings.items()
        if reach(point, way, place, steps, ball) < ALONG_REACH
    }
    best = min(others, key=lambda words: others[words], default="")
    if best and others[best] < ALONG_SHARE * read and read - others[best] > ALONG_GAIN:
        yield (
            f"placement: it slides {1000 * read:.1f} mm a frame over the moving object as read, "
            f"and {1000 * others[best]:.1f} mm with {best}"
        )


def moving_steps(valid: Array, wrist: Array, turn: Array, shift: Array) -> Array:
    """Frames from which to the next one the object and a hand that is in both move."""
    both = valid[1:] & valid[:-1]
    both &= np.linalg.norm(np.diff(wrist, axis=0), axis=1) > ALONG_SPEED
    cosine = (np.einsum("tij,tij->t", turn[1:], turn[:-1]) - 1) / 2
    turns = np.arccos(np.clip(cosine, -1, 1)) > 0.02
    travels = np.linalg.norm(np.diff(shift, axis=0), axis=1) > 0.002
    return np.flatnonzero(both & (turns | travels))


def slip(point: Array, turn: Array, shift: Array, steps: Array) -> float:
    """Median metres a frame that a point moves in the object's frame."""
    seen = np.einsum("tji,tj->ti", turn, point - shift)
    return float(np.median(np.linalg.norm(seen[steps + 1] - seen[steps], axis=1)))


def reach(point: Array, turn: Array, shift: Array, steps: Array, verts: Array) -> float:
    """Median metres from a point to the ball around the moved vertices; 0 and less inside."""
    centre = (verts.max(0) + verts.min(0)) / 2
    radius = np.linalg.norm(verts - centre, axis=1).max()
    away = np.linalg.norm(point - turn @ centre - shift, axis=1)[steps] - radius
    return float(np.median(away))


def of_object(recording: Recording) -> Iterator[str]:
    """Whether the mesh stands where the source says that the object is."""
    pair = recording.evidence.object_points
    if pair is None:
        return
    known = np.isfinite(pair[0]).all((1, 2)) & np.isfinite(pair[1]).all((1, 2))
    if not known.any():
        return
    off = float(np.linalg.norm(pair[0][known] - pair[1][known], axis=-1).mean())
    if off > POINT_LIMIT:
        yield (
            f"placement: the mesh moved by its pose stands {1000 * off:.0f} mm from the stored "
            "object; its rotation, units or centre are others"
        )
