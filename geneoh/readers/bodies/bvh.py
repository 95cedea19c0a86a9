"""Convert the BVH of any program to a body of 52 joints, and such a body to a BVH.

Each BVH has its own rest pose, joint frames, unit and axes. Each joint of ours gets the frame in
which it is at rest in our T-pose: R_ours = R_bvh @ D, where D rotates our bone at rest to the
BVH's. Bone lengths are the BVH's, so all of its joints keep their exact positions, except for
motion of spine joints that our skeleton lacks.
"""

import io
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.body.motion import BodyMotion, body_local_rotations
from geneoh.body.skeleton import JOINT_NAMES, PARENTS, WRISTS, Skeleton, embedded_skeleton
from geneoh.choices import SIDES, Axis
from geneoh.errors import InputError
from geneoh.geometry.mesh import INCH, METRES
from geneoh.geometry.rotations import shortest_turn
from geneoh.readers.bodies.base import BodyRecording, checked_body, upright_body
from geneoh.readers.bodies.bvh_file import BvhFile, read_bvh_file
from geneoh.readers.bodies.bvh_names import FINGER_WORDS, NEEDED, match_joints
from geneoh.readers.clock import rate_of
from geneoh.readers.npz.layouts import quoted
from geneoh.sequence.body_hands import hand_offsets

UNITS = {**METRES, "inches": INCH, "CMU's unit": 0.056444}
"""Units that programs write, in metres; CMU's skeletons are in inches / 0.45."""
TYPICAL_LEG = 0.85  # metres from hip to ankle
TYPICAL_ARM = 0.55  # metres from shoulder to wrist, for skeletons without legs
GIMBAL_LOCK = 1e-7  # cosine of the second Euler angle below which the others are not unique
SNAP = 0.8  # cosine above which a direction of the rest pose is snapped to an axis
LIMBS = (("hip", "knee", "ankle", "foot"), ("collar", "shoulder", "elbow", "wrist", "middle1"))
DIRECTED = {
    f"{side}_{joint}": f"{side}_{after}"
    for side in SIDES
    for limb in LIMBS
    for joint, after in pairwise(limb)
}
DIRECTED |= {
    JOINT_NAMES[joint]: JOINT_NAMES[after]
    for after, joint in enumerate(PARENTS)
    if joint > max(WRISTS.values())
}
"""The joint at the other end of the bone of each joint of a limb or a finger."""
CM = 100.0
ROOT_CHANNELS = "CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation"
TURN_CHANNELS = "CHANNELS 3 Zrotation Yrotation Xrotation"


def read_bvh(path: Path, *, fps: float | None = None, up: Axis | None = None) -> BodyRecording:
    """The body in a BVH, by the names of its joints; `InputError` without arms with hands."""
    file = read_bvh_file(path)
    names = [joint.name for joint in file.joints]
    found = match_joints(names, file.parents)
    if missing := [name for name in NEEDED if name not in found]:
        raise InputError(
            f"{path}: expected a body with arms and hands, by names such as 'LeftArm', "
            f"'LeftForeArm' and 'LeftHand', got none for {', '.join(missing)} among "
            f"{quoted(names)}; rename the joints"
        )
    skeleton, motion, unit = as_body(file, found, path)
    motion, up, notes = upright_body(motion, skeleton, up)
    same = fps is not None and abs(fps - file.fps) <= 0.05  # programs round the frame time
    rate, _ = rate_of(file.fps, file.fps if same else fps, str(path))
    notes = (*notes, f"lengths are taken as {unit}")
    fingers = all(f"{side}_{finger}1" in found for side in SIDES for finger in FINGER_WORDS)
    about = (rate, f"{path} (BVH)", up, fingers)
    return checked_body(BodyRecording(motion, skeleton, torch.zeros(3), *about, notes=notes))


def as_body(file: BvhFile, found: dict[str, int], path: Path) -> tuple[Skeleton, BodyMotion, str]:
    """The skeleton in metres, the motion in the file's world, and the name of the file's unit."""
    unit, metres = unit_of(file.rest(), found)
    rest = {name: metres * file.rest()[index] for name, index in found.items()}
    turns = rest_turns(rest)
    if not torch.linalg.det(turns["pelvis"]) > 0.5:
        raise InputError(
            f"{path}: expected shoulders above the pelvis and apart at rest, got a rest pose that "
            "shows no front; export it in a T-pose"
        )
    offsets, kept = torch.zeros(len(JOINT_NAMES), 3), dict(rest)
    for joint, name in enumerate(JOINT_NAMES[1:], 1):
        above = JOINT_NAMES[PARENTS[joint]]
        if name not in kept:
            placed = _between(joint, kept)
            own = turns[above] @ embedded_skeleton().offsets[joint]
            kept[name] = kept[above] + own if placed is None else placed
            turns[name] = turns[above]
        offsets[joint] = turns[above].T @ (kept[name] - kept[above])
    places, rotations = file.posed()
    world: list[Tensor] = []
    for joint, name in enumerate(JOINT_NAMES):
        index = found.get(name)
        # a joint that the file lacks rotates with its parent
        turn = world[PARENTS[joint]] if index is None else rotations[:, index] @ turns[name]
        world.append(turn)
    root = metres * places[:, found["pelvis"]]
    return (
        Skeleton(offsets),
        BodyMotion(root, body_local_rotations(torch.stack(world, dim=1))),
        unit,
    )


def unit_of(rest: Float[Tensor, "J 3"], found: dict[str, int]) -> tuple[str, float]:
    """The unit in which legs, or else arms, are nearest to an adult's in length; its metres."""
    for names, typical in ((("hip", "knee", "ankle"), TYPICAL_LEG), (NEEDED[:3], TYPICAL_ARM)):
        chain = [name if "_" in name else f"left_{name}" for name in names]
        if all(name in found for name in chain):
            points = rest[[found[name] for name in chain]]
            length = float((points[1:] - points[:-1]).norm(dim=-1).sum())
            if length > 0:
                misfit = {unit: abs(np.log(length * m / typical)) for unit, m in UNITS.items()}
                unit = min(misfit, key=lambda name: misfit[name])
                return unit, UNITS[unit]
    return "m", 1.0


def rest_turns(rest: dict[str, Float[Tensor, " 3"]]) -> dict[str, Float[Tensor, "3 3"]]:
    """D of every joint: the rotation from our T-pose to the rest pose of the file."""
    facing = facing_of(rest)
    ours = embedded_skeleton().offsets
    turns: dict[str, Tensor] = {}
    for joint, name in enumerate(JOINT_NAMES):
        limb = joint > 0 and name.startswith(SIDES)
        turn = turns[JOINT_NAMES[PARENTS[joint]]] if limb else facing
        towards = DIRECTED.get(name)
        if towards in rest and name in rest and bool((rest[towards] - rest[name]).any()):
            bone = turn @ ours[JOINT_NAMES.index(towards)]
            turn = shortest_turn(bone, rest[towards] - rest[name]) @ turn
        turns[name] = turn
    return turns


def facing_of(rest: dict[str, Float[Tensor, " 3"]]) -> Float[Tensor, "3 3"]:
    """The rotation from our T-pose to the up and left of a rest pose, snapped to axes if near."""
    left = rest["left_shoulder"] - rest["right_shoulder"]
    middle = (rest["left_shoulder"] + rest["right_shoulder"]) / 2
    up = snapped(middle - rest["pelvis"])
    left = snapped(left - (left @ up) * up)
    left = normalize(left - (left @ up) * up, dim=0)
    return torch.stack([left, up, torch.linalg.cross(left, up)], dim=1)


def snapped(direction: Float[Tensor, " 3"]) -> Float[Tensor, " 3"]:
    """The unit vector of a direction, or of the axis that it nearly follows."""
    unit = normalize(direction, dim=0)
    size, index = unit.abs().max(dim=0)
    return torch.eye(3)[index] * unit[index].sign() if size > SNAP else unit


def _between(joint: int, places: dict[str, Float[Tensor, " 3"]]) -> Float[Tensor, " 3"] | None:
    """Position of a missing joint on the line from its parent to its nearest known descendant."""
    level, steps = children_of(joint), 1
    while level and not any(JOINT_NAMES[child] in places for child in level):
        level, steps = [deeper for child in level for deeper in children_of(child)], steps + 1
    known = [child for child in level if JOINT_NAMES[child] in places]
    if not known:
        return None
    start, end = places[JOINT_NAMES[PARENTS[joint]]], places[JOINT_NAMES[known[0]]]
    return start + (end - start) / (steps + 1)


def bvh_text(skeleton: Skeleton, motion: BodyMotion, fps: float) -> str:
    """A body with its fingers as a BVH: SMPL-H's names, centimetres, y up, at rest our T-pose."""
    lines = ["HIERARCHY", *hierarchy(skeleton, 0, 0)]
    lines += ["MOTION", f"Frames: {len(motion.root)}", f"Frame Time: {1 / fps:.9g}"]
    order = written_order()
    turns = motion.rotations[:, order].double().numpy()
    values = [CM * motion.root.double().numpy(), euler_angles(turns).reshape(len(turns), -1)]
    rows = io.StringIO()
    np.savetxt(rows, np.concatenate(values, axis=1), fmt="%.6f")
    return "\n".join([*lines, rows.getvalue()])


def euler_angles(turns: Float[np.ndarray, "*B 3 3"]) -> Float[np.ndarray, "*B 3"]:
    """Angles about z, then the new y, then the new x, degrees; about x none where they are not
    unique (gimbal lock)."""
    across = np.hypot(turns[..., 0, 0], turns[..., 1, 0])
    locked = across < GIMBAL_LOCK
    about_z = np.arctan2(
        np.where(locked, -turns[..., 0, 1], turns[..., 1, 0]),
        np.where(locked, turns[..., 1, 1], turns[..., 0, 0]),
    )
    about_y = np.arctan2(-turns[..., 2, 0], across)
    about_x = np.where(locked, 0.0, np.arctan2(turns[..., 2, 1], turns[..., 2, 2]))
    return np.rad2deg(np.stack([about_z, about_y, about_x], axis=-1))


def children_of(joint: int) -> list[int]:
    """The children of a joint."""
    return [child for child, parent in enumerate(PARENTS) if parent == joint]


def written_order(joint: int = 0) -> list[int]:
    """The joints in depth-first order, as a BVH hierarchy lists them."""
    return [joint, *(each for child in children_of(joint) for each in written_order(child))]


def hierarchy(skeleton: Skeleton, joint: int, depth: int) -> list[str]:
    """The lines of a joint and of all its descendants."""
    tab, below = "\t" * depth, children_of(joint)
    lines = [f"{tab}{'JOINT' if joint else 'ROOT'} {JOINT_NAMES[joint]}", f"{tab}{{"]
    lines += [f"{tab}\tOFFSET {centimetres(skeleton.offsets[joint])}"]
    lines += [f"{tab}\t{TURN_CHANNELS if joint else ROOT_CHANNELS}"]
    for child in below:
        lines += hierarchy(skeleton, child, depth + 1)
    if not below:
        end = centimetres(end_of(skeleton, joint))
        lines += [f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET {end}", f"{tab}\t}}"]
    return [*lines, f"{tab}}}"]


def end_of(skeleton: Skeleton, joint: int) -> Float[Tensor, " 3"]:
    """Offset of the end of a chain: a fingertip, or for head and toes their own offset again."""
    for side in SIDES:
        if joint > WRISTS["right"] and JOINT_NAMES[joint].startswith(side):
            finger = (joint - JOINT_NAMES.index(f"{side}_index1")) // 3
            return hand_offsets(skeleton, side)[15 + finger]
    return skeleton.offsets[joint]


def centimetres(point: Float[Tensor, " 3"]) -> str:
    """A point as three numbers in centimetres, for a line of a BVH."""
    return " ".join(f"{value:.6f}" for value in (CM * point).tolist())
