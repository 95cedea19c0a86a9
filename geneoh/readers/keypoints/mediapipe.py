"""MediaPipe's hand landmarks as programs dump its results in JSON.

Results of the Hand Landmarker and of the older Hands, from Python or JavaScript, one per frame in a
list, optionally with frame numbers, timestamps, or both (`geneoh.readers.clock`). Tables of
landmarks are read in `geneoh.readers.keypoints.tables`.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, pairwise, zip_longest
from operator import itemgetter
from statistics import median
from typing import Any

import numpy as np

from geneoh.choices import OTHER_SIDE, SIDES, Side, Unit
from geneoh.errors import InputError, numbered
from geneoh.readers.checks.hands import of_picture
from geneoh.readers.clock import CLOCK_NAMES, rate_fields
from geneoh.readers.column_names import IMAGE_NAMES, image_numbers, side_in, words_of
from geneoh.readers.foreign_files import number_in
from geneoh.readers.records import Array, Notes, Record, as_record

WORLD = ("hand_world_landmarks", "worldLandmarks", "multi_hand_world_landmarks")
WORLD += ("multiHandWorldLandmarks", "world_landmarks")
IMAGE = ("hand_landmarks", "landmarks", "multi_hand_landmarks", "multiHandLandmarks")
SIDE_FIELDS = ("handedness", "handednesses", "multi_handedness", "multiHandedness")
LISTS = ("frames", "results", "instance_info")
"""Names under which a file may list its results; the last one is MMPose's."""
NUMBERED = re.compile(r"(\d{1,18})|.*?(\d{4,18})(\.\w+)?")
"""Keys of frames: numbers, or names of numbered images."""
OF_SIDE: dict[Side, tuple[str, str]] = {
    side: (f"{side}_hand_world_landmarks", f"{side}HandWorldLandmarks") for side in SIDES
}
"""Fields of the Holistic Landmarker, which tells the hands apart by the body."""
LABELS = ("category_name", "categoryName", "label", "display_name", "displayName")

FEWEST_IN_TURN = 10
"""Entries that name left and right in turn from which they are two hands, and not one whose side a
detector guesses anew each time."""
IN_TURN = "left and right in turn, without frame numbers: each two entries are taken for one frame"
LARGEST_FRAME_STEP = 10
"""Median step beyond which numbers are timestamps: results so many frames apart show no motion."""

NOTES = (
    "MediaPipe's world landmarks are metres about the centre of each hand: the way of the hand "
    "through the world is not in them, and the object's poses must be about that centre too; "
    "--from landmarks with --focal and --image-size places them before the camera",
    "MediaPipe's older Hands name sides as in a mirrored picture; --side says otherwise",
)


def nowhere() -> Array:
    """(21, 3) points that are not known."""
    return np.full((21, 3), np.nan)


@dataclass(frozen=True)
class LandmarkTrack:
    """One hand of a file."""

    points: Array
    """(T, 21, 3), NaN where it was not seen."""
    trust: Array
    """(T,) confidence from 0 to 1, or (T, 21) of each point."""
    image: Array = field(default_factory=nowhere)
    """(T, 21, 3) landmarks of the picture, or (21, 3) if there are none; see `Detected`."""

    @property
    def confidence(self) -> Array:
        """(T, 21) confidence of each point."""
        return self.trust if self.trust.ndim == 2 else np.tile(self.trust[:, None], 21)


Tracks = dict[Side | None, LandmarkTrack]
"""The hands of a file by side; None for a hand whose side the file does not name."""


@dataclass(frozen=True)
class Landmarks:
    """The contents of a file of landmarks."""

    tracks: Tracks
    notes: Notes
    stamps: Record
    """Fields of timestamps and frame numbers; see `geneoh.readers.clock`."""
    first: int = 0
    """Number that the file gives its first frame."""
    camera: Array | None = None
    """(3,) position of the camera, if the file states it."""
    unit: Unit = "m"
    """Unit of the points, if the caller names none."""


def read_results(
    value: Any, where: str, side: Side | None, *, in_picture: bool = False
) -> Landmarks | None:
    """The hands in the value of a JSON file; None if it is no result of MediaPipe.

    A hand with landmarks of the picture alone is refused unless `in_picture`, which makes its
    points NaN.
    """
    frames = frames_in(value)
    results = [frame for frame in frames if isinstance(frame, dict)]
    names = {*WORLD, *IMAGE, *chain(*OF_SIDE.values())}
    if any(map(is_one_hand, results)) or not any(names & frame.keys() for frame in results):
        return None
    hands_of = partial(hands_in, side=side, in_picture=in_picture)
    tracks, notes = tracks_in(frames, where, side, hands_of)
    return Landmarks(tracks, (*NOTES, *notes), stamps_in(value, frames, where))


def is_one_hand(frame: dict[str, Any]) -> bool:
    """Whether a frame has the points of a hand where a result of MediaPipe lists its hands."""
    listed = (frame.get(name) for name in (*WORLD, *IMAGE))
    first = [each[0] if isinstance(each, list) and each else each for each in listed]
    points = [each for each in first if isinstance(each, dict) and "landmark" not in each]
    numbers = [each[0] if isinstance(each, list) and each else each for each in first]
    return bool(points) or any(isinstance(each, int | float) for each in numbers)


def frames_in(value: Any) -> list[Any]:
    """The results in a JSON value, one per frame: in a list, or a dict by frame number or time.

    Times are whole milliseconds or smaller units. A result may be nested in "result".
    """
    fields = value if isinstance(value, dict) else {}
    inner = (fields[name] for name in LISTS if name in fields)
    value = next((each for each in inner if isinstance(each, list) or numbers_in(each)), value)
    if numbers := numbers_in(value):
        results = sorted(((n, value[name] or {}) for name, n in numbers.items()), key=itemgetter(0))
        steps = [after - before for (before, _), (after, _) in pairwise(results)]
        name = "timestamp" if steps and median(steps) > LARGEST_FRAME_STEP else "frame"
        value = [
            {name: n, **(result if isinstance(result, dict) else {"hands": result})}
            for n, result in results
        ]
    return [
        {**frame, **frame["result"]}
        if isinstance(frame, dict) and isinstance(frame.get("result"), dict)
        else frame
        for frame in (value if isinstance(value, list) else [value])
    ]


def numbers_in(value: Any) -> dict[str, int]:
    """The number in each key of a dict of frames; empty for anything else."""
    fields = value if isinstance(value, dict) else {}
    found = {name: NUMBERED.fullmatch(str(name)) for name in fields}
    numbers = {name: int(each[1] or each[2]) for name, each in found.items() if each}
    return numbers if len(numbers) == len(found) else {}


def fields_by_words(frame: Any) -> dict[str, Any]:
    """The fields of a frame by their words in lower case, which underscores join; of anything but a
    dict none."""
    fields = frame.items() if isinstance(frame, dict) else ()
    return {"_".join(words_of(str(name))): field for name, field in fields}


def stamps_in(value: Any, frames: list[Any], where: str) -> Record:
    """The fields of time in a JSON value, beside its results or in each of them."""
    beside = value if isinstance(value, dict) else {}
    listed = next((name for name in LISTS if name in beside), None)
    stamps = {
        n: beside[n] for n in (*rate_fields(beside), *CLOCK_NAMES) if n in beside and n != listed
    }
    named = list(map(fields_by_words, frames))
    for name in CLOCK_NAMES:
        if any(fields.get(name) is not None for fields in named):
            stamps[name] = [fields.get(name) for fields in named]
    images = next((name for name in IMAGE_NAMES if all(name in each for each in named)), None)
    if images and stamps.keys().isdisjoint(CLOCK_NAMES):
        numbers = image_numbers(fields[images] for fields in named)
        stamps |= {"frame": numbers} if numbers else {}
    stamps = {name: as_numbers(values) for name, values in stamps.items()}
    return Record(where, stamps, "correct it, or leave it out")


def are_in_turn(sides: list[Side | None]) -> bool:
    """Whether entries are the two hands of each frame by their sides, which are left and right in
    turn from the first to the last."""
    pairs = set(zip(sides[::2], sides[1::2], strict=False))
    whole = len(sides) >= FEWEST_IN_TURN and len(sides) % 2 == 0
    return whole and len(pairs) == 1 and set(*pairs) == set(SIDES)


def as_numbers(values: Any) -> Any:
    """A list whose texts are all numbers as numbers; others as they are."""
    listed = values if isinstance(values, list) else []
    found = [number_in(each) if isinstance(each, str) else each for each in listed]
    return values if not found or any(each != each for each in found) else found


def tracks_in(
    frames: list[Any],
    where: str,
    side: Side | None,
    hands_of: Callable[[Any, str], list["Detected"]],
) -> tuple[Tracks, Notes]:
    """The hands in results, and notes on their sides; see `as_one_hand`.

    `hands_of` returns the hands of a result; its second argument locates the result in messages.
    """
    most, alike, crowded = 0, 0, 0
    found: Tracks = {}
    latest: dict[Side | None, Array] = {}
    for index, frame in enumerate(frames):
        if not frame:
            continue
        hands = hands_of(frame, f"{where}: frame {index}")
        most = max(most, len(hands))
        if len(hands) == 2 and hands[0].side == hands[1].side and hands[0].side is not None:
            hands, alike = _on_both_sides(hands, latest), alike + 1
        crowded += len({hand.side for hand in hands}) < len(hands)
        for hand in hands:
            track = found.setdefault(hand.side, empty_track(len(frames)))
            if hand.score > track.trust[index]:
                track.points[index], track.trust[index] = hand.points, hand.score
                track.image[index] = hand.image
                latest[hand.side] = hand.points
    if most == 1:
        return as_one_hand(found, side)
    counts = (
        (alike, "both hands have one side: told apart by those before"),
        (crowded, "more hands than one of a side: the surest is kept"),
    )
    return found, tuple(f"in {numbered(n, 'frame')} {words}" for n, words in counts if n)


@dataclass(frozen=True)
class Detected:
    """One hand of a frame: (21, 3) points, its side, and the confidence of the side."""

    side: Side | None
    score: float
    points: Array
    image: Array = field(default_factory=nowhere)
    """(21, 3) landmarks of the picture: places in fractions of its width and its height, and depths
    in widths; NaN where there are none."""


def hands_in(
    frame: Any, where: str, side: Side | None, *, in_picture: bool = False
) -> list[Detected]:
    """The hands of one result of MediaPipe; `side` is for hands without one."""
    record = as_record(frame, where)
    sides, found = field_of(record, SIDE_FIELDS), []
    for number, points in enumerate(_points_of(record, WORLD, IMAGE, in_picture)):
        label, score = label_of(sides[number] if number < len(sides) else None)
        found.append(Detected(label or side, score, *points))
    for known, names in OF_SIDE.items():
        of_side = _points_of(record, names, image_names(names), in_picture)
        found += [Detected(known, 1.0, *points) for points in of_side]
    return found


def _points_of(
    record: Record, world: Iterable[str], image: Iterable[str], in_picture: bool
) -> list[tuple[Array, ...]]:
    """World landmarks, and those of the picture if `in_picture`, of each hand in some fields; NaN
    where there are none. `InputError` for hands in the picture alone otherwise."""
    ways = [field_of(record, names) for names in (world, image)]
    ways = [[way] if way and isinstance(way[0], dict) and "x" in way[0] else way for way in ways]
    if not in_picture:
        if ways[1] and not ways[0]:
            raise image_landmarks(record.where, ", or pass --focal and --image-size")
        ways[1] = []
    return [
        tuple(nowhere() if points is None else points_in(points, record.where) for points in hand)
        for hand in zip_longest(*ways)
    ]


def image_names(names: Iterable[str]) -> list[str]:
    """The names of fields of the picture's landmarks beside those of the world's."""
    return [name.replace("_world", "").replace("World", "") for name in names]


def _on_both_sides(hands: list[Detected], latest: Mapping[Side | None, Array]) -> list[Detected]:
    """Two hands of the same side, relabelled as left and right: by the distance to the latest hands
    if both are known, else the more confident one keeps its side."""
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
    """The tracks merged into one hand if no frame has two, and a note if frames differ in the side.

    The hand gets the caller's side, else that of most frames: MediaPipe guesses the side of each
    frame, and a second hand would not appear just when the first one disappears. Landmarks of the
    picture are kept only in frames of the more frequent side: in the others, which it takes for the
    mirror image of the hand, they are two to three times as far off.
    """
    seen = {label: track.trust > 0 for label, track in tracks.items()}
    if len(tracks) < 2 or np.sum(list(seen.values()), axis=0).max() > 1:
        return tracks, ()
    counts: dict[Side, int] = {label: int(seen[label].sum()) for label in tracks if label}
    frequent = max(counts, key=counts.__getitem__)
    named = side or frequent
    whole = empty_track(len(next(iter(seen.values()))))
    for label, track in tracks.items():
        whole.points[seen[label]] = track.points[seen[label]]
        whole.trust[seen[label]] = track.trust[seen[label]]
        if label in (frequent, None):
            whole.image[seen[label]] = track.image[seen[label]]
    wrong = sum(count for label, count in counts.items() if label != named)
    note = (
        f"no frame has two hands, so that they are one {named} hand, though {wrong} of "
        f"{int((whole.trust > 0).sum())} frames name the other side; --side says otherwise"
    )
    one: Tracks = {named: whole}
    return one, (note,) if wrong else ()


def field_of(record: Record, names: Iterable[str]) -> list[Any]:
    """The list in the first of some fields that a result has; empty if it has none."""
    name = next((name for name in names if record.values.get(name) is not None), None)
    return [] if name is None else record.items(name)


def empty_track(frames: int) -> LandmarkTrack:
    """A hand that was not seen."""
    points, image = np.full((2, frames, 21, 3), np.nan)
    return LandmarkTrack(points, np.zeros(frames), image)


def points_in(value: Any, where: str) -> Array:
    """(21, 3) landmarks of one hand: a list of points, which may stand under "landmark"."""
    value = value.get("landmark") if isinstance(value, dict) else value
    listed = value if isinstance(value, list) else []
    rows = [[p.get(axis) for axis in "xyz"] if isinstance(p, dict) else p for p in listed]
    record = Record(where, {"landmarks": rows}, "save the results as MediaPipe gives them")
    return record.array("landmarks", (21, 3))


def label_of(value: Any) -> tuple[Side | None, float]:
    """The side that a result names, and its confidence, above 0 and at most 1."""
    if isinstance(value, dict) and "classification" in value:
        value = value["classification"]
    while isinstance(value, list) and value:
        value = value[0]
    named = value if isinstance(value, Mapping) else {}
    text = str(next((named[name] for name in LABELS if named.get(name)), value))
    score = named.get("score")
    sure = score if isinstance(score, float | int) and 0 < score <= 1 else 1.0
    return side_in(words_of(text)), float(sure)


def refuse_image_landmarks(points: Array, where: str) -> None:
    """Refuse landmarks in image coordinates."""
    if of_picture(points):
        raise image_landmarks(where)


def image_landmarks(where: str, other_cure: str = "") -> InputError:
    """The error for landmarks in image coordinates, which are fractions of the image size."""
    return InputError(
        f"{where}: expected MediaPipe's world landmarks in metres, got landmarks of the picture, "
        "which have no size; save hand_world_landmarks (worldLandmarks, or keypoints3D of "
        f"TensorFlow.js) of the same results{other_cure}"
    )
