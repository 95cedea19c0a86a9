"""A short run of the fuzzer, and the trap that it sets."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz import guard
from tests.fuzz.corpus import ends

REPOSITORY = Path(__file__).parents[2]


@pytest.mark.slow
def test_changed_files_do_no_harm():
    command = [sys.executable, "-W", "ignore", "-m", "tests.fuzz", "--count", "16"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "| all | 16 |" in done.stdout
    assert "| cleaned |" in done.stdout


class Trapped(Exception):
    """Stands in for the end of the process."""


@pytest.fixture
def trap(monkeypatch, tmp_path):
    """The check of events, for a room in which alone files are written."""

    def trapped(*words):
        raise Trapped(*words)

    monkeypatch.setattr(guard, "trapped", trapped)
    return lambda event, *args: guard.check(event, args, ["/usr/lib"], str(tmp_path))


@pytest.mark.parametrize(
    "event",
    [
        ("open", "/etc/passwd", "r", os.O_RDONLY),
        ("open", "/usr/lib/a.py", "w", os.O_WRONLY | os.O_CREAT),
        ("open", "/usr/library", "r", os.O_RDONLY),
        ("os.system", b"true"),
        ("subprocess.Popen", "true", [], None, None),
        ("pickle.find_class", "os", "system"),
        ("import", "antigravity_of_others", None, None, None, None),
        ("os.rename", "/etc/passwd", "/etc/gone", -1, -1),
        ("os.remove", "/etc/passwd", -1),
        ("socket.connect", None, ("127.0.0.1", 9)),
        ("exec", compile("1", "<string>", "exec")),
    ],
    ids=lambda event: f"{event[0]} {event[1]}".partition(" at 0x")[0],
)
def test_what_the_command_never_does_is_trapped(trap, event):
    with pytest.raises(Trapped):
        trap(*event)


def test_what_the_command_does_passes_the_trap(trap, tmp_path):
    trap("open", "/usr/lib/a.py", "r", os.O_RDONLY)
    trap("open", str(tmp_path / "a.npz"), "w", os.O_WRONLY | os.O_CREAT)
    trap("open", 3, "r", os.O_RDONLY)
    trap("import", "json.tool", None, None, None, None)
    trap("os.rename", str(tmp_path / "a"), str(tmp_path / "b"), -1, -1)
    trap("os.listdir", "/etc")


def test_only_what_differs_is_kept():
    assert ends(b"aaabbbccc", b"aaaxccc") == (3, 3)
    assert ends(b"aaa", b"aaaa") == (3, 0)
    assert ends(b"", b"x") == (0, 0)
