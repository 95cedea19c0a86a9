"""Fields of foreign files: their shapes, and what must not fill the memory."""

import json
import re

import numpy as np
import pytest
import torch

from geneoh.errors import InputError
from geneoh.readers import foreign_files, records
from geneoh.readers.foreign_files import read_json, read_numbers, read_table, read_text
from geneoh.readers.records import Record


def doubled(depth: int) -> list:
    """A list of 2**depth numbers that takes the memory of `depth` lists."""
    value: list = [1.0]
    for _ in range(depth):
        value = [value, value]
    return value


def test_a_shape_fits_with_axes_of_one_dropped_or_added():
    record = Record("a.pkl", {"betas": np.arange(10.0)[None], "trans": np.zeros((4, 3))})
    assert record.array("betas", (10,)).shape == (10,)
    assert record.array("trans", ("T", 3)).shape == (4, 3)
    with pytest.raises(
        InputError, match=r"'trans' must be numbers of shape \(T, 4\), got \(4, 3\)"
    ):
        record.array("trans", ("T", 4))


def test_lists_of_another_shape_are_told_by_their_shape():
    record = Record("file", {"turn": [[0.0, 0.0, 0.0, 1.0]]})
    with pytest.raises(InputError, match=r"got \(1, 4\) of float64"):
        record.array("turn", ("T", 3, 3))


def test_lists_that_hold_each_other_are_refused_before_they_become_an_array():
    with pytest.raises(InputError, match="at most 134217728 numbers"):
        Record("a.pkl", {"pose": doubled(45)}).array("pose", ("T", 48))


def test_a_web_page_is_no_damaged_json(tmp_path):
    (tmp_path / "a.json").write_text("<html>")
    with pytest.raises(InputError, match="expected data, got a web page"):
        read_json(tmp_path / "a.json")


def test_a_number_in_text_is_to_be_written_as_one():
    with pytest.raises(InputError, match="got text '30'; write numbers and no text"):
        Record("a.npz", {"fps": np.array("30")}, "reshape it").number("fps")


def test_null_in_a_list_of_numbers_is_nan():
    record = Record("a.json", {"points": [[1, None], [2.5, True]], "big": [10**400, None]})
    np.testing.assert_array_equal(record.numbers("points"), [[1, np.nan], [2.5, 1]])
    rows = Record("a.json", {"rows": [None, [[1, 2], None]], "uneven": [[1, 2], None, [3]]})
    lost = [np.nan] * 2
    np.testing.assert_array_equal(rows.numbers("rows"), [[lost, lost], [[1, 2], lost]])
    arrays = Record("arrays", {"rows": [None, np.ones(2), torch.zeros(2)]})
    np.testing.assert_array_equal(arrays.numbers("rows"), [lost, [1, 1], [0, 0]])
    with pytest.raises(InputError, match="'uneven' must be an array of numbers"):
        rows.numbers("uneven")
    with pytest.raises(InputError, match="'big' must be an array of numbers"):
        record.numbers("big")


def test_bytes_that_would_grow_to_floats_are_refused(monkeypatch):
    monkeypatch.setattr(records, "NUMBERS_LIMIT", 1000)
    with pytest.raises(InputError, match="at most 1000 numbers"):
        Record("a.npz", {"contact": np.zeros(1001, np.int8)}).numbers("contact")


def test_more_frames_than_any_recording_has_are_refused():
    values = {"pose": np.zeros((records.FRAME_LIMIT + 1, 3), np.float32)}
    with pytest.raises(InputError, match="at most 300000 frames"):
        Record("a.npz", values).array("pose", ("T", 3))


@pytest.mark.parametrize("limit", ["JSON_LIMIT", "TEXT_LIMIT", "TABLE_LIMIT"])
def test_texts_that_grow_in_memory_have_limits_of_their_own(limit, tmp_path, monkeypatch):
    monkeypatch.setattr(foreign_files, limit, 100)
    path = tmp_path / "a.txt"
    path.write_text("1 2 3\n" * 100)
    read = {
        "JSON_LIMIT": lambda: read_json(path),
        "TEXT_LIMIT": lambda: read_text(path),
        "TABLE_LIMIT": lambda: read_table(path, re.compile("a")),
    }[limit]
    with pytest.raises(InputError, match="must have at most"):
        read()


def test_json_of_great_depth_is_refused(tmp_path):
    (tmp_path / "a.json").write_text("[" * 100_000)
    with pytest.raises(InputError, match="expected JSON"):
        read_json(tmp_path / "a.json")


def test_only_the_wanted_columns_of_a_table_are_read(tmp_path):
    (tmp_path / "a.csv").write_text("uid, t ,x\nabc,1,2\nabc,3,\n")
    record = read_table(tmp_path / "a.csv", re.compile("t|x"))
    assert list(record.values) == ["t", "x"]
    np.testing.assert_array_equal(record.numbers("t"), [1, 3])
    np.testing.assert_array_equal(record.numbers("x"), [2, np.nan])


def test_rows_of_other_lengths_are_refused(tmp_path):
    (tmp_path / "a.csv").write_text("t,x\n1,2\n3\n")
    with pytest.raises(InputError, match="rows as long as the heading"):
        read_table(tmp_path / "a.csv", re.compile("t|x"))
    (tmp_path / "a.txt").write_text("1 2 3\n4 5")
    with pytest.raises(InputError, match="rows of 3 numbers"):
        read_numbers(tmp_path / "a.txt", 3)


def test_a_field_that_is_missing_is_not_said_to_hold_objects():
    with pytest.raises(InputError, match="got none; save it"):
        Record("here", {}, "save it").numbers("joints")


def test_a_refusal_of_any_value_is_short():
    for value in (b"a" * 10**6, "a" * 10**6, doubled(45), np.zeros(3), 5, None, {"a": doubled(45)}):
        with pytest.raises(InputError) as refusal:
            Record("a.pkl", {"x": value}).record("y" if isinstance(value, dict) else "x")
        assert len(str(refusal.value)) < 300
    assert json.dumps(str(refusal.value))
