"""A few faults of each kind on the quick commands; `python -m tests.faults` has all of them."""

import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]


@pytest.mark.slow
def test_nothing_is_lost_by_failing_writes_kills_and_second_runs():
    command = [sys.executable, "-W", "ignore", "-m", "tests.faults"]
    command += ["--kills", "1", "--every", "20"]
    command += ["--kind", "disk full", "--kind", "interrupted"]
    command += [word for name in ("denoise", "convert", "corrupt") for word in ("--command", name)]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("| 0 |\n") == 3
