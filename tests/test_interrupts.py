"""Ctrl-C that waits."""

import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import geneoh
from geneoh.interrupts import interrupts_wait


@pytest.fixture(autouse=True)
def as_in_a_terminal():
    """Ctrl-C raises KeyboardInterrupt; a job in the background ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interrupt_counts_at_the_end_of_the_block():
    def work() -> None:
        with interrupts_wait():
            os.kill(os.getpid(), signal.SIGINT)
            reached.append(True)

    reached: list = []
    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_counts_where_the_block_raises_too():
    def work() -> None:
        with interrupts_wait():
            os.kill(os.getpid(), signal.SIGINT)
            raise ValueError

    with pytest.raises(KeyboardInterrupt):
        work()


def test_an_ignored_interrupt_stays_ignored():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with interrupts_wait():
        os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_other_threads_are_left_alone():
    def work() -> None:
        with interrupts_wait():
            seen.append(signal.getsignal(signal.SIGINT))

    seen: list = []
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]


FIRST_IMPORTS = """
import signal, sys

class Watch:
    def find_spec(self, name, *_):
        if name in ("igl", "trimesh"):
            print(name, signal.getsignal(signal.SIGINT) is signal.default_int_handler)

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Watch())
import geneoh.viz.outputs
"""


def test_an_interrupt_waits_while_viewing_imports_libigl_and_trimesh():
    """trimesh catches every exception while it is imported, and libigl ends with std::bad_cast."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST_IMPORTS], capture_output=True, text=True, check=True
    )
    assert sorted(done.stdout.splitlines()) == ["igl False", "trimesh False"]


def test_libigl_is_imported_nowhere_without_this():
    files = Path(geneoh.__file__).parent.rglob("*.py")
    bare = re.compile(r"^(import|from) igl\b", re.MULTILINE)
    assert [file.name for file in files if bare.search(file.read_text("utf-8"))] == []


def test_a_handler_that_is_not_pythons_is_left_alone(monkeypatch):
    monkeypatch.setattr(signal, "getsignal", lambda number: None)
    monkeypatch.setattr(signal, "signal", lambda *given: pytest.fail("could not be set back"))
    with interrupts_wait():
        pass
