"""Processes that are forked after torch has started its threads."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPT = """
import multiprocessing, sys
import geneoh

noisy, obj, clean_first = sys.argv[1], sys.argv[2], sys.argv[3] == "denoise"
options = geneoh.Options(preset="fast", steps=1)
sequence = geneoh.load(noisy, obj=obj)[:20]

def clean(sequence):
    joints = geneoh.denoise(sequence, options).sequence.hands[0].joints
    return [float(joints.sum()), len(joints)]

here = clean(sequence) if clean_first else None
with multiprocessing.get_context("fork").Pool(1) as pool:
    there = pool.map(clean, [sequence])[0]
assert there[1] == 20
assert here is None or abs(here[0] - there[0]) < 0.01, (here, there)
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs a system that forks")
@pytest.mark.parametrize("before", ["load", "denoise"])
def test_a_forked_pool_works_after_torch_has_started_its_threads(before: str):
    arguments = [str(EXAMPLES / "taco_noisy.npz"), str(EXAMPLES / "taco_object.obj"), before]
    # Threads that wait must sleep: the cores may be shared with other tests
    environment = {**os.environ, "OMP_NUM_THREADS": "2", "OMP_WAIT_POLICY": "PASSIVE"}
    child = subprocess.run(
        [sys.executable, "-c", SCRIPT, *arguments],
        env=environment,
        timeout=120,
        capture_output=True,
        text=True,
    )
    assert child.returncode == 0, child.stderr
