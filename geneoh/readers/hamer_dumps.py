"""Detections of HaMeR and WiLoR, in the forms in which their users save them.

A batch of detections is a dict of the fields that `geneoh.readers.sources.hamer` names. A dump is
one batch, a list of batches, or a dict of batches by image. Dumps of WiLoR-mini have the fields
under 'wilor_preds'.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped

from geneoh.bundle import Bundle, concatenated
from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.readers import transforms
from geneoh.readers.clock import FRAME_NAMES
from geneoh.readers.column_names import IMAGE_NAMES, image_numbers
from geneoh.readers.foreign_files import read_json
from geneoh.readers.records import FRAME_LIMIT, Array, Notes, Record, described

ENDINGS = (".pkl", ".pickle", ".npz", ".pt", ".pth", ".npy", ".json")
DEMO_FOCAL = 5000.0 / 256.0
"""Focal length that the demos assume, in multiples of the longer side of the image."""
AS_DUMPED = "dump the estimator's output as the page on estimators shows"
ORDER_NOTE = "no 'frame': each row is taken for the image after that of the row before"
LIST_NOTE = (
    "no 'frame' and no names of images whose numbers mostly rise by 1: each entry is taken for the "
    "image after that of the entry before; where images without hands were left out, list {} for "
    "them"
)
PARAMETERS = ("global_orient", "hand_pose", "betas")
MARKS = ("pred_mano_params", "wilor_preds", "hand_bbox", *PARAMETERS[:2])
"""Fields that identify a batch, which has at least one of them."""
MOST_PEOPLE = 10
"""Largest number of hands per image that file names may number."""

Batch = tuple[int | None, Record]
"""The frame number, or None where it is unknown, and the detections."""


@dataclass(frozen=True, eq=False)
class Detections(Bundle):
    """N detections; left hands are as estimated from a mirrored image, or mirrored back already."""

    frame: Shaped[Array, " N"]
    """Number of the image."""
    right: Shaped[Array, " N"]
    """Whether it is a right hand."""
    turns: Shaped[Array, "N 16 3 3"]
    """Rotations of the wrist and the fingers' joints."""
    betas: Shaped[Array, "N 10"]
    points: Shaped[Array, "N 21 3"]
    """Keypoints relative to the hand's own origin, metres."""
    place: Shaped[Array, "N 3"]
    """Position of that origin in the frame of the whole image's camera, metres."""
    crop: Shaped[Array, "N 3"]
    """Scale and shifts of the crop's camera that `place` was computed from; NaN if unknown."""


def dumps(found: Iterable[Path], path: Path) -> list[Path]:
    """Every file that holds several frames, and every folder with one file per frame."""
    chosen: list[Path] = []
    for folder, files in groupby(sorted(found, key=lambda p: (p.parent, p)), lambda p: p.parent):
        members = list(files)
        alone = [member for member in members if member.suffix != ".json"]
        chosen += [folder] if any(len(each) > 1 for each in named_alike(members)) else alone
    return chosen


def named_alike(files: Iterable[Path]) -> list[list[Path]]:
    """The files with a number in their names, grouped by names that differ in numbers only."""
    alike: dict[str, list[Path]] = {}
    for file in files:
        if (name := re.sub(r"\d+", "#", file.name)) != file.name:
            alike.setdefault(name, []).append(file)
    return list(alike.values())


def frames_of_names(names: list[str], where: Path) -> list[int]:
    """The frame number in each name; names differ in it alone, or also in the number of a hand."""
    numbers = [[*map(int, re.findall(r"\d+", name))] for name in names]
    alike = len({len(each) for each in numbers}) == 1
    differing = [c for c in zip(*numbers, strict=True) if len(set(c)) > 1] if alike else []
    if len(differing) == 2 and len(set(differing[1])) <= min(len(set(differing[0])), MOST_PEOPLE):
        differing = differing[:1]
    if len(differing) != 1 or max(differing[0]) > FRAME_LIMIT:
        raise InputError(
            f"{where}: expected names that differ in one number, 0 to {FRAME_LIMIT}, that of the "
            f"image, got {names[0]} to {names[-1]}; rename the files, or give those of each "
            "recording a folder of their own"
        )
    return list(differing[0])


def read_detections(path: Path, focal: float | None) -> tuple[Detections, Notes]:
    """All detections of a file or a folder, and notes on what was assumed."""
    found, notes = [], []
    batches = batches_of_file(path, notes) if path.is_file() else batches_of_folder(path, notes)
    for number, record in batches:
        if _is_empty(record):
            continue
        made = read_batch(record, focal, number)
        if number is None and frame_field(record) is None and len(made.right) > 1:
            if len(np.unique(made.right)) > 1:
                expected = "the number of each row's image, where a file has hands of both sides"
                raise record.refuse("frame", expected, "dump it too, or each hand to its own file")
            notes = [ORDER_NOTE]
        found.append(made)
    if not found:
        raise InputError(f"{path}: expected detections, got none; check the dump")
    whole = concatenated(found, "N")
    if len(np.unique(whole.frame)) <= np.ptp(whole.frame):  # some images are without hands
        notes = [note for note in notes if note != LIST_NOTE]
    return whole, (*notes,)


def batches_of_file(path: Path, notes: list[str]) -> Iterator[Batch]:
    """The batches of a file: a single one, or those of the images in a list or a dict."""
    value = value_in(path)
    if is_batch(value):
        yield None, Record(str(path), value, AS_DUMPED)
    elif isinstance(value, Mapping) and all(re.search(r"\d", str(name)) for name in value):
        names = [str(name) for name in value]
        numbers = frames_of_names(names, path) if len(names) > 1 else [0] * len(names)
        for frame, (name, image) in zip(numbers, value.items(), strict=True):
            yield from batches_of_image(image, f"{path} '{name}'", frame)
    elif isinstance(value, list | tuple):
        numbers = numbers_of_images(value)
        fields = {name for image in value if is_batch(image) for name in image}
        if isinstance(numbers, range) and len(numbers) > 1 and fields.isdisjoint(FRAME_NAMES):
            notes.append(LIST_NOTE)
        for frame, image in zip(numbers, value, strict=True):
            yield from batches_of_image(image, f"{path}, image {frame}", frame)
    else:
        raise no_batch(value, str(path))


def numbers_of_images(images: Sequence[Any]) -> Sequence[int]:
    """The frame number of each entry of a list of images: by the names of the images, if all have
    one, else its place in the list."""
    for field in IMAGE_NAMES:
        names = [
            each[field] for each in images if is_batch(each) and isinstance(each.get(field), str)
        ]
        if len(names) == len(images) and (numbers := image_numbers(names)):
            return numbers
    return range(len(images))


def batches_of_folder(folder: Path, notes: list[str]) -> Iterator[Batch]:
    """The batches of a folder with a file per image, whose names differ in numbers only."""
    files = sorted(each for each in folder.iterdir() if each.suffix in ENDINGS)
    several = [alike for alike in named_alike(files) if len(alike) > 1]
    if len(several) != 1:
        raise InputError(
            f"{folder}: expected files of one recording, named alike but for the image's number, "
            f"got {len(several)} sets of such; give each a folder of its own"
        )
    (alike,) = several
    if others := [file.name for file in files if file not in alike]:
        notes.append(f"not read: {', '.join(others[:4])}{', ...' * (len(others) > 4)}")
    numbers = frames_of_names([file.stem for file in alike], folder)
    for frame, file in zip(numbers, alike, strict=True):
        yield from batches_of_image(value_in(file), str(file), frame)


def value_in(file: Path) -> Any:
    """The contents of a file; an array of objects becomes a list."""
    value = read_json(file) if file.suffix.lower() == ".json" else read_values(file)
    return value.tolist() if isinstance(value, np.ndarray) and value.ndim else value


def batches_of_image(value: Any, where: str, frame: int) -> Iterator[Batch]:
    """The batches of one image: one, or a list of them; None, [] and {} hold none."""
    if value is None or (isinstance(value, Mapping) and not value):
        return
    for each in value if isinstance(value, list | tuple) else (value,):
        if not is_batch(each):
            raise no_batch(each, where)
        yield frame, Record(where, each, AS_DUMPED)


def is_batch(value: Any) -> bool:
    """Whether a value is detections of hands."""
    return isinstance(value, Mapping) and any(mark in value for mark in MARKS)


def no_batch(value: Any, where: str) -> InputError:
    """The error for a value that is no detections."""
    return InputError(
        f"{where}: expected detections as a dict with 'pred_mano_params', got {described(value)}; "
        + AS_DUMPED
    )


def side_field(record: Record) -> str:
    """Name of the field that marks the right hands among the detections."""
    return "is_right" if "is_right" in record and "right" not in record else "right"


def frame_field(record: Record) -> str | None:
    """Name of the field that numbers the images, if there is one."""
    return next((name for name in FRAME_NAMES if name in record), None)


def _is_empty(record: Record) -> bool:
    """Whether a batch holds no detection, as for an image without a hand."""
    names = (side_field(record), "pred_keypoints_3d")
    return all(name in record and not record.numbers(name).size for name in names)


def read_batch(record: Record, focal: float | None, number: int | None) -> Detections:
    """The detections of a batch; `number` is their frame number if there is no field 'frame'."""
    side = side_field(record)
    right = record.array(side, ("B",), ("B", 1), ()).reshape(-1)
    if ((right < 0) | (right > 1)).any():
        raise record.refuse(side, "1 for a right hand and 0 for a left one in each row")
    if "wilor_preds" in record:
        inner = record.record("wilor_preds")
        record = Record(inner.where, {**record.values, **inner.values}, AS_DUMPED)
    named = "pred_mano_params" in record or not any(name in record for name in PARAMETERS)
    params = record.record("pred_mano_params") if named else record
    turns = [_turns_of(params, "global_orient", 1), _turns_of(params, "hand_pose", 15)]
    params.refuse_lengths("global_orient", "hand_pose")
    place, crop = _place_of(record, right, focal)
    frame = frames_of_rows(record, len(right), number)
    betas = params.array("betas", ("B", 10))
    points = record.array("pred_keypoints_3d", ("B", 21, 3))
    made = (frame, right > 0.5, np.concatenate(turns, axis=1), betas, points, place, crop)
    if len({len(rows) for rows in made}) > 1:
        raise record.refuse("pred_mano_params", "one row for each detection")
    return Detections(*made)


def _turns_of(params: Record, name: str, count: int) -> Array:
    """(B, count, 3, 3) rotations of a field: matrices, or the axis-angle vectors of WiLoR-mini."""
    values = params.array(name, ("B", count, 3, 3), ("B", count, 3), ("B", 3 * count))
    if values.ndim == 4:
        transforms.refuse_other_matrices(params, name, values)
        return values
    return transforms.rotation_matrices(values.reshape(-1, count, 3))


def frames_of_rows(record: Record, count: int, number: int | None) -> Array:
    """(B,) the frame number of each row."""
    frames = [*range(count)] if number is None else [number] * count
    if name := frame_field(record):
        frames = record.integers(name)
    if len(frames) != count or min(frames) < 0 or max(frames) > FRAME_LIMIT:
        wanted = f"a frame's number, 0 to {FRAME_LIMIT}, for each of {count} detections"
        raise record.refuse(name or "frame", wanted)
    return np.array(frames)


def _place_of(record: Record, right: Array, focal: float | None) -> tuple[Array, Array]:
    """(B, 3) translation in the frame of the whole image's camera, and (B, 3) the crop's camera.

    The translation is the demos' `pred_cam_t_full`, or computed as in their cam_crop_to_full with
    the caller's focal length in pixels, if there is one.
    """
    if "pred_cam_t_full" in record:
        place = record.array("pred_cam_t_full", ("B", 3)).copy()
        if focal is not None:  # only the depth depends on it
            place[:, 2] *= focal / focal_of_demo(record)
        return place, np.full(place.shape, np.nan)
    for name in ("pred_cam", "box_center", "box_size", "img_size"):
        if name not in record:
            raise record.refuse(name, "dumped as well: a crop's own camera says no place")
    camera = record.side_by_side(pred_cam=3, box_center=2, box_size=1, img_size=2)
    if len(camera) != len(right):
        raise record.refuse("pred_cam", "one row for each detection")
    if (camera[:, 0] <= 0).any():
        raise record.refuse("pred_cam", "a positive scale and two shifts in each row")
    cam, centre, size, image = camera[:, :3], camera[:, 3:5], camera[:, 5], camera[:, 6:]
    length = DEMO_FOCAL * image.max(1) if focal is None else focal
    spread = size * cam[:, 0] + 1e-9  # as HaMeR has it, against a division by zero
    shift = 2 * (centre - image / 2) / spread[:, None]
    # The demos flip a sign of pred_cam in place; pred_cam_t keeps the network's output.
    own = record.side_by_side(pred_cam_t=3) if "pred_cam_t" in record else cam[:, 1:]
    if len(own) != len(right):
        raise record.refuse("pred_cam_t", "one row for each detection")
    across = own[:, 0] * (2 * right - 1)
    place = np.stack([across + shift[:, 0], cam[:, 2] + shift[:, 1], 2 * length / spread], axis=1)
    return place, np.full(cam.shape, np.nan) if "pred_cam_t" in record else cam


def focal_of_demo(record: Record) -> Array | float:
    """The focal length in pixels from which the demo computed `pred_cam_t_full`."""
    if "scaled_focal_length" not in record and "img_size" in record:
        return DEMO_FOCAL * record.array("img_size", ("B", 2)).max(1)
    focal_length = record.array("scaled_focal_length", ("B",), ("B", 1), ()).reshape(-1)
    if not (np.isfinite(focal_length) & (focal_length > 0)).all():
        raise record.refuse("scaled_focal_length", "positive finite numbers")
    return focal_length
