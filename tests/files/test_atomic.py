"""A file appears whole or not at all, and nothing is left beside it."""

import os
import signal
import subprocess
import sys
import time

import pytest

from geneoh.errors import InputError, MissingAssetError
from geneoh.files.atomic import STALE, in_one_step, write_whole

KILLED = """
import os, pathlib, signal, sys
from geneoh.files.atomic import in_one_step
with in_one_step(pathlib.Path(sys.argv[1])) as beside:
    beside.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def aged(path, seconds):
    os.utime(path, (time.time() - seconds,) * 2)


def test_what_a_killed_process_left_is_removed_by_the_next_write(tmp_path):
    path = tmp_path / "a.txt"
    ended = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert ended.returncode == -signal.SIGKILL
    (left,) = tmp_path.iterdir()
    aged(left, STALE + 60)
    write_whole(path, "whole")
    assert os.listdir(tmp_path) == ["a.txt"]
    assert path.read_text() == "whole"


def test_what_another_process_is_writing_is_left_alone(tmp_path):
    path = tmp_path / "a.txt"
    with in_one_step(path) as other:
        other.write_text("slow")
        write_whole(path, "quick")
        assert path.read_text() == "quick"
        assert other.read_text() == "slow"
    assert path.read_text() == "slow"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_files_of_others_are_left_alone(tmp_path):
    for name in (".b.txt.0.tmp", ".a.txt.swp", "a.txt.0.tmp"):
        (tmp_path / name).write_text("theirs")
        aged(tmp_path / name, 2 * STALE)
    write_whole(tmp_path / "a.txt", "ours")
    assert len(os.listdir(tmp_path)) == 4


def test_a_folder_appears_whole_or_not_at_all(tmp_path):
    def fill(*, fail):
        with in_one_step(tmp_path / "deep" / "made", folder=True, parents=True) as beside:
            (beside / "a.txt").write_text("a")
            assert not (tmp_path / "deep" / "made").exists()
            if fail:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fill(fail=True)
    assert os.listdir(tmp_path / "deep") == []
    fill(fail=False)
    assert os.listdir(tmp_path / "deep") == ["made"]
    assert (tmp_path / "deep" / "made" / "a.txt").read_text() == "a"


def test_an_error_that_says_what_to_do_is_not_taken_for_one_of_the_place(tmp_path):
    with pytest.raises(MissingAssetError, match="ffmpeg"), in_one_step(tmp_path / "a.mp4"):
        raise MissingAssetError("films need ffmpeg")
    assert os.listdir(tmp_path) == []


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere/a\.txt: cannot be written"):
        write_whole(tmp_path / "nowhere" / "a.txt", "a")


def test_the_name_beside_a_long_one_ends_with_a_whole_letter(tmp_path):
    path = tmp_path / ("a" + "é" * 120)
    with in_one_step(path) as beside:
        os.fsencode(beside.name).decode()
        beside.write_bytes(b"new")
    assert path.read_bytes() == b"new"


def test_text_with_a_file_name_that_is_not_utf_8_is_written(tmp_path):
    write_whole(tmp_path / "page.html", "title \udcff")
    assert (tmp_path / "page.html").read_text() == "title ?"
