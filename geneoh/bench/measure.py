"""Measures one point of the benchmark; `geneoh.bench.run` runs this file in a separate process.

It measures the geneoh that is imported and uses only public names, so that a checkout of another
version in PYTHONPATH can be measured in the same way. The first argument is a
`geneoh.bench.run.Point` as JSON. Progress is printed, then the result as JSON in the last line.
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from operator import add
from pathlib import Path
from typing import Any, NamedTuple

REPEATS, LONG = 3, 10.0
"""Runs of a point, of which the median one counts, and seconds after which no run is started."""
FILES = Path(__file__).resolve().parents[2] / "examples"
INSTALLED = Path(__file__).resolve().parents[1] / "examples"

ZERO = {"seconds": 0.0, "processor": 0.0, "peak_mb": 0.0}
Tell = Callable[[str, int, int], None]
Found = dict[str, dict[str, Any]]
"""For the `whole` and each stage: `seconds` of wall time, `processor` seconds, and `peak_mb`, the
peak memory of the process until then."""


class Moment(NamedTuple):
    """Wall time, processor time, and the peak memory of this process so far."""

    seconds: float
    processor: float
    peak_mb: float


def now(device: str) -> Moment:
    """The current moment; on a GPU, after its queued work, and with the peak of its memory.

    On Windows without a GPU, the peak is 0, because a process cannot read it.
    """
    if device.startswith("cuda"):
        import torch

        torch.cuda.synchronize(device)
        peak = torch.cuda.max_memory_allocated(device) / 2**20
    elif sys.platform == "win32":
        peak = 0.0
    else:
        import resource

        unit = 2**20 if sys.platform == "darwin" else 2**10
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
    return Moment(time.monotonic(), time.process_time(), peak)


def example(frames: int, triangles: int | None = None) -> Any:
    """The noisy example recording, played forth and back to reach `frames`, with a refined mesh."""
    import torch

    import geneoh

    folder = FILES if FILES.is_dir() else INSTALLED
    sequence = geneoh.load(folder / "taco_noisy.npz", obj=folder / "taco_object.obj")
    cycle = [*range(sequence.frames), *range(sequence.frames - 2, 0, -1)]
    sequence = sequence[torch.tensor([cycle[frame % len(cycle)] for frame in range(frames)])]
    meshes = tuple(subdivided(mesh, triangles or 0) for mesh in sequence.object.meshes)
    return replace(sequence, object=replace(sequence.object, meshes=meshes))


def subdivided(mesh: Any, triangles: int) -> Any:
    """The same surface in `triangles` or one less: all are split by four, then some by three."""
    import numpy as np
    import torch
    import trimesh

    import geneoh

    verts, faces = mesh.verts.numpy(), mesh.faces.numpy()
    if len(faces) + 2 > triangles:
        return mesh
    while 4 * len(faces) <= triangles:
        verts, faces = trimesh.remesh.subdivide(verts, faces)[:2]
    while (splits := (triangles - len(faces)) // 2) > 0:
        a, b, c = np.moveaxis(verts[faces], 1, 0)
        largest = np.argsort(-np.linalg.norm(np.cross(b - a, c - a), axis=-1), kind="stable")
        cut, kept = faces[largest[:splits]], faces[largest[splits:]]
        middle = len(verts) + np.arange(len(cut))
        verts = np.concatenate([verts, verts[cut].mean(1)])
        sides = [np.stack([cut[:, k], cut[:, (k + 1) % 3], middle], axis=1) for k in range(3)]
        faces = np.concatenate([kept, *sides])
    return geneoh.Mesh(torch.from_numpy(verts).float(), torch.from_numpy(faces))


def _cleaned(point: dict[str, Any], tell: Tell | None = None, *, run: int = 0) -> Found:
    """Clean one clip of a point, write the result to a file, and return the measurements."""
    import geneoh

    sequence, device = example(point["frames"], point["triangles"]), point["device"]
    # another order of the faces in each run, because geneoh caches the search trees of a mesh
    order = [replace(m, faces=m.faces.roll(run, 0)) for m in sequence.object.meshes]
    sequence = replace(sequence, object=replace(sequence.object, meshes=tuple(order)))
    moments = [("", now(device))]

    def on_progress(stage: str, done: int, total: int) -> None:
        moments.append((stage, now(device)))
        if tell is not None:
            tell(stage, done, total)

    settings = {name: point[name] for name in ("preset", "samples", "device")}
    with tempfile.TemporaryDirectory() as folder:
        result = geneoh.denoise(sequence, on_progress=on_progress, **settings)
        geneoh.save(result, Path(folder) / "clean.npz")
    end = now(device)
    (hand,) = result.hands.values()
    return {"whole": took(moments[0][1], end), **by_stage(moments, hand.seconds)}


def took(before: Moment, after: Moment) -> dict[str, float]:
    """Wall and processor time between two moments, and the peak memory until the second."""
    seconds, processor = after.seconds - before.seconds, after.processor - before.processor
    return {"seconds": seconds, "processor": processor, "peak_mb": after.peak_mb}


def added(one: dict[str, float], other: dict[str, float]) -> dict[str, float]:
    """The sum of two measurements; of their peaks, the higher one."""
    return {name: (max if name == "peak_mb" else add)(one[name], other[name]) for name in one}


def by_stage(moments: Sequence[tuple[str, Moment]], seconds: dict[str, float]) -> Found:
    """Time and peak memory of each stage, summed over the intervals that end with its steps.

    The very first interval also holds the work before the first stage. `seconds`, the wall time of
    each stage in the result, tells which share of that interval belongs to the stage.
    """
    first, began = moments[1][0], moments[1][1].seconds
    last = max(moment.seconds for stage, moment in moments if stage == first)
    within = seconds[first] - (last - began)
    share = min(1.0, max(0.0, within / max(began - moments[0][1].seconds, 1e-9)))
    found: Found = {}
    for (_, before), (stage, after) in pairwise(moments):
        part = took(before, after)
        if not found:
            part |= {name: share * part[name] for name in ("seconds", "processor")}
        found[stage] = added(found.get(stage, ZERO), part)
    return found


def middle_run(point: dict[str, Any], tell: Tell) -> Found:
    """The median of up to `REPEATS` runs by processor time, after a short run for the imports."""
    _cleaned({**point, "frames": 12, "triangles": 0, "samples": 1, "preset": "fast"})
    runs: list[Found] = []
    began = time.monotonic()
    while len(runs) < REPEATS and (not runs or time.monotonic() - began < LONG):
        runs.append(_cleaned(point, tell, run=len(runs) + 1))
    runs.sort(key=lambda found: found["whole"]["processor"])
    return runs[(len(runs) - 1) // 2]


def many_clips(point: dict[str, Any], tell: Tell) -> Found:
    """All clips of a point, cleaned by the workers of `geneoh batch`, one per core.

    Returns the sums over clips; `seconds` of the `whole` is the elapsed wall time.
    """
    from geneoh.workers.pool import cores, results_of

    def lost(_: dict[str, Any], why: str) -> Found:
        raise RuntimeError(why)

    began, clips, total = time.monotonic(), [point] * point["clips"], Found()
    jobs = min(cores(), len(clips))
    for done, found in enumerate(results_of(clips, _cleaned, jobs=jobs, lost=lost), 1):
        total = {stage: added(total.get(stage, ZERO), part) for stage, part in found.items()}
        tell("clips", done, len(clips))
    total["whole"]["seconds"] = time.monotonic() - began
    return total


def say(held: Any) -> None:
    """Print a line of JSON."""
    sys.stdout.write(json.dumps(held) + "\n")
    sys.stdout.flush()


def answer(find: Callable[[dict[str, Any], Tell], Found]) -> None:
    """Run `find` on the point in the first argument; print its progress, then its result."""
    import torch

    point = json.loads(sys.argv[1])
    torch.set_num_threads(point["threads"])

    def tell(*now: Any) -> None:
        say(now)

    say(find(point, tell))


if __name__ == "__main__":
    answer(lambda point, tell: (many_clips if point["clips"] > 1 else middle_run)(point, tell))
