"""Measure cleaning against noisy objects: `python -m tools.noisy_objects TABLE [SEEDS [ROWS]]`.

TABLE is `hands` (clean, noisy and camera hands of the recording with each noise of the object),
`trusted` (the same with the object's poses as they are), `guard` (every noise of the hand with
every noise of the object), `shaken` (hands that shake their object), `beside` and `hovering` (hands
that move 6 or 1.5 cm beside an object and hold nothing), `filmed` (a still and a moving camera),
`tracked` (the moving one with noisy poses of it), `filmed_trusted` (without removal of its motion),
`large` (objects that are joined to furniture), `enclosed` (meshes that are convex hulls or boxes),
`enclosed_trusted` (the same, relied on), `covered` (objects whose poses are noisy while they move),
`gaps` (objects that are lost for 10 or 30 frames while they move), `stuck` (objects whose poses
stay behind for as long), `tray` (hands that carry a tray on their backs), `walked` (hands alone of
someone who stands or walks), `round` (objects with symmetry), `refined` (the object itself),
`white` (the same with noise that does not drift), `filtered` (hands or objects that went through a
filter, or come late, and the other did not), `alone` (hands without their object) or `limits` (what
may be reached at best). SEEDS is 5 unless it is given. Rows are kept in the file ROWS,
runs/noisy_objects.jsonl unless it is given, as soon as they are measured, so a run that was stopped
goes on; after a change of the code name another file.
"""

import sys
from pathlib import Path

from tools.noisy_objects.limits import lines_of_limits
from tools.noisy_objects.tables import TABLES, lines_of


def main(table: str, seeds: str = "5", path: str = "runs/noisy_objects.jsonl") -> None:
    """Print one table."""
    lines = (
        lines_of_limits(int(seeds))
        if table == "limits"
        else lines_of(table, int(seeds), Path(path))
    )
    for line in lines:
        print(line, flush=True)


if __name__ == "__main__":
    if not 1 <= len(sys.argv) - 1 <= 3:
        raise SystemExit(f"usage: python -m tools.noisy_objects {'|'.join(TABLES)} [SEEDS [ROWS]]")
    main(*sys.argv[1:])
