"""Poses of one object as the BOP benchmark writes them: `scene_gt.json`, and results as a table.

Both map from the object's frame to the camera's, in millimetres, and number the images.
"""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import Unit
from geneoh.errors import InputError
from geneoh.readers.foreign_files import number_in
from geneoh.readers.records import Array, as_record

UNIT: Unit = "mm"
COLUMNS = {"scene_id", "im_id", "obj_id", "score", "R", "t"}
"""Columns of a table of results, `R` of nine and `t` of three numbers with spaces between them;
`time` may follow."""
FIELDS = ("frame", *(f"R[{at}]" for at in range(9)), "t.x", "t.y", "t.z")
"""Columns of the array from `rows_of_results`."""


def pose_of_image(value: Any, path: Path) -> Any:
    """The pose of the one object in an image of `scene_gt.json`, in `UNIT`, as `R` and `t`; any
    other value as it is."""
    objects = value if isinstance(value, list) else []
    if not any(isinstance(each, dict) and "cam_R_m2c" in each for each in objects):
        return value
    if len(objects) > 1:
        raise _several(path, f"{len(objects)} in an image")
    record = as_record(objects[0], str(path))
    place = record.array("cam_t_m2c", (3,)).tolist()
    return {"R": record.array("cam_R_m2c", (9,)).tolist(), "t": place}


def rows_of_results(lines: Iterable[str], path: Path) -> Array:
    """(N, 13) `FIELDS` of the poses in a table of results, in `UNIT`, sorted by image.

    Of several poses in an image the one with the highest score is taken.
    """
    rows = list(csv.DictReader(lines, restval="", skipinitialspace=True))
    found = {(row["scene_id"], row["obj_id"]) for row in rows}
    if len(found) != 1:
        raise _several(path, f"{len(found)} by 'scene_id' and 'obj_id'")
    best: dict[float, dict[str, str]] = {}
    for row in sorted(rows, key=lambda row: np.nan_to_num(number_in(row["score"]))):
        best[number_in(row["im_id"])] = row
    return np.array([_numbers(image, row, path) for image, row in sorted(best.items())])


def _numbers(image: float, row: dict[str, str], path: Path) -> list[float]:
    turn, place = ([number_in(cell) for cell in row[name].split()] for name in ("R", "t"))
    if (len(turn), len(place)) != (9, 3) or not np.isfinite(image):
        raise InputError(
            f"{path}: 'im_id', 'R' and 't' must be 1, 9 and 3 numbers with spaces between them, "
            f"got '{row['im_id']:.20}', {len(turn)} and {len(place)}; correct the table"
        )
    return [image, *turn, *place]


def _several(path: Path, got: str) -> InputError:
    return InputError(
        f"{path}: expected the poses of one object, got {got}; keep those of one 'obj_id'"
    )
