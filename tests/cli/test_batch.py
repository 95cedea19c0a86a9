"""`geneoh batch` as its users run it."""

import csv
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from importlib.metadata import entry_points
from urllib.parse import unquote, urlparse

import fake_cleaning
import pytest

from geneoh.batch import run

QUICK = ("--preset", "fast", "--samples", "1", "--steps", "1")


@pytest.fixture
def faked(monkeypatch):
    monkeypatch.setattr(run, "clean_clip", fake_cleaning.clean_clip)
    monkeypatch.setattr("geneoh.batch.cleaning.denoise", fake_cleaning.denoise)


@pytest.mark.slow
def test_each_result_has_the_bits_of_geneoh_denoise(geneoh, tmp_path):
    fake_cleaning.write_clips(tmp_path / "in", 2)
    result = geneoh("batch", "in", "-o", "out", "--jobs", "1", *QUICK)
    assert "2 clips done, 0 of them before, 0 failed; wrote out/summary.html" in result.output
    for name in ("clip0", "clip1"):
        alone = ("denoise", f"in/{name}.npz", "--obj", f"in/{name}.obj", "-o", f"out/{name}_.npz")
        geneoh(*alone, *QUICK)
        made = (tmp_path / "out" / f"{name}.npz").read_bytes()
        assert made == (tmp_path / "out" / f"{name}_.npz").read_bytes()


def test_what_failed_is_told_and_what_moved_most_is_first(geneoh, faked, tmp_path):
    fake_cleaning.write_clips(tmp_path / "in", 3)
    for number in range(6):
        (tmp_path / "in" / f"bad{number}.npz").write_bytes(b"no")
    result = geneoh("batch", "in", "-o", "out", "--jobs", "1", code=2)
    assert "bad0: failed, " in result.output
    assert "bad5: failed" not in result.output
    assert "and 1 more, see out/summary.csv" in result.output
    assert "3 clips done, 0 of them before, 6 failed" in result.output
    with (tmp_path / "out" / "summary.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["clip"] for row in rows[6:]] == ["clip2", "clip1", "clip0"]
    assert all(row["failed"] for row in rows[:6])
    assert float(rows[6]["penetration_mean_mm_after"]) == 0.5
    page = (tmp_path / "out" / "summary.html").read_text()
    assert page.index("clip2.npz") < page.index("clip0.npz")
    assert "a &lt;note&gt;" in page
    assert "3 clips cleaned (3 hands), 6 failed" in page


def test_results_of_any_name_are_linked(geneoh, faked, tmp_path):
    fake_cleaning.write_clips(tmp_path / "in", 1)
    for made in list((tmp_path / "in").iterdir()):
        made.rename(made.with_stem("take#2 50%25 a?"))
    geneoh("batch", "in", "-o", "out", "--jobs", "1")
    (link,) = re.findall('href="(.*?)"', (tmp_path / "out" / "summary.html").read_text())
    assert (tmp_path / "out" / unquote(urlparse(link).path)).is_file()


def test_a_manifest_may_ask_for_other_options_of_a_clip(geneoh, faked, tmp_path):
    fake_cleaning.write_clips(tmp_path / "in", 1)
    (tmp_path / "in" / "list.csv").write_text(
        "input,name,options\nclip0.npz,first,\nclip0.npz,second,seed=4\n"
    )
    geneoh("batch", "in/list.csv", "-o", "out", "--jobs", "1")
    first, second = ((tmp_path / "out" / f"{n}.npz").read_bytes() for n in ("first", "second"))
    assert first != second


def test_options_that_are_no_use_are_refused(geneoh, tmp_path):
    fake_cleaning.write_clips(tmp_path, 1)
    for given, words in (
        (("--focal", "500"), "--focal needs --from"),
        (("--device", "nothing"), "nothing"),
    ):
        result = geneoh("batch", "clip0.npz", "-o", "out", *given, code=2)
        assert words in result.output
    assert not list(tmp_path.glob("out/*.npz"))


def heeds_ctrl_c() -> None:
    """Undo what a shell does to what it starts in the background, such as these tests."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no such signal")
def test_ctrl_c_ends_the_workers_and_keeps_what_is_done(geneoh, tmp_path):
    fake_cleaning.write_clips(tmp_path / "in", 4)
    (script,) = entry_points(group="console_scripts", name="geneoh")
    code = f"from {script.module} import cli\nif __name__ == '__main__':\n    cli()\n"
    (tmp_path / "run.py").write_text(code)
    command = [sys.executable, "run.py", "batch", "in", "-o", "out", "--jobs", "2", *QUICK]
    with subprocess.Popen(
        command,
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heeds_ctrl_c,
    ) as process:
        end = time.monotonic() + 200
        while not list(tmp_path.glob("out/*.npz")):
            assert time.monotonic() < end
            time.sleep(0.02)
        os.kill(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=120)
    assert process.returncode == 130
    assert said.splitlines()[-1] == "Error: stopped; nothing half-written was left"
    assert "Traceback" not in said
    assert not list(tmp_path.glob("out/.*"))
    shutil.copytree(tmp_path / "out", tmp_path / "kept")
    geneoh("batch", "in", "-o", "out", "--jobs", "1", *QUICK)
    for path in (tmp_path / "kept").glob("*.npz"):
        assert (tmp_path / "out" / path.name).read_bytes() == path.read_bytes()
