"""Hands in JSON that is not in the formats of MediaPipe's own programs.

A frame lists its hands, has them by side, or is one hand; null, [] and {} hold none. A hand is a
collection of points, or a dict with the points, a side and a score. Points have names, those of
TensorFlow.js, OpenXR, ARKit and the like, or stand in a list in a known order. Such are the results
of hand-pose-detection (TensorFlow.js), OpenPose in 3D, MMPose, and many formats of single programs;
the Leap Motion service is read in `geneoh.readers.keypoints.leap`. Other fields are ignored.
"""

from collections import Counter
from collections.abc import Iterator
from itertools import groupby
from typing import Any

import numpy as np

from geneoh.choices import JointOrder, Side
from geneoh.errors import InputError
from geneoh.readers.clock import CLOCK_NAMES
from geneoh.readers.column_names import IMAGE_NAMES, image_numbers, side_in, words_of
from geneoh.readers.keypoints import mediapipe
from geneoh.readers.keypoints.leap import hands_of_leap, is_leap
from geneoh.readers.keypoints.missing import FEWEST_KEYPOINTS
from geneoh.readers.keypoints.tables import NOT_READ, Numbering
from geneoh.readers.records import Array, Notes


def _plain(name: str) -> str:
    """A name in lower case without underscores, as all names below are written."""
    return name.lower().replace("_", "")


CENTRED = (*mediapipe.WORLD, "keypoints3D")
"""Names of points relative to the hand's centre: MediaPipe's, and TensorFlow.js's for the same."""
POINTS = (*map(_plain, CENTRED), "joints", "joints3d", "landmarks", "points", "positions", "bones")
POINTS += ("keypoints",)
SIDES_OF_HANDS = ("handedness", "handednesses", "side", "hand", "chirality", "handside", "label")
SIDES_OF_HANDS += ("handtype", "type")
SCORES = ("score", "confidence")
SCORES_OF_POINTS = (*SCORES, "scores", "confidences", "keypointscores")
LISTS_OF_HANDS = ("hands", "predictions", "detections", "instances", "people")
PLACES = ("position", "translation", "location", "pose")
POINT_NAMES = ("name", "joint", "jointname", "bone", "id")
"""Names of fields: the points, the side and the score of a hand, scores of its points, the hands of
a frame, and the coordinates and the name of a point."""
BESIDE_SIDE = {"hand", "hands", "keypoints", "joints", "landmarks", "points", "3", "d"}
"""Words that may stand beside the side in the name of a field with the hand of that side."""
LARGEST_NUMBER = 1e300
"""Largest number that counts as a coordinate; JSON may hold integers of hundreds of digits."""
DEEPEST_NESTING = 8
"""Greatest depth of nested lists and dicts that are searched for a hand."""


def read_hands(
    value: Any, where: str, side: Side | None, order: JointOrder
) -> mediapipe.Landmarks | None:
    """The hands in the value of a JSON file; None if it has no frame with a hand.

    `side` is for hands without a side, and `order` is the keypoint order of points in a list.
    """
    frames, in_turn = _frames_of_columns(value), ()
    if not frames:
        frames, in_turn = _with_hands_together(mediapipe.frames_in(value))
    file_side, _ = _side_and_score(value, side, 1.0)
    reader = _Frames(file_side, Numbering(order, where))
    tracks, notes = mediapipe.tracks_in(frames, where, file_side, reader.hands)
    if not tracks:
        return None
    reader.numbering.refuse_unused()
    for track in tracks.values():
        mediapipe.refuse_image_landmarks(track.points, where)
    about = mediapipe.NOTES if reader.centred else ()
    if reader.has_scores_of_points:
        about = (*about, NOT_READ.format("the confidences of single points"))
    stamps = mediapipe.stamps_in(value, frames, where)
    unit = "mm" if any(map(is_leap, frames)) else "m"
    return mediapipe.Landmarks(tracks, (*about, *in_turn, *notes), stamps, unit=unit)


class _Frames:
    """Reads the frames of one file."""

    def __init__(self, side: Side | None, numbering: Numbering) -> None:
        self.numbering, self.centred, self.has_scores_of_points = numbering, False, False
        self._side: Side | None = side

    def hands(self, frame: Any, where: str) -> list[mediapipe.Detected]:
        """The hands of one frame; only results of MediaPipe may hold two of one side."""
        if is_leap(frame):
            frame = list(hands_of_leap(frame))
        hands = list(self._hands(frame, where, None, 1.0))
        count = Counter(hand.side for hand in hands)
        side, most = count.most_common(1)[0] if count else (None, 0)
        if most > 1 and not (self.centred and side and most == 2):
            raise InputError(
                f"{where}: expected one hand of a side, got {most} "
                f"{f'{side} hands' if side else 'hands without a side'}; keep those of one person, "
                "and say of each hand whether it is the left or the right one"
            )
        return hands

    def _hands(
        self, value: Any, where: str, side: Side | None, score: float, depth: int = 0
    ) -> Iterator[mediapipe.Detected]:
        """The hands in a frame or a part of it; `side` and `score` are from the enclosing value."""
        points = self._points(value, where)
        if points is not None:
            first = next(iter(value.values() if isinstance(value, dict) else value), None)
            self.has_scores_of_points |= any(name in _called(first) for name in SCORES)
            yield mediapipe.Detected(side or self._side, score, points)
        elif depth == DEEPEST_NESTING:
            return
        elif isinstance(value, list):
            for each in value:
                yield from self._hands(each, where, side, score, depth + 1)
        elif isinstance(value, dict):
            label, score = _side_and_score(value, side, score)
            fields = _called(value)
            self.has_scores_of_points |= any(
                isinstance(fields.get(name), list) for name in SCORES_OF_POINTS
            )
            for part, of in self._parts(value, where, label):
                yield from self._hands(part, where, of, score, depth + 1)

    def _parts(
        self, value: dict[str, Any], where: str, side: Side | None
    ) -> Iterator[tuple[Any, Side | None]]:
        """The fields of a dict that hold hands, or the points of one, each with its side."""
        sides: dict[str, Side | None] = {name: _side_of(name) for name in value}
        if any(sides.values()):
            for name, each in sides.items():
                if each:
                    yield value[name], each
            return
        fields = _called(value)
        if name := next((name for name in LISTS_OF_HANDS if name in fields), None):
            yield fields[name], side
        elif name := next((name for name in POINTS if fields.get(name)), None):
            if _are_flat(fields[name]):
                raise mediapipe.image_landmarks(where)
            self.centred |= any(each in value for each in CENTRED)
            yield fields[name], side

    def _points(self, value: Any, where: str) -> Array | None:
        """(21, 3) points of a hand, NaN for missing ones; None where the value holds none."""
        named = _points_by_name(value)
        if len(named) < FEWEST_KEYPOINTS:
            return None
        if isinstance(value, list) and all(str(name).isdecimal() for name in named):
            self.numbering.refuse_other_count(len(named))
        points = {name: self.numbering.point(words_of(str(name))) for name in named}
        found = np.full((21, 3), np.nan)
        for name, point in points.items():
            if isinstance(point, int):
                found[point] = named[name]
        unknown = [name for name, point in points.items() if point is None]
        if unknown and len({point for point in points.values() if isinstance(point, int)}) < 21:
            raise InputError(
                f"{where}: expected the names of 21 points, such as wrist, thumb_cmc and "
                f"index_finger_tip, got {', '.join(unknown)[:120]}; rename what is one of them"
            )
        return found


def _frames_of_columns(value: Any) -> list[dict[str, Any]]:
    """The frames of a dict of lists over time, with a list per side, of all points, or per point by
    name; empty if there are no such lists, or their lengths differ. Numbers name frames."""
    fields = value if isinstance(value, dict) else {}
    lists = {name: each for name, each in fields.items() if isinstance(each, list) and each}
    columns = {
        name: each
        for name, each in lists.items()
        if (_side_of(name) or _plain(name) in POINTS)
        and not _is_numbers(each)
        and len(_points_by_name(each)) < FEWEST_KEYPOINTS
    }
    if not columns:
        columns = {
            name: each
            for name, each in lists.items()
            if not mediapipe.NUMBERED.fullmatch(name)
            and all(point is None or _place_of(point) is not None for point in each)
        }
        columns = columns if len(columns) >= FEWEST_KEYPOINTS else {}
    lengths = {len(each) for each in columns.values()}
    count = lengths.pop() if len(lengths) == 1 else 0
    return [{name: each[index] for name, each in columns.items()} for index in range(count)]


def _with_hands_together(frames: list[Any]) -> tuple[list[Any], Notes]:
    """The frames, with consecutive entries of one frame number, time or image, as of programs that
    write each hand by itself, as the hands of one frame; without any of these, entries of left and
    right in turn, with a note."""
    fields = [mediapipe.fields_by_words(each) for each in frames]
    names = [name for name in (*CLOCK_NAMES, *IMAGE_NAMES) if all(name in each for each in fields)]
    sides: list[Side | None] = [_side_and_score(each, None, 1.0)[0] for each in frames]
    if not names and mediapipe.are_in_turn(sides):
        pairs = zip(frames[::2], frames[1::2], strict=True)
        return [{"hands": list(pair)} for pair in pairs], (mediapipe.IN_TURN,)
    if not names or (
        names[0] in IMAGE_NAMES and not image_numbers(each[names[0]] for each in fields)
    ):
        return frames, ()
    stamps = [{name: each[name] for name in names} for each in fields]
    together = groupby(zip(stamps, frames, strict=True), lambda each: each[0][names[0]])
    groups = [list(group) for _, group in together]
    return [
        group[0][1] if len(group) == 1 else {**group[0][0], "hands": [each for _, each in group]}
        for group in groups
    ], ()


def _points_by_name(value: Any) -> dict[str, Array]:
    """The positions in a dict or list of points, by name or number; empty if they are too few.

    A flat list has three numbers per point, or four as of OpenPose; a fourth of 0 means missing.
    """
    if isinstance(value, list) and len(value) in (63, 84) and _is_numbers(value):
        rows = np.array(value, dtype=np.float64).reshape(21, -1)
        places = np.where(rows[:, 3:].all(-1, keepdims=True), rows[:, :3], np.nan)
        return {str(index): place for index, place in enumerate(places)}
    if isinstance(value, list):
        items = [(_name_of(each, str(index)), each) for index, each in enumerate(value)]
    else:
        items = value.items() if isinstance(value, dict) else ()
    found = {name: _place_of(each) for name, each in items}
    if sum(place is not None for place in found.values()) < FEWEST_KEYPOINTS:
        return {}
    lost = np.full(3, np.nan)  # null stands for a point that was not found
    found = {name: lost if fields is None else found[name] for name, fields in items}
    return {name: place for name, place in found.items() if place is not None}


def _called(value: Any) -> dict[str, Any]:
    """The fields of a dict by their plain names; of anything else none."""
    fields = value.items() if isinstance(value, dict) else ()
    return {_plain(str(name)): field for name, field in fields}


def _name_of(point: Any, number: str) -> str:
    """The name in a point's fields, else its number in the list."""
    fields = _called(point)
    names = (fields[name] for name in POINT_NAMES if name in fields)
    return next((name for name in names if isinstance(name, str)), number)


def _place_of(point: Any) -> Array | None:
    """(3,) position of a point from a list, a dict of x, y and z, or a 4x4 matrix by rows or by
    columns; None for anything else."""
    if isinstance(point, dict):
        fields = _called(point)
        inner = next((fields[name] for name in PLACES if name in fields), None)
        if inner is not None:
            return _place_of(inner)
        point = [fields.get(axis, "") for axis in "xyz"]
    if isinstance(point, list) and len(point) == 4:
        point = _place_in_matrix(point)
    if not isinstance(point, list) or len(point) != 3 or not _is_numbers(point):
        return None
    return np.array(point, dtype=np.float64)


def _place_in_matrix(value: list[Any]) -> list[Any] | None:
    """The translation of a 4x4 matrix, by rows or by columns; None for anything else."""
    rows = [list(row) for row in value if isinstance(row, list) and len(row) == 4]
    columns = [list(column) for column in zip(*rows, strict=True)]
    last = [matrix for matrix in (rows, columns) if matrix[3:] == [[0, 0, 0, 1]]]
    return [row[3] for row in last[0][:3]] if len(last) == 1 else None


def _is_numbers(values: list[Any]) -> bool:
    """Whether a list holds only nulls, and numbers that fit into an array."""
    return all(
        each is None or (type(each) in (int, float) and not abs(each) > LARGEST_NUMBER)
        for each in values
    )


def _are_flat(points: Any) -> bool:
    """Whether points have x but no z, as image landmarks do."""
    first = points[0] if isinstance(points, list) else None
    return isinstance(first, dict) and "x" in first and "z" not in first


def _side_of(name: str) -> Side | None:
    """The side of the hand in a field whose name says nothing else."""
    words = set(words_of(str(name))) - BESIDE_SIDE
    return side_in(words) if len(words) == 1 and min(words, key=len) not in ("l", "r") else None


def _side_and_score(value: Any, side: Side | None, score: float) -> tuple[Side | None, float]:
    """The side and the score in a dict's fields, else those of the enclosing value."""
    fields = _called(value)
    labels = [mediapipe.label_of(fields[name]) for name in SIDES_OF_HANDS if name in fields]
    side, score = next((label for label in labels if label[0] is not None), (side, score))
    for sure in (fields[name] for name in SCORES if name in fields):
        if isinstance(sure, float | int) and 0 < sure <= 1:
            return side, float(sure)
    return side, score
