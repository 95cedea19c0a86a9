"""MediaPipe's hand landmarks as programs dump them: its results as JSON, and tables of points.

Results of the Hand Landmarker and of the older Hands, from Python or JavaScript, one a frame in a
list. Tables are wide, a row a frame with columns such as `x0` or `WRIST_x`, or long, a row a point
with the columns `frame`, `landmark`, `x`, `y` and `z`. Both may have the number of each frame, its
time, or both (`geneoh.readers.clock`).
"""

import csv
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import OTHER_SIDE, SIDES, Side
from geneoh.errors import InputError, numbered
from geneoh.files.reading import open_text
from geneoh.readers.clock import CLOCK_NAMES, TIME_NAMES
from geneoh.readers.foreign_files import JSON_LIMIT, number_in
from geneoh.readers.records import FRAME_LIMIT, Array, Record, as_record

FINGERS = ("INDEX_FINGER", "MIDDLE_FINGER", "RING_FINGER", "PINKY")
NAMES = (
    *("WRIST", "THUMB_CMC", "THUMB_MCP", "THUMB_IP", "THUMB_TIP"),
    *(f"{finger}_{joint}" for finger in FINGERS for joint in ("MCP", "PIP", "DIP", "TIP")),
)
"""MediaPipe's names of the landmarks, which are in OpenPose's order."""

WORLD = ("hand_world_landmarks", "worldLandmarks", "multi_hand_world_landmarks")
WORLD += ("multiHandWorldLandmarks", "world_landmarks")
IMAGE = ("hand_landmarks", "landmarks", "multi_hand_landmarks", "multiHandLandmarks")
HANDEDNESS = ("handedness", "handednesses", "multi_handedness", "multiHandedness")
LISTS = ("frames", "results")
"""Names under which a file may list its results."""
OF_SIDE: dict[Side, tuple[str, str]] = {
    side: (f"{side}_hand_world_landmarks", f"{side}HandWorldLandmarks") for side in SIDES
}
"""Fields of the Holistic Landmarker, which tells the hands apart by the body."""
LABELS = ("category_name", "categoryName", "label", "display_name", "displayName")

NOTES = (
    "MediaPipe's world landmarks are metres about the centre of each hand: the way of the hand "
    "through the world is not in them, and the object's poses must be about that centre too",
    "MediaPipe's older Hands name sides as in a mirrored picture; --side says otherwise",
)

FRAME_COLUMNS = ("frame", "frame_id", "frame_idx", "frame_index", "frame_number")
SIDE_COLUMNS = ("side", "hand", "handedness", "label")
POINT_COLUMNS = ("landmark", "landmark_id", "landmark_index", "landmark_name", "joint", "keypoint")
POINT_AND_AXIS = re.compile(r"(?:landmark|joint|keypoint)?[_ .]?(\w+?)[_ .]?([xyz])")
AXIS_AND_POINT = re.compile(r"([xyz])[_ .]?(\d+)")
NO_DEPTH = 1e-4
"""Depth of the wrist, from which the image landmarks of MediaPipe measure their depths."""


@dataclass(frozen=True)
class Track:
    """One hand of a file: (T, 21, 3) points with NaN where it was not seen, and (T,) trust."""

    points: Array
    trust: Array


Row = dict[str | None, Any]
"""A row of a table by the names of its columns."""

Tracks = dict[Side | None, Track]
"""The hands of a file by the side that it says; None where it says none."""

Notes = tuple[str, ...]
"""What had to be assumed, in words."""


def is_results(value: Any) -> bool:
    """Whether the value of a JSON file is a result of MediaPipe, or a list of them."""
    names = (*WORLD, *IMAGE, *chain(*OF_SIDE.values()))
    return any(
        isinstance(each, dict) and any(n in each for n in names) for each in frames_in(value)
    )


def frames_in(value: Any) -> list[Any]:
    """The results in a JSON value, one a frame, which may stand under "result" beside its time."""
    if isinstance(value, dict):
        value = next((value[name] for name in LISTS if name in value), [value])
    return [
        {**frame, **frame["result"]}
        if isinstance(frame, dict) and isinstance(frame.get("result"), dict)
        else frame
        for frame in (value if isinstance(value, list) else [])
    ]


def stamps_in(value: Any, where: str) -> Record:
    """What a JSON value says of time, beside its results or in each of them."""
    frames = frames_in(value)
    named = value if isinstance(value, dict) else {}
    listed = next((name for name in LISTS if name in named), None)
    beside = {name: value for name, value in named.items() if name != listed}
    stamps = {name: beside[name] for name in ("fps", *CLOCK_NAMES) if name in beside}
    for name in CLOCK_NAMES:
        told = [frame.get(name) if isinstance(frame, dict) else None for frame in frames]
        if any(value is not None for value in told):
            stamps[name] = told
    return Record(where, stamps, "correct it, or leave it out")


def read_results(value: Any, where: str, side: Side | None) -> tuple[Tracks, Notes]:
    """The hands in MediaPipe's results, and what was assumed of their sides; see `as_one_hand`."""
    frames, most, alike = frames_in(value), 0, 0
    found: Tracks = {}
    latest: dict[Side | None, Array] = {}
    for index, frame in enumerate(frames):
        if not frame:
            continue
        record = as_record(frame, f"{where}: frame {index}")
        hands = hands_in(record, side)
        most = max(most, len(hands))
        if len(hands) == 2 and hands[0].side == hands[1].side and hands[0].side is not None:
            hands, alike = told_apart(hands, latest), alike + 1
        for hand in hands:
            track = found.setdefault(hand.side, empty_track(len(frames)))
            if hand.score > track.trust[index]:
                track.points[index], track.trust[index] = hand.points, hand.score
                latest[hand.side] = hand.points
    if most == 1:
        return as_one_hand(found, side)
    note = f"in {numbered(alike, 'frame')} both hands have one side: told apart by those before"
    return found, (note,) if alike else ()


@dataclass(frozen=True)
class Detected:
    """One hand of a frame: (21, 3) points, its side, and how sure MediaPipe is of that."""

    side: Side | None
    score: float
    points: Array


def hands_in(record: Record, side: Side | None) -> list[Detected]:
    """The hands of one result; `side` is that of one that tells none."""
    world, sides = field_of(record, WORLD), field_of(record, HANDEDNESS)
    found = []
    for number, points in enumerate(world):
        label, score = label_of(sides[number] if number < len(sides) else None)
        found.append(Detected(label or side, score, points_in(points, record.where)))
    for known, names in OF_SIDE.items():
        if points := field_of(record, names):
            points = points[0] if isinstance(points[0], list) else points
            found.append(Detected(known, 1.0, points_in(points, record.where)))
    image = (*IMAGE, *(f"{side}_hand_landmarks" for side in SIDES))
    if not found and field_of(record, image):
        raise image_landmarks(record.where)
    return found


def told_apart(hands: list[Detected], latest: Mapping[Side | None, Array]) -> list[Detected]:
    """Two hands of a frame that have one side, with a side each.

    By which they are more like the latest hands of both sides, else the surer one keeps its own.
    """
    named = hands[0].side
    assert named is not None, "hands without a side are not told apart"
    ways = [
        [replace(hand, side=side) for hand, side in zip(hands, sides, strict=True)]
        for sides in ((named, OTHER_SIDE[named]), (OTHER_SIDE[named], named))
    ]
    if len(latest) < 2:
        return ways[hands[1].score > hands[0].score]
    return min(
        ways,
        key=lambda way: sum(float(np.abs(each.points - latest[each.side]).sum()) for each in way),
    )


def as_one_hand(tracks: Tracks, side: Side | None) -> tuple[Tracks, Notes]:
    """One hand where no frame has two, and a note where frames say other sides.

    It is the caller's side, else the one that most frames say: the side of a single frame is a
    guess of MediaPipe's, and no second hand comes when the first one goes.
    """
    seen = {label: track.trust > 0 for label, track in tracks.items()}
    if len(tracks) < 2 or np.sum(list(seen.values()), axis=0).max() > 1:
        return tracks, ()
    counts: dict[Side, int] = {
        label: int(seen[label].sum()) for label in tracks if label is not None
    }
    named: Side = side or max(counts, key=counts.__getitem__)
    whole = empty_track(len(next(iter(seen.values()))))
    for label, track in tracks.items():
        whole.points[seen[label]] = track.points[seen[label]]
        whole.trust[seen[label]] = track.trust[seen[label]]
    wrong = sum(count for label, count in counts.items() if label != named)
    note = (
        f"no frame has two hands, so that they are one {named} hand, though {wrong} of "
        f"{int((whole.trust > 0).sum())} frames name the other side; --side says otherwise"
    )
    one: Tracks = {named: whole}
    return one, (note,) if wrong else ()


def field_of(record: Record, names: Iterable[str]) -> list[Any]:
    """The list under the first of some names that a result has; empty without."""
    name = next((name for name in names if record.values.get(name) is not None), None)
    return [] if name is None else record.items(name)


def empty_track(frames: int) -> Track:
    """A hand that was not seen."""
    return Track(np.full((frames, 21, 3), np.nan), np.zeros(frames))


def points_in(value: Any, where: str) -> Array:
    """(21, 3) landmarks of one hand: a list of points, which may stand under "landmark"."""
    value = value.get("landmark") if isinstance(value, dict) else value
    listed = value if isinstance(value, list) else []
    rows = [[p.get(axis) for axis in "xyz"] if isinstance(p, dict) else p for p in listed]
    record = Record(where, {"landmarks": rows}, "save the results as MediaPipe gives them")
    return record.array("landmarks", (21, 3))


def label_of(value: Any) -> tuple[Side | None, float]:
    """The side that a result names, and how sure it is of that, above 0 and at most 1."""
    if isinstance(value, dict) and "classification" in value:
        value = value["classification"]
    while isinstance(value, list) and value:
        value = value[0]
    named = value if isinstance(value, Mapping) else {}
    text = str(next((named[name] for name in LABELS if named.get(name)), value)).lower()
    score = named.get("score")
    sure = score if isinstance(score, float | int) and 0 < score <= 1 else 1.0
    return next((side for side in SIDES if side == text), None), float(sure)


def read_points(path: Path, side: Side | None) -> tuple[Tracks, Notes, Record, int]:
    """The hands in a table of points, by the side that a column says; see `as_one_hand`.

    And the times of the frames, and the number of the first one.
    """
    try:
        with open_text(path, JSON_LIMIT) as file:
            heading = file.readline()
            separator = max(",;\t", key=heading.count)
            table = csv.DictReader(chain([heading], file), delimiter=separator)
            table.fieldnames = [str(name).strip().lower() for name in table.fieldnames or ()]
            columns = point_columns(table.fieldnames, path)
            rows = [with_points(row, separator, path) for row in table]
    except csv.Error as error:
        raise InputError(f"{path}: expected a table ({error}); export it again") from None
    cells = list(cells_of(rows, columns, side, path))
    frames = [frame for _, frame, _, _, _ in cells]
    first, last = min(frames, default=0), max(frames, default=0)
    if not cells or last - first >= FRAME_LIMIT:
        raise InputError(f"{path}: expected rows of 1 to {FRAME_LIMIT} frames; correct the table")
    found: Tracks = {}
    for label, frame, point, axis, number in cells:
        track = found.setdefault(label, empty_track(last - first + 1))
        if np.isfinite(track.points[frame - first, point, axis]):
            raise InputError(
                f"{path}: expected one hand a side in each frame, got landmark {point} twice in "
                f"frame {frame - first + 1} of the table; add the column 'hand', or correct it"
            )
        track.points[frame - first, point, axis] = number
        track.trust[frame - first] = 1.0
    for track in found.values():
        refuse_image_landmarks(track.points, str(path))
    return *as_one_hand(found, side), times_in(rows, path), first


def with_points(row: Row, separator: str, path: Path) -> Row:
    """A row with decimal points for decimal commas, where commas do not separate cells."""
    if any(cells := row.pop(None, ())):
        raise InputError(
            f"{path}: expected rows as long as the heading, got one with "
            f"{numbered(len(cells), 'cell')} more; where decimals have commas, separate cells by "
            "semicolons"
        )
    if separator == ",":
        return row
    return {name: cell.replace(",", ".") if cell else cell for name, cell in row.items()}


def times_in(rows: list[Row], path: Path) -> Record:
    """The times of a table's frames, between others of one without a row; empty without times."""
    name = column_of(rows, TIME_NAMES)
    times = [] if name is None else [number_in(row[name] or "") for row in rows]
    if name is None or not np.isfinite(times).all():
        return Record(str(path), {})
    told = dict(zip(frames_of(rows), times, strict=True))
    frames = sorted(told)
    every = np.arange(int(frames[0]), int(frames[-1]) + 1)
    times = np.interp(every, frames, [told[frame] for frame in frames])
    return Record(str(path), {name: times}, "correct the table")


def column_of(rows: list[Row], names: Iterable[str]) -> str | None:
    """The first of some names that a table has as a column."""
    return next((name for name in names if rows and name in rows[0]), None)


def frames_of(rows: list[Row]) -> list[float]:
    """The frame of each row: by its number, else by its time, else one for each row."""
    if name := column_of(rows, FRAME_COLUMNS):
        return [number_in(row[name] or "") for row in rows]
    if name := column_of(rows, TIME_NAMES):
        times = np.array([number_in(row[name] or "") for row in rows])
        places = np.unique(times, return_inverse=True)[1].astype(float)
        return np.where(np.isfinite(times), places, np.nan).tolist()
    return np.arange(float(len(rows))).tolist()


def point_columns(names: Iterable[str], path: Path) -> dict[str, tuple[int | None, int]]:
    """Point and axis of each column of coordinates; the point is None where a row is a point."""
    names = list(names)
    if {"x", "y", "z"} <= set(names) and set(names) & set(POINT_COLUMNS):
        return {axis: (None, "xyz".index(axis)) for axis in "xyz"}
    found: dict[str, tuple[int | None, int]] = {}
    for name in names:
        swapped, plain = AXIS_AND_POINT.fullmatch(name), POINT_AND_AXIS.fullmatch(name)
        point, axis = swapped.group(2, 1) if swapped else plain.groups() if plain else ("", "x")
        number = point_number(point)
        if number is not None:
            found[name] = (number, "xyz".index(axis))
    if len(set(found.values())) != 63:
        raise InputError(
            f"{path}: expected a table of landmarks: the columns x0, y0, z0 to z20 or WRIST_x to "
            "PINKY_TIP_z with a row a frame, or frame, landmark, x, y, z with a row a landmark, "
            f"got {', '.join(names)[:200] or 'no columns'}; rename them"
        )
    return found


def point_number(text: str) -> int | None:
    """The number of a landmark that is given by it or by MediaPipe's name; None for neither."""
    name = text.strip().upper().rpartition(".")[2]
    if name in NAMES:
        return NAMES.index(name)
    number = number_in(text)
    return int(number) if number in range(21) else None


def cells_of(
    rows: list[Row],
    columns: dict[str, tuple[int | None, int]],
    side: Side | None,
    path: Path,
) -> Iterable[tuple[Side | None, int, int, int, float]]:
    """Side, frame, point, axis and number of every coordinate in a table."""
    long = next(iter(columns.values()))[0] is None
    timed = column_of(rows, (*FRAME_COLUMNS, *TIME_NAMES)) is not None
    for line, (row, frame) in enumerate(zip(rows, frames_of(rows), strict=True)):
        named = next((row[name] for name in POINT_COLUMNS if name in row), None) or ""
        told_side: Side | None = next(
            (label_of(row[name])[0] for name in SIDE_COLUMNS if name in row), None
        )
        for name, (fixed, axis) in columns.items():
            point = point_number(named) if fixed is None else fixed
            if point is None or not abs(frame) < 1e9 or (long and not timed):
                raise InputError(
                    f"{path}: line {line + 2} must have the number or the time of its frame as a "
                    f"number, and a landmark from 0 to 20 or by name, got {frame:g} and "
                    f"{named!r:.40}; correct it"
                )
            yield told_side or side, int(frame), point, axis, number_in(row[name] or "")


def refuse_image_landmarks(points: Array, where: str) -> None:
    """Refuse landmarks of the picture, which alone have a wrist of depth 0 off the centre."""
    wrist = points[np.isfinite(points).all((1, 2)), 0]
    flat = len(wrist) and np.abs(wrist[:, 2]).max() < NO_DEPTH
    if flat and np.abs(wrist[:, :2]).min() > NO_DEPTH and bool((wrist > -NO_DEPTH).all()):
        raise image_landmarks(where)


def image_landmarks(where: str) -> InputError:
    """The error for landmarks in shares of the picture."""
    return InputError(
        f"{where}: expected MediaPipe's world landmarks in metres, got landmarks of the picture, "
        "which have no size; save hand_world_landmarks (worldLandmarks) of the same results"
    )
