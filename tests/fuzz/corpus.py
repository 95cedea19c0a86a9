"""The inputs that once did harm: they stay, and every run begins with them."""

import base64
import hashlib
import json
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.fuzz.target import Target
from tests.fuzz.trial import Case, Outcome

CORPUS = Path(__file__).parent / "corpus"
"""One JSON file for each input: what stands in the changed file between the first and the last byte
that differ from the sound one, as text, because the repository holds no pickles."""


def keep(outcome: Outcome, folder: Path) -> Path:
    """Add an input to the corpus."""
    case = outcome.case
    name = f"{case.target.kind}_{hashlib.sha256(case.data).hexdigest()[:10]}.json"
    head, tail = ends((case.target.root / case.file).read_bytes(), case.data)
    middle = case.data[head : len(case.data) - tail]
    entry = {
        "target": case.target.name,
        "file": case.file,
        "command": list(case.command),
        "whole": case.whole,
        "problem": outcome.problem,
        **{"head": head, "tail": tail},
        "middle": base64.b85encode(zlib.compress(middle, 9)).decode(),
    }
    (folder / name).write_text(json.dumps(entry, indent=1) + "\n")
    return folder / name


def ends(sound: bytes, changed: bytes) -> tuple[int, int]:
    """How many bytes at the start, and of the rest how many at the end, are those of the sound."""
    head = equal(sound, changed)
    return head, equal(sound[head:][::-1], changed[head:][::-1])


def equal(one: bytes, other: bytes) -> int:
    """How many bytes are the same from the start on."""
    pairs = enumerate(zip(one, other, strict=False))
    return next((at for at, (a, b) in pairs if a != b), min(len(one), len(other)))


def kept(targets: Iterable[Target], folder: Path = CORPUS) -> Iterator[tuple[str, Case]]:
    """Every input of the corpus with its name."""
    known = {(target.name, file): target for target in targets for file in target.changed}
    for path in sorted(folder.glob("*.json")):
        entry = json.loads(path.read_text())
        target = known[entry["target"], entry["file"]]
        sound = (target.root / entry["file"]).read_bytes()
        middle = zlib.decompress(base64.b85decode(entry["middle"]))
        data = sound[: entry["head"]] + middle + sound[len(sound) - entry["tail"] :]
        yield path.name, Case(target, entry["file"], data, tuple(entry["command"]), entry["whole"])
