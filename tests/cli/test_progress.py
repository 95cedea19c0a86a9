import importlib
import sys

import pytest


@pytest.fixture
def progress(command):
    return importlib.import_module(".progress", type(command).__module__.rpartition(".")[0])


def test_long_work_shows_each_stage_and_short_work_nothing(progress, capsys, monkeypatch):
    def work():
        with progress.progress_bars() as heard:
            for stage in ("motion", "fit"):
                for done in range(4):
                    heard(stage, done, 3)

    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    work()
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    work()
    said = capsys.readouterr().err
    for stage in ("motion", "fit"):
        assert f"{stage}:   0%" in said
        assert said.count(f"{stage}:   0%") == 1


def test_a_log_gets_no_bars(progress, capsys, monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    with progress.progress_bars() as heard:
        heard("motion", 1, 3)
    assert capsys.readouterr().err == ""


def test_nothing_is_shown_where_standard_error_is_closed(progress, monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    with progress.progress_bars() as heard:
        heard("motion", 1, 3)
