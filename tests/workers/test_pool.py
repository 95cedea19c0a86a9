"""Workers: results, errors, and processes that are killed."""

import os
import signal
import subprocess
import sys
import time
from multiprocessing import active_children, get_context

import chores
import pytest
import torch

from geneoh.errors import GeneOHError
from geneoh.workers.pool import cores, results_of

SUPPORT = os.path.dirname(chores.__file__)


def lost(item, why):
    return f"{item[0]}: {why}"


@pytest.mark.parametrize("jobs", [1, 2])
def test_all_results_come_and_no_process_stays(jobs):
    made = results_of(iter(range(5)), chores.doubled, jobs=jobs, lost=lost)
    assert sorted(made) == [0, 2, 4, 6, 8]
    assert active_children() == []
    assert list(results_of([], chores.doubled, jobs=jobs, lost=lost)) == []


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_ends_the_work_and_reaches_the_caller(jobs):
    with pytest.raises(ValueError, match="1 is odd"):
        list(results_of([0, 1], chores.doubled_unless_odd, jobs=jobs, lost=lost))
    assert active_children() == []


def test_an_error_that_cannot_travel_is_told_in_words():
    with pytest.raises(RuntimeError, match="Refused: no 7") as caught:
        list(results_of([7], chores.refused, jobs=2, lost=lost))
    assert "chores.py" in str(caught.value.__cause__)  # where it was raised


def test_an_item_whose_worker_is_killed_is_tried_once_more(tmp_path):
    once, ever = tmp_path / "once", tmp_path / "ever"
    once.write_text("1")
    ever.write_text("123456")
    work = [(1, ""), (2, str(once)), (3, str(ever)), (4, "")]
    made = list(results_of(work, chores.doubled_or_killed, jobs=2, lost=lost))
    numbers = sorted(each for each in made if isinstance(each, int))
    (words,) = (each for each in made if isinstance(each, str))
    assert numbers == [2, 4, 8]
    assert words.startswith("3: 2 worker processes that worked on this clip were ended by SIGKILL")
    assert ever.read_text() == "3456"  # begun twice, no more
    assert active_children() == []


def test_an_item_whose_worker_is_killed_while_it_sends_is_tried_once_more(tmp_path):
    work = [(1, ""), (2, str(tmp_path))]
    made = results_of(work, chores.killed_while_it_sends, jobs=2, lost=lost)
    assert next(made) == 2
    (tmp_path / "go").touch()
    wait_for(lambda: len(active_children()) == 1)  # nobody reads until then
    assert list(made) == [4]


def test_a_worker_that_cannot_work_ends_the_run():
    with pytest.raises(GeneOHError, match=r"exit code 3.*one job"):
        list(results_of([1], chores.ended_by_itself, jobs=2, lost=lost))


def test_workers_that_are_no_longer_wanted_tidy_up(tmp_path):
    made = results_of([str(tmp_path)] * 2, chores.tidied, jobs=2, lost=lost)
    begin_then_interrupt(made, tmp_path)
    begun = {path.name.removeprefix("begun_") for path in tmp_path.glob("begun_*")}
    assert len(begun) == 2
    assert {path.name.removeprefix("tidied_") for path in tmp_path.glob("tidied_*")} == begun
    assert active_children() == []


def begin_then_interrupt(made, folder):
    """As Ctrl-C does while the caller waits for the first result."""

    def poll(*_):
        if len(list(folder.glob("begun_*"))) == 2:
            raise KeyboardInterrupt
        signal.setitimer(signal.ITIMER_REAL, 0.1)

    before = signal.signal(signal.SIGALRM, poll)
    signal.setitimer(signal.ITIMER_REAL, 0.1)
    try:
        with pytest.raises(KeyboardInterrupt):
            next(made)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


SCRIPT = """
import sys, chores
from geneoh.workers.pool import results_of
if __name__ == "__main__":
    do = getattr(chores, sys.argv[1])
    print(list(results_of([sys.argv[2]] * 2, do, jobs=2, lost=None)))
"""


def script_of(folder) -> tuple[list[str], dict[str, str]]:
    """The command of a program with two workers, without its arguments, and its environment."""
    (folder / "run.py").write_text(SCRIPT)
    paths = os.pathsep.join([SUPPORT, os.environ.get("PYTHONPATH", "")])
    return [sys.executable, str(folder / "run.py")], {**os.environ, "PYTHONPATH": paths}


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot hold signals")
def test_ctrl_c_reaches_no_worker_from_the_start_of_the_first_one_on(tmp_path):
    # in a program of its own: only the first worker of a program starts the tracker of resources
    command, environment = script_of(tmp_path)
    command += ["holds_interrupts", ""]
    told = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[True, True]"


def test_workers_end_when_their_parent_is_killed(tmp_path):
    command, environment = script_of(tmp_path)
    with subprocess.Popen([*command, "tidied", tmp_path], env=environment) as parent:
        wait_for(lambda: len(list(tmp_path.glob("begun_*"))) == 2)
        parent.kill()
    wait_for(lambda: len(list(tmp_path.glob("tidied_*"))) == 2)


def wait_for(there, seconds=60.0):
    """Wait until something is so."""
    end = time.monotonic() + seconds
    while not there():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_workers_have_one_thread_and_the_caller_keeps_its_own():
    before = torch.get_num_threads()
    assert list(results_of([1], chores.threads, jobs=2, lost=lost)) == [(1, "1", "1")]
    assert next(results_of([1], chores.doubled, jobs=1, lost=lost)) == 2
    assert torch.get_num_threads() == before


def test_there_is_a_core_to_work_on():
    assert cores() >= 1


def test_a_worker_of_others_works_alone():
    with get_context("spawn").Pool(1) as pool:
        assert pool.apply(chores.doubled_in_processes, ([1, 2],)) == [2, 4]
