"""Journals: records that are on the disk, half lines, and the lock of a folder."""

import json
import subprocess
import sys

import pytest

from geneoh.errors import InputError
from geneoh.files.journal import (
    append_journal,
    begin_journal,
    is_journal,
    only_run_in,
    read_journal,
)
from geneoh.files.outputs import is_ours


def test_records_come_back_and_half_a_line_counts_for_nothing(tmp_path):
    path = tmp_path / "new" / "journal.jsonl"
    assert read_journal(path) == []
    begin_journal(path, [{"head": 1}])
    append_journal(path, [{"clip": "a"}, {"clip": "b"}])
    whole = path.read_bytes()
    assert read_journal(path) == [{"head": 1}, {"clip": "a"}, {"clip": "b"}]
    for cut in range(1, len(json.dumps({"clip": "b"})) + 1):
        path.write_bytes(whole[: -1 - cut])
        assert read_journal(path) == [{"head": 1}, {"clip": "a"}]


FIRST = [
    {"options": {}, "reading": {}, "weights": ""},
    {"settings": {}, "versions": {}},
    {"clip": "a", "asked": {}, "inputs": {}, "files": {}},
]
"""The first records of the journals of batch, eval and convert."""


@pytest.mark.parametrize("first", FIRST)
def test_a_journal_is_known_by_its_first_record_and_by_a_part_of_it(tmp_path, first):
    path = tmp_path / "journal.jsonl"
    begin_journal(path, [first, {"clip": "a"}])
    assert is_journal(path)
    assert is_ours(path)
    whole = json.dumps(first).encode()
    for cut in range(1, len(whole)):
        path.write_bytes(whole[:cut])
        assert is_journal(path)


@pytest.mark.parametrize(
    "text",
    ["my notes\n", "my notes", '{"day": 1}\n', '{"clip": "a"}\n', "[1]\n", '{"clip": \n', "\xff\n"],
)
def test_what_others_wrote_is_no_journal(tmp_path, text):
    (tmp_path / "journal.jsonl").write_bytes(text.encode("latin-1"))
    assert not is_journal(tmp_path / "journal.jsonl")
    assert not is_journal(tmp_path)


def test_a_journal_can_be_read_by_programs_that_know_no_nan(tmp_path):
    path = tmp_path / "journal.jsonl"
    begin_journal(path, [{"loss": float("nan")}])
    append_journal(path, [{"before": {"depth": float("inf")}}])
    assert "NaN" not in path.read_text()
    assert read_journal(path) == [{"loss": None}, {"before": {"depth": None}}]


def test_what_is_no_record_is_dropped(tmp_path):
    path = tmp_path / "journal.jsonl"
    path.write_bytes(b'{"head": 1}\n7\n\xff\xfe\n{"clip": "a"}\n')
    assert read_journal(path) == [{"head": 1}, {"clip": "a"}]


def test_a_journal_that_cannot_be_written_is_told(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        begin_journal(tmp_path / "taken" / "journal.jsonl", [])
    with pytest.raises(InputError, match="cannot be written"):
        append_journal(tmp_path, [{}])


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such locks")
def test_a_second_run_is_kept_out_until_the_first_one_ends_or_dies(tmp_path):
    refused = pytest.raises(InputError, match="out: another run is working in it")
    with only_run_in(tmp_path / "out"), refused, only_run_in(tmp_path / "out"):
        pass
    code = "import sys, pathlib, time, geneoh.files.journal as j\n"
    code += "with j.only_run_in(pathlib.Path(sys.argv[1])): print('in', flush=True); time.sleep(60)"
    other = subprocess.Popen(
        [sys.executable, "-c", code, tmp_path / "out"], stdout=subprocess.PIPE, text=True
    )
    with other:
        assert other.stdout is not None
        assert other.stdout.readline() == "in\n"
        with refused, only_run_in(tmp_path / "out"):
            pass
        other.kill()
    assert list((tmp_path / "out").iterdir()) != []
    with only_run_in(tmp_path / "out"):
        pass
    assert list((tmp_path / "out").iterdir()) == []


def test_folders_that_a_run_made_and_left_empty_are_removed(tmp_path):
    (tmp_path / "kept").mkdir()
    for folder in ("made/within", "kept"):
        with only_run_in(tmp_path / folder):
            pass
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
    with only_run_in(tmp_path / "made"):
        (tmp_path / "made/result").touch()
    assert (tmp_path / "made/result").exists()
