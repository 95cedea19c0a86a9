"""Parse BVH files: a tree of joints with offsets, and channels over the frames.

This is our own parser, because of the existing libraries one refuses joints with position channels,
which many exporters write, and one never returns on a truncated file.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation
from torch import Tensor

from geneoh.errors import InputError
from geneoh.files.reading import read_bytes
from geneoh.geometry import kinematics
from geneoh.readers.nested_lists import NUMBERS_LIMIT
from geneoh.readers.records import FRAME_LIMIT, Array, float32

BVH_LIMIT = 2**28
"""Largest BVH in bytes: an hour of a body with fingers at 30 frames a second."""
MOST_JOINTS = 1000
CHANNEL = re.compile(r"([XYZ])(position|rotation)", re.IGNORECASE)
DAMAGED = "export it again"


@dataclass
class BvhJoint:
    """One joint of the hierarchy, in the order of the file."""

    name: str
    parent: int
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    channels: list[str] = field(default_factory=list)
    """Such as "Xposition" and "Zrotation", in their order."""


@dataclass(frozen=True)
class BvhFile:
    """A hierarchy and its motion, in the file's own unit and world."""

    joints: tuple[BvhJoint, ...]
    fps: float
    rotations: Float[Tensor, "T J 3 3"]
    """Rotation of each joint in its parent's frame; the identity at rest."""
    offsets: Float[Tensor, "T J 3"]
    """Position of each joint in its parent's frame; of the root in the world."""

    @property
    def parents(self) -> list[int]:
        """Parent of each joint, -1 for the root."""
        return [joint.parent for joint in self.joints]

    def rest(self) -> Float[Tensor, "J 3"]:
        """Positions of the joints at rest, with the root at the origin."""
        places = np.zeros((len(self.joints), 3))
        for index, joint in enumerate(self.joints[1:], 1):
            places[index] = places[joint.parent] + joint.offset
        return float32(places)

    def posed(self) -> tuple[Float[Tensor, "T J 3"], Float[Tensor, "T J 3 3"]]:
        """Positions and rotations of the joints in the file's world."""
        return kinematics.tree_kinematics(
            self.rotations, self.offsets[:, 0], self.offsets[:, 1:], self.parents
        )


def read_bvh_file(path: Path) -> BvhFile:
    """The hierarchy and the motion of a BVH; `InputError` for a file that is no whole one."""
    text = read_bytes(path, BVH_LIMIT).decode("utf-8", "replace")
    parts = re.split(r"^\s*MOTION\s*$", text, maxsplit=1, flags=re.MULTILINE)
    if len(parts) != 2 or "HIERARCHY" not in parts[0][:200]:
        raise InputError(f"{path}: expected HIERARCHY and MOTION of a BVH, got neither; {DAMAGED}")
    joints = read_hierarchy(parts[0], path)
    channels = sum(len(joint.channels) for joint in joints)
    values, seconds = _read_motion(parts[1], channels, path)
    return BvhFile(tuple(joints), 1 / seconds, *posed_channels(joints, values))


def read_hierarchy(text: str, path: Path) -> list[BvhJoint]:
    """The joints of a hierarchy; end sites, which do not move, are left out."""
    joints: list[BvhJoint] = []
    open_blocks: list[int] = []  # -1 for an end site
    pending = -1
    lines = re.sub(r"([{}])", r"\n\1\n", text).splitlines()  # braces are lines of their own
    for words in filter(None, map(str.split, lines)):
        match words[0].upper():
            case "ROOT" | "JOINT":
                parent = open_blocks[-1] if open_blocks else -1
                if bool(joints) == (parent < 0) or len(joints) == MOST_JOINTS:
                    tree = f"one tree of up to {MOST_JOINTS} joints, no prop or body beside it"
                    raise refusal(path, tree, words)
                pending = len(joints)
                joints.append(BvhJoint(" ".join(words[1:]), parent))
            case "END":
                pending = -1
            case "{":
                open_blocks.append(pending)
            case "}" if open_blocks:
                open_blocks.pop()
            case "OFFSET" if open_blocks:
                if open_blocks[-1] >= 0:
                    joints[open_blocks[-1]].offset = numbers_of(words[1:], path)
            case "CHANNELS" if open_blocks and open_blocks[-1] >= 0:
                joints[open_blocks[-1]].channels = channels_of(words[1:], path)
            case "HIERARCHY":
                pass
            case _:
                raise refusal(path, "a statement of a BVH hierarchy", words)
    if not joints or open_blocks:
        raise InputError(f"{path}: expected a whole hierarchy, got one that is cut; {DAMAGED}")
    return joints


def refusal(path: Path, expected: str, words: list[str]) -> InputError:
    """The error for a line that does not belong there."""
    return InputError(f"{path}: expected {expected}, got {' '.join(words)[:60]!r}; {DAMAGED}")


def numbers_of(words: list[str], path: Path) -> tuple[float, ...]:
    """The three numbers of an offset."""
    try:
        found = tuple(float(word) for word in words)
    except ValueError:
        found = ()
    if len(found) != 3 or not np.isfinite(found).all():
        raise refusal(path, "three finite numbers after OFFSET", words)
    return found


def channels_of(words: list[str], path: Path) -> list[str]:
    """The names of a joint's channels; their number must be as stated, and each occurs once."""
    names = [name for word in words[1:] for name in [CHANNEL.fullmatch(word)] if name]
    found = [name[1].upper() + name[2].lower() for name in names]
    turns = [name for name in found if name.endswith("rotation")]
    whole = words[:1] == [str(len(found))] and len(found) == len(words) - 1 == len(set(found))
    if not whole or len(turns) > 3:
        raise refusal(path, "the number and the names of channels after CHANNELS", words)
    return found


def _read_motion(text: str, channels: int, path: Path) -> tuple[Array, float]:
    """(T, C) values of the channels, and the frame time in seconds."""
    head = re.match(r"\s*Frames:\s*(\d+)\s+Frame\s+Time:\s*(\S+)\s", text, re.IGNORECASE)
    try:
        frames, seconds = (int(head[1]), float(head[2])) if head else (0, 0.0)
    except ValueError:
        frames, seconds = 0, 0.0
    if head is None or not 0 < frames <= FRAME_LIMIT or not 0 < seconds < float("inf"):
        raise InputError(
            f"{path}: expected 'Frames:' from 1 to {FRAME_LIMIT} and 'Frame Time:' in seconds "
            f"after MOTION, got {' '.join(text[:80].split())[:60]!r}; {DAMAGED}"
        )
    if frames * channels > NUMBERS_LIMIT:
        raise InputError(f"{path}: expected at most {NUMBERS_LIMIT} numbers, got more; cut it")
    try:
        values = np.array(text[head.end() :].split(), dtype=np.float64)
    except ValueError:
        raise InputError(f"{path}: expected numbers only after Frame Time; {DAMAGED}") from None
    if values.size != frames * channels:
        raise InputError(
            f"{path}: expected {frames} frames of {channels} numbers as its hierarchy says, got "
            f"{values.size} numbers in all; {DAMAGED}"
        )
    return values.reshape(frames, channels), seconds


def posed_channels(
    joints: list[BvhJoint], values: Array
) -> tuple[Float[Tensor, "T J 3 3"], Float[Tensor, "T J 3"]]:
    """Local rotations and offsets: a joint's position channels replace its offset."""
    offsets = np.tile([joint.offset for joint in joints], (len(values), 1, 1))
    turns = np.tile(np.eye(3), (len(values), len(joints), 1, 1))
    start = 0
    for index, joint in enumerate(joints):
        own = values[:, start : start + len(joint.channels)]
        start += len(joint.channels)
        turning = [at for at, name in enumerate(joint.channels) if name.endswith("rotation")]
        for at, name in enumerate(joint.channels):
            if at not in turning:
                offsets[:, index, "XYZ".index(name[0])] = own[:, at]
        if turning:
            axes = "".join(joint.channels[at][0] for at in turning)
            turned = Rotation.from_euler(axes, own[:, turning], degrees=True).as_matrix()
            turns[:, index] = turned
    return float32(turns), float32(offsets)
