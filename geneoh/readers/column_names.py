"""Parse names of columns and fields: a coordinate, its point, the side of the hand.

Programs name coordinates in many ways: `WRIST_x`, `LeftIndexTipPosX`, `XR_HAND_JOINT_PALM_EXT_px`,
`field.pose.position.x`, `q_RS_w []`.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

from geneoh.choices import Side

WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
UNIT = re.compile(r"\s*[\[(](?!\d+[\])])(\w*)[^])]*[\])]")
"""A unit in brackets; a number in brackets is the index of a point instead, as in `poses[3]`."""
AXIS = re.compile(r"(p|pos|t|q|r|rot)?([xyzw])")
"""The last word of a coordinate's name: the axis, perhaps after a mark such as `pos` or `rot`."""
OF_PLACES = {"p", "pos", "position", "t", "trans", "translation", "location"}
OF_TURNS = {"q", "quat", "quaternion", "r", "rot", "rotation", "orientation"}
SIDE_WORDS: dict[str, Side] = {"left": "left", "l": "left", "lh": "left"}
SIDE_WORDS |= {"right": "right", "r": "right", "rh": "right"}
FILLERS = {"xr", "hand", "joint", "ext", "finger", "phalanx", "landmark", "keypoint", "point"}
FILLERS |= {"bone", "root", "id", "field", "poses", "points", "joints", "landmarks", "keypoints"}
"""Words in names that do not identify the point."""
FINGER_NUMBERS = {"thumb": 0, "index": 1, "middle": 2, "ring": 3, "little": 4, "pinky": 4}
SEGMENTS = ("metacarpal", "proximal", "intermediate", "distal", "tip")
"""OpenXR's points of a finger. The thumb has no intermediate one; OpenPose has no metacarpal but
the thumb's."""
OTHER_SEGMENTS = {
    **dict.fromkeys(("mcp", "knuckle", "1"), "proximal"),
    **dict.fromkeys(("pip", "middle", "intermediatebase", "2"), "intermediate"),
    **dict.fromkeys(("dip", "intermediatetip", "3"), "distal"),
    **{"4": "tip", "0": "metacarpal"},
}
OTHER_OF_THUMB = {
    **dict.fromkeys(("cmc", "knuckle", "1"), "metacarpal"),
    **dict.fromkeys(("mcp", "intermediatebase", "2"), "proximal"),
    **dict.fromkeys(("ip", "intermediatetip", "3"), "distal"),
    **{"4": "tip"},
}
"""OpenXR's names for those of MediaPipe, MRTK and ARKit, and for numbers of the OVR skeleton."""
STAMP_PARTS = ("sec", "secs"), ("nanosec", "nsec", "nsecs")
"""Names of ROS, version 2 and 1, for the seconds and the nanoseconds of a time."""
LEFT_OUT = {"palm", "forearm", "thumb0"}
"""Points of other skeletons that OpenPose's does not have, besides the metacarpals."""


def words_of(name: str) -> list[str]:
    """The words of a name in lower case, split at punctuation, capitals and digits."""
    return [word.lower() for word in WORD.findall(UNIT.sub("", name))]


IMAGE_NAMES = ("image", "img", "file", "filename", "frame_name")
IMAGE_NAMES += tuple(
    f"{what}_{of}" for what in ("image", "img", "file") for of in ("name", "path", "file", "id")
)
"""Names of the image that a frame is from, as words_of joins their words by underscores."""


def image_numbers(names: Iterable[Any]) -> list[int] | None:
    """The last number in each image's name; None unless they rise by 1, but where images are left
    out: other numbers may be times, or count at another rate than that of the frames."""
    found = [re.findall(r"\d{1,18}", Path(str(name)).stem) for name in names]
    numbers = [int(each[-1]) for each in found if each]
    steps = [after - before for before, after in pairwise(dict.fromkeys(numbers))]
    rising = numbers == sorted(numbers) and bool(steps) and median(steps) == 1
    return numbers if rising and len(numbers) == len(found) else None


def plain_name(name: str) -> str:
    """The last part of a name with dots or slashes in lower case; a unit in brackets is appended:
    `time_ns`."""
    unit = UNIT.search(name)
    name = re.split(r"[./]", UNIT.sub("", name).strip().lower())[-1].lstrip("#% _")
    return f"{name}_{unit[1]}" if unit and unit[1] else name


def columns_called(
    columns: Iterable[str | None], names: Iterable[str]
) -> Iterator[tuple[str, str]]:
    """Those of `names` that a column has, in the order of `names`, each with its first column."""
    called = {plain_name(column): column for column in reversed(list(columns)) if column}
    return ((name, called[name]) for name in names if name in called)


def split_stamp(columns: Iterable[str | None]) -> tuple[str, str] | None:
    """The columns of seconds and nanoseconds into which ROS splits a time, if there are such."""
    columns = list(columns)
    found = [next(columns_called(columns, names), None) for names in STAMP_PARTS]
    return (found[0][1], found[1][1]) if found[0] and found[1] else None


@dataclass(frozen=True)
class Coordinate:
    """The coordinate that a name denotes."""

    is_turn: bool
    """Whether it belongs to an orientation, and not to a position."""
    axis: str
    """x, y, z, or w of a quaternion."""
    of: tuple[str, ...]
    """The other words of the name, which identify the point."""
    is_marked: bool = False
    """Whether the name states that it is a position or an orientation, as `pos_x` does."""


def coordinate_in(name: str) -> Coordinate | None:
    """The coordinate that a name denotes, if any; a number may follow the axis, as in `x12`."""
    *words, last = words_of(name) or [""]
    if words and words[-1] in ("x", "y", "z") and last.isdecimal():
        words, last = [*words[:-1], last], words[-1]
    found = AXIS.fullmatch(last)
    if found is None:
        return None
    mark, axis = found.groups()
    marks = {mark, *words[-1:], *words[:1]} - {None}
    # a lone R is the right side at the start of a name, and a frame of reference at its end
    is_turn = axis == "w" or bool(marks & OF_TURNS - {"r"}) or mark == "r"
    is_marked = is_turn or bool(marks & OF_PLACES)
    marked = (OF_TURNS - {"r"}) | OF_PLACES
    return Coordinate(is_turn, axis, tuple(w for w in words if w not in marked), is_marked)


def side_in(words: Iterable[str]) -> Side | None:
    """The side of a hand that one of the words names, if any."""
    return next((SIDE_WORDS[word] for word in words if word in SIDE_WORDS), None)


def point_in(words: Iterable[str]) -> int | str | None:
    """OpenPose's index of a point; "" for a known point that it lacks, None for an unknown name.

    If the name is a bare number, its digits are returned.
    """
    words = [word for word in words if word not in FILLERS and word not in SIDE_WORDS]
    if len(words) == 1 and words[0].isdecimal():
        return words[0]
    text = "".join(words)
    if text == "wrist" or text in LEFT_OUT:
        return 0 if text == "wrist" else ""
    if not words or words[0] not in FINGER_NUMBERS:
        return None
    finger, segment = FINGER_NUMBERS[words[0]], "".join(words[1:])
    segment = (OTHER_SEGMENTS if finger else OTHER_OF_THUMB).get(segment, segment)
    segments = SEGMENTS[1:] if finger else (*SEGMENTS[:2], *SEGMENTS[3:])
    if segment in segments:
        return 1 + 4 * finger + segments.index(segment)
    return "" if segment in SEGMENTS and finger else None
