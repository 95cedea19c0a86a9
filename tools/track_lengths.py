"""Time and memory over the length of a track: `python -m tools.track_lengths FRAMES...`.

The track is the example recording, forth and back as often as needed. Each length is cleaned and
written to a file in a process of its own, so that its peak is its own. `--tree PATH` measures
another version of geneoh beside this one, in the same run: the folder of its checkout, more than
once if need be.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).parents[1]
EXAMPLES = HERE / "examples"


def main() -> None:
    """Print one line of a Markdown table for each version and length."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("frames", type=int, nargs="+")
    parser.add_argument("--preset", default="fast")
    parser.add_argument("--tree", type=Path, action="append", default=[])
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        print(json.dumps(measured(given.frames[0], given.preset)))
        return
    print("| version | frames | processor time, ms a frame | wall clock, ms a frame | peak, MB |")
    print("|---|---|---|---|---|")
    for frames in given.frames:
        for tree in (*given.tree, HERE):
            found = in_child(tree, frames, given.preset)
            print(
                f"| {'this one' if tree == HERE else tree.name} | {frames:,} "
                f"| {1000 * found['processor'] / frames:.1f} "
                f"| {1000 * found['clock'] / frames:.1f} | {found['peak_mb']:,.0f} |",
                flush=True,
            )


def in_child(tree: Path, frames: int, preset: str) -> dict[str, Any]:
    """What `measured` finds in a new process that imports geneoh from a folder."""
    command = [sys.executable, str(Path(__file__)), str(frames), "--preset", preset, "--child"]
    environment = {**os.environ, "PYTHONPATH": str(tree.resolve())}
    done = subprocess.run(
        command, env=environment, cwd=tree, stdout=subprocess.PIPE, check=True, text=True
    )
    return json.loads(done.stdout.splitlines()[-1])


def measured(frames: int, preset: str) -> dict[str, Any]:
    """Seconds of the processor and of the clock from file to file, and the peak of memory in MB."""
    import geneoh

    sequence = example(frames)
    began, processor = time.monotonic(), time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        geneoh.save(geneoh.denoise(sequence, preset=preset), Path(folder) / "clean.npz")
    return {
        "processor": time.process_time() - processor,
        "clock": time.monotonic() - began,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def example(frames: int) -> Any:
    """The noisy example, forth and back up to so many frames."""
    import torch

    import geneoh

    sequence = geneoh.load(EXAMPLES / "taco_noisy.npz", obj=EXAMPLES / "taco_object.obj")
    length = sequence.frames
    cycle = [*range(length), *range(length - 2, 0, -1)]
    return sequence[torch.tensor([cycle[frame % len(cycle)] for frame in range(frames)])]


if __name__ == "__main__":
    main()
