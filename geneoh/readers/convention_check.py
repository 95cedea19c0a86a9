"""Does a file follow its source's convention? Compares what the file states more than once.

Every check compares the sequence as it was read with stored keypoints or vertices, with what hands
can do, or with another reading of the same numbers: a hand that holds an object moves with it, so
that a reading under which it moves along much better than under the source's own is a
contradiction. A check yields a sentence for each contradiction.
"""

from collections.abc import Iterator

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import OTHER_SIDE, JointOrder, Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import size_warning
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import KEYPOINT_PARENTS, forward_kinematics, rest_offsets
from geneoh.readers.base import CrossChecks, Recording, finite_frames
from geneoh.readers.delay_check import check_delay
from geneoh.readers.joint_orders import ORDERS
from geneoh.readers.mano import MEAN_WRIST_OFFSET, mean_wrist_offset
from geneoh.readers.records import Array
from geneoh.sequence.camera import wrist_of
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.sequence.validation import FARTHEST_SCENE, check_sequence, distance_to_object

WRIST_LIMIT = 0.005
"""Metres that the turning point of a stored mesh may be off; J0 is 96 mm long."""
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
SHORTER_BONES = 0.9
"""Share of the bones' total length below which another order of the keypoints is the true one; with
up to 40 mm of noise the true order has the shortest bones."""
REORDER = "reorder them, or pass --joint-order {order} where they are bare keypoints"
"""What to do about a file whose keypoints are in another order."""
TOUCHING_REACH = 0.25
"""Metres from the wrist to the object's ball beyond which no hand can touch the object."""
POSES_REACH = 5.0
"""Metres from the wrist to the origin of an object without a mesh, which no object reaches over."""
CURL_LIMIT = 0.1
"""Share of the palm's length that fingers may bend backward at their tips."""
J0_SHARE = 0.3
"""Share by which the length of J0 differs from hand to hand."""
LARGEST_CONDITION = 100.0
"""Of the system that tells the turning point of a mesh: a hand that hardly turns shows none."""
HOLDING_STEPS, HOLDING_GAIN, HOLDING_SHARE = 5, 0.002, 0.4
"""Moving frames that are needed; metres a frame and share by which another reading is better."""
SCATTER, SCATTER_SHARE = 0.03, 0.5
"""Metres of scatter from which on, and share of it below which, another reading is the better one.
No sound clip of 1,248 made ones is told so, half of them with 20 mm of noise."""
MOVING_SPEED, MOVING_TURN = 0.002, 0.02
"""Metres and radians a frame from which on something moves: a hand that rests shows nothing."""
TRANSPOSED = "the object's rotation transposed"
INVERTED = "the object's poses inverted, as they are world to object"
"""Readings that noise hides from the slip of a frame, and that the scatter tells."""
HOLDING_REACH = 0.25
"""Metres from the wrist to the object's ball within which a reading has the hand hold it."""


def contradictions(recording: Recording) -> list[str]:
    """What contradicts the convention that a recording was read by; nothing when all agrees."""
    found = list(recording.cross_checks.contradictions)
    sequence = recording.sequence
    try:
        check_sequence(sequence, recording.name)
    except InputError as error:
        found.append(f"units and frames: {error}")
    for mesh in sequence.object.meshes:
        if warning := size_warning(mesh):
            found.append(f"units: {warning}")
    for hand in sequence.hands:
        for check in HAND_CHECKS:
            found += [f"{hand.side} hand: {words}" for words in check(hand, recording.cross_checks)]
        for beside in (check_place, check_holding):
            found += [f"{hand.side} hand: {words}" for words in beside(hand, sequence.object)]
    found += check_object_placement(recording.cross_checks)
    return found


def doubts(sequence: Sequence, name: str) -> Iterator[str]:
    """What is doubtful about a sequence before it is cleaned, each with the option that cures it.

    `InputError` where the keypoints are certainly in another order; `name` is that of the file.
    """
    for hand in sequence.hands:
        refuse_other_order(hand, name)
        away = float(distance_to_object(hand, sequence.object)[hand.valid].min())
        if away > TOUCHING_REACH:
            yield (
                f"{hand.side} hand: its wrist stays {away:.2f} m from the object, too far to touch "
                "it; check the object's poses (--object-pose) and the units (--unit)"
            )
        yield from (f"{hand.side} hand: {words}" for words in check_place(hand, sequence.object))
        for check in (check_keypoint_order, check_finger_bend):
            yield from (f"{hand.side} hand: {words}" for words in check(hand, CrossChecks()))
        held = (hand, sequence.object)
        found = (*check_holding(*held), *check_delay(*held, sequence.fps))
        yield from (f"{hand.side} hand: {words}" for words in found)


def refuse_other_order(hand: HandTrack, name: str, cure: str = REORDER) -> None:
    """`InputError` where the keypoints are certainly in another order than OpenPose's.

    `name` is that of the file in the message, `cure` its remedy, with the order's name as {order}.
    """
    if hand.joints is not None and (order := shorter_order(trusted_joints(hand))):
        raise InputError(
            f"{name}: the keypoints of the {hand.side} hand must be in OpenPose order, got bones "
            f"that only a hand in the order {order} has; {cure.format(order=order)}"
        )


def check_place(hand: HandTrack, motion: ObjectTrack) -> Iterator[str]:
    """Whether the wrist comes near the world's origin, and near the poses of an object without a
    mesh."""
    wrist, seen = wrist_of(hand), hand.trust[:, 0] > 0
    away = float(wrist.norm(dim=-1).masked_fill(~seen, torch.inf).min())
    if FARTHEST_SCENE < away < torch.inf:
        yield (
            f"place: its wrist stays {away:.0f} m from the origin of the world, farther than "
            "scenes reach; give its places in metres (--keypoint-unit, --focal), and move the "
            "origin near"
        )
    both = seen[:, None] if motion.valid is None else seen[:, None] & motion.valid
    apart = (wrist[:, None] - motion.translation).norm(dim=-1)
    nearest = float(apart.masked_fill(~both, torch.inf).min())
    if not motion.meshes and POSES_REACH < nearest < torch.inf:
        yield (
            f"place: its wrist stays {nearest:.0f} m from the poses of the object, too far to "
            "touch it; give both in metres and in the same frame (--object-pose, --keypoint-unit)"
        )


def shorter_order(joints: Float[Tensor, "T 21 3"]) -> JointOrder | None:
    """The order in which the keypoints have much shorter bones than in OpenPose's, if any."""
    totals: dict[JointOrder, float] = {
        name: bones_length(joints[:, list(order.entries)])
        for name, order in ORDERS.items()
        if sorted(order.entries) == list(range(21))
    }
    best = min(totals, key=totals.__getitem__)
    return best if totals[best] < SHORTER_BONES * totals["openpose"] else None


def trusted_joints(hand: HandTrack) -> Float[Tensor, "N 21 3"]:
    """Keypoints of the observed frames, NaN where one has no confidence."""
    assert hand.joints is not None, "asked for the joints of a track that has none"
    return hand.joints.masked_fill((hand.trust == 0)[..., None], torch.nan)[hand.observed]


def bones_length(joints: Float[Tensor, "T 21 3"]) -> float:
    """Total length of the bones of a hand in OpenPose order, each the median of all frames.

    NaN where a keypoint is in none of them.
    """
    bones = joints[:, 1:] - joints[:, list(KEYPOINT_PARENTS[1:])]
    return float(bones.norm(dim=-1).nanmedian(0).values.sum())


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


def check_keypoint_order(hand: HandTrack, stored: CrossChecks) -> Iterator[str]:
    """Whether the bones between the keypoints are as short as fingers, and curl to the palm."""
    if hand.joints is None:
        return
    joints = trusted_joints(hand)
    span = float((joints[:, KNUCKLES] - joints[:, :1]).norm(dim=-1).nanmedian())
    bones = torch.stack(
        [(joints[:, tips] - joints[:, bases]).norm(dim=-1) for bases, tips in LINKS]
    )
    longest = float(bones.nanmedian(1).values.nan_to_num().max())
    if order := shorter_order(joints):
        yield f"order: the bones are those of a hand in the order {order}, not in OpenPose's"
    elif longest > LONGEST_LINK * span:
        yield (
            f"order: a finger's bone is {1000 * longest:.0f} mm long beside a palm of "
            f"{1000 * span:.0f} mm; the keypoints are in another order (--joint-order)"
        )
    elif curls_backward(joints, hand.side):
        other = OTHER_SIDE[hand.side]
        yield (
            "handedness: the fingers curl away from the palm; unless the hand is flat, these are "
            f"points of the other hand: pass --side {other} or correct the side that is stated"
        )


def curls_backward(joints: Float[Tensor, "T 21 3"], side: Side) -> bool:
    """Whether the fingers of a hand curl away from its palm, as those of the other side do."""
    span = float((joints[:, KNUCKLES] - joints[:, :1]).norm(dim=-1).nanmedian())
    return bool(finger_curls(joints, side).nanmean() < -CURL_LIMIT * span)


def finger_curls(joints: Float[Tensor, "T 21 3"], side: Side) -> Float[Tensor, " T"]:
    """Mean metres from the knuckles to the fingertips along the palm's inner normal, of the fingers
    that are not NaN."""
    palm = torch.linalg.cross(joints[:, 5] - joints[:, 0], joints[:, 17] - joints[:, 0])
    palm = torch.nn.functional.normalize(palm, dim=-1) * (1 if side == "right" else -1)
    return ((joints[:, FINGERTIPS] - joints[:, KNUCKLES]) * palm[:, None]).sum(-1).nanmean(-1)


def check_finger_bend(hand: HandTrack, stored: CrossChecks) -> Iterator[str]:
    """Whether the pose bends the fingers the way that they can bend."""
    if hand.pose is None:
        return
    bend = float(hand.pose[hand.valid][:, MIDDLE_JOINTS, 2].mean())
    bend = bend if hand.side == "right" else -bend
    if bend < -BACKWARD_LIMIT:
        other = OTHER_SIDE[hand.side]
        yield (
            f"handedness: the fingers bend backward by {-bend:.2f} rad on average; unless the hand "
            f"is flat, these are the numbers of a {other} hand (--side {other}), or a mean pose is "
            "missing (--mean-pose)"
        )


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


HAND_CHECKS = (
    *(check_wrist_position, check_turning_point, check_keypoint_order, check_finger_bend),
    check_pose_against_keypoints,
)


def check_holding(hand: HandTrack, motion: ObjectTrack) -> Iterator[str]:
    """Whether the hand moves along with the object better under another reading."""
    point = hand.wrist if hand.joints is None or hand.wrist is not None else hand.joints[:, 0]
    if point is None or not motion.meshes:
        return
    wrist = point.double().cpu().numpy()
    turn = motion.rotation[:, 0].double().cpu().numpy()
    shift = motion.translation[:, 0].double().cpu().numpy()
    steps = moving_steps(hand.valid.cpu().numpy(), wrist, turn, shift)
    if len(steps) < HOLDING_STEPS:
        return
    verts = motion.meshes[0].verts.double().cpu().numpy()
    near = {
        words: reading
        for words, reading in other_readings(hand.side, wrist, turn, shift).items()
        if distance_to_ball(*reading, steps, verts) < HOLDING_REACH
    }
    others = {words: slip(*reading, steps) for words, reading in near.items()}
    read, best = slip(wrist, turn, shift, steps), min(others, key=others.__getitem__, default="")
    if best and others[best] < HOLDING_SHARE * read and read - others[best] > HOLDING_GAIN:
        yield (
            f"placement: it slides {1000 * read:.1f} mm a frame over the moving object as read, "
            f"and {1000 * others[best]:.1f} mm with {best}"
        )
        return
    wanders = scatter(wrist, turn, shift, steps)
    told = near.keys() & {TRANSPOSED, INVERTED}
    ways = {words: scatter(*near[words], steps) for words in sorted(told)}
    best = min(ways, key=ways.__getitem__, default="")
    if best and wanders > SCATTER and ways[best] < SCATTER_SHARE * wanders:
        yield (
            f"placement: it wanders {1000 * wanders:.0f} mm about the moving object as read, and "
            f"{1000 * ways[best]:.0f} mm with {best}"
        )


def other_readings(
    side: Side, wrist: Array, turn: Array, shift: Array
) -> dict[str, tuple[Array, Array, Array]]:
    """Wrist, rotation and translation of the object under other conventions, by their words."""
    j0, back = mean_wrist_offset(side), turn.transpose(0, 2, 1)
    return {
        TRANSPOSED: (wrist, back, shift),
        INVERTED: (wrist, back, -(back @ shift[..., None])[..., 0]),
        "the translation as that of the origin": (wrist + j0, turn, shift),
        "the translation as that of the wrist": (wrist - j0, turn, shift),
        "the hand in OpenGL axes": (wrist * [1.0, -1.0, -1.0], turn, shift),
        "the object's translation in millimetres": (wrist, turn, shift / 1000),
        "the object's translation in metres": (wrist, turn, shift * 1000),
    }


def moving_steps(valid: Array, wrist: Array, turn: Array, shift: Array) -> Array:
    """Frames from which to the next one the object and a hand that is in both move."""
    both = valid[1:] & valid[:-1]
    both &= np.linalg.norm(np.diff(wrist, axis=0), axis=1) > MOVING_SPEED
    cosine = (np.einsum("tij,tij->t", turn[1:], turn[:-1]) - 1) / 2
    turns = np.arccos(np.clip(cosine, -1, 1)) > MOVING_TURN
    travels = np.linalg.norm(np.diff(shift, axis=0), axis=1) > MOVING_SPEED
    return np.flatnonzero(both & (turns | travels))


def slip(point: Array, turn: Array, shift: Array, steps: Array) -> float:
    """Median metres a frame that a point moves in the object's frame."""
    local = np.einsum("tji,tj->ti", turn, point - shift)
    return float(np.median(np.linalg.norm(local[steps + 1] - local[steps], axis=1)))


def scatter(point: Array, turn: Array, shift: Array, steps: Array) -> float:
    """Deviation of a point's place in the object's frame, metres: hardly more for a noisy hand."""
    local = np.einsum("tji,tj->ti", turn, point - shift)[steps]
    return float(np.linalg.norm(local.std(axis=0)))


def distance_to_ball(point: Array, turn: Array, shift: Array, steps: Array, verts: Array) -> float:
    """Median metres from a point to the ball around the moved vertices; negative inside."""
    centre = (verts.max(0) + verts.min(0)) / 2
    radius = np.linalg.norm(verts - centre, axis=1).max()
    away = np.linalg.norm(point - turn @ centre - shift, axis=1)[steps] - radius
    return float(np.median(away))


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
