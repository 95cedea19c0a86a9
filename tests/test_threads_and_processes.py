"""Several cleanings at once: in threads, in processes, in forks of a process with threads."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPT = """
import multiprocessing, sys
import geneoh

noisy, obj = sys.argv[1:]
options = geneoh.Options(preset="fast", steps=1)
sequence = geneoh.load(noisy, obj=obj)[:8]

def clean(sequence):
    joints = geneoh.denoise(sequence, options).sequence.hands[0].joints
    return [float(joints.sum()), len(joints)]

def clean_in_fork():
    with multiprocessing.get_context("fork").Pool(1) as pool:
        return pool.map(clean, [sequence])[0]

after_loading, here = clean_in_fork(), clean(sequence)
for there in (after_loading, clean_in_fork()):
    assert there[1] == 8
    assert abs(here[0] - there[0]) < 0.01, (here, there)
"""


# Not both in one process: a fork while threads end can meet torch's linear algebra (MKL) in the
# middle of giving back their memory, and its copy in the child then never ends.
AT_ONCE = """
import multiprocessing, sys
from concurrent.futures import ThreadPoolExecutor
import geneoh

sequence = geneoh.load(sys.argv[1], obj=sys.argv[2])[:8]

def clean(seed):
    result = geneoh.denoise(sequence, preset="fast", steps=1, samples=2, seed=seed)
    hand = result.sequence.hands[0]
    return hand.joints.numpy().tobytes(), hand.joint_spread.numpy().tobytes()

seeds = [0, 1]
serial = [clean(seed) for seed in seeds]
assert len(set(serial)) == len(seeds), "seeds differ"
if sys.argv[3] == "threads":
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(clean, seeds)) == serial
else:
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map(clean, seeds, chunksize=1) == serial
"""


def run(script: str, *arguments: str, threads: int) -> None:
    """Run a script in a process of its own with the example's files."""
    files = [str(EXAMPLES / "taco_noisy.npz"), str(EXAMPLES / "taco_object.obj")]
    # Threads that wait must sleep: the cores may be shared with other tests
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads), "OMP_WAIT_POLICY": "PASSIVE"}
    child = subprocess.run(
        [sys.executable, "-c", script, *files, *arguments],
        env=environment,
        timeout=120,
        capture_output=True,
        text=True,
    )
    assert child.returncode == 0, child.stderr


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a system that forks")
def test_a_forked_pool_works_before_and_after_torch_has_started_its_threads():
    run(SCRIPT, threads=2)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a system that forks")
@pytest.mark.parametrize("workers", ["threads", "processes"])
def test_threads_and_processes_give_the_bits_of_one_after_the_other(workers: str):
    run(AT_ONCE, workers, threads=1)
