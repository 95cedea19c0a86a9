"""Tracks of any length: cleaned piece by piece, with the result and the memory of short ones."""

import json
import subprocess
import sys

import pytest

from geneoh.pipeline.denoise import denoise
from geneoh.sequence import windows

SMALL = {
    "geneoh.sequence.windows.BLOCK": 50,
    "geneoh.pipeline.stages.context.WINDOWS_AT_ONCE": 1,
    "geneoh.denoisers.spatial.HANDS_AT_ONCE": 1,
}
"""Sizes at which 146 frames are a long track."""


@pytest.fixture(scope="module")
def in_pieces_and_whole(noisy):
    """Keypoints of the example, cleaned in many pieces and in one, and what progress was told."""
    whole = denoise(noisy, preset="fast").sequence.hands[0].joints
    heard: list[tuple[str, int, int]] = []
    with pytest.MonkeyPatch.context() as patch:
        for name, size in SMALL.items():
            patch.setattr(name, size)
        assert len(windows.blocks(noisy.frames)) == 3
        result = denoise(noisy, preset="fast", on_progress=lambda *now: heard.append(now))
    return result.sequence.hands[0].joints, whole, heard


@pytest.mark.slow
def test_many_pieces_give_the_track_of_one(in_pieces_and_whole):
    """The fit amplifies: where contact is undecided, a micrometre more moves a finger by one mm."""
    parts, whole, _ = in_pieces_and_whole
    apart = (parts - whole).norm(dim=-1).amax(1)
    assert float(apart.mean()) < 0.0001
    assert float(apart.quantile(0.95)) < 0.0005


@pytest.mark.slow
def test_the_cuts_leave_no_seam(in_pieces_and_whole):
    bends, uncut = (
        joints.diff(n=2, dim=0).norm(dim=-1).mean(-1) for joints in in_pieces_and_whole[:2]
    )
    for cut in (50, 100):  # a value is made of its frame and the two after it
        at = slice(cut - 2, cut)
        assert bends[at].mean() < 1.5 * uncut[at].mean()


@pytest.mark.slow
def test_progress_of_pieces_runs_to_the_end_of_each_stage(in_pieces_and_whole):
    heard = in_pieces_and_whole[2]
    for stage in ("motion", "spatial", "temporal", "fit"):
        told = [(done, total) for name, done, total in heard if name == stage]
        assert told == [(done, len(told)) for done in range(1, len(told) + 1)]


def peaks(lengths: tuple[int, int]) -> list[float]:
    """Peak of memory in MB after tracks of these lengths, one after the other in one process."""
    code = f"""
import json, resource, sys
from importlib import import_module
from geneoh.bench.measure import example
import geneoh
for name, size in {(SMALL | {"geneoh.fitting.fit.OVERLAP": 10})!r}.items():
    module, _, constant = name.rpartition(".")
    setattr(import_module(module), constant, size)
for frames in {lengths!r}:
    geneoh.denoise(example(frames), preset="fast", steps=1)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300
    )
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.slow
def test_memory_hardly_grows_with_the_track():
    """A frame once cost 1.8 MB; its parameters and keypoints, which are kept, are kilobytes."""
    lengths = (60, 200)
    short, long = peaks(lengths)
    assert long - short < 0.1 * (lengths[1] - lengths[0])
