"""Damaged files of every source: one sentence or a sequence, no code run, nothing half-written."""

import random
import shutil
import sys

import pytest
from damage import changed_value, damaged, forbid
from trees import CASES

from geneoh.files.journal import LOCK
from geneoh.readers.base import ReaderOptions
from geneoh.readers.convert import convert
from geneoh.readers.npz.files import load
from geneoh.readers.recordings import source_named
from geneoh.readers.registry import SOURCES

TRIALS = 25
"""Damaged files of each tree, 700 in all; `tests/files/test_damage.py` adds 1,800 below readers."""

MISSING_SHARE = 0.1  # trials in which a file is not there at all
CHANGES = 8
"""Decoded files of each tree that are changed, 224 in all: nothing catches our own errors."""


@pytest.mark.filterwarnings("ignore")  # numbers out of range warn before they are refused
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.build.__name__)
def test_damage_ends_in_one_sentence(case, tmp_path, mano_dir, monkeypatch):
    root, out = tmp_path / "in", tmp_path / "out"
    root.mkdir()
    case.write(root)
    draw = random.Random(case.build.__name__)
    source, clips = source_named(case.source), case.clips(root)
    known = ReaderOptions(mano_dir, **case.options(root))
    assert not any(outcome.problem for outcome in convert(source, clips, None, known))
    forbid(monkeypatch)  # from here on: the first call of a function evaluates its annotations
    files = sorted(path for path in root.rglob("*") if path.is_file())
    before = {path: path.read_bytes() for path in files}
    sentences = []
    for trial in range(TRIALS):
        path = draw.choice(files)
        path.unlink()
        if draw.random() > MISSING_SHARE:
            path.write_bytes(damaged(before[path], draw))
        for outcome in convert(source, clips, out, known, check=trial % 2 == 0):
            said = [outcome.problem] if outcome.problem else list(outcome.contradictions)
            sentences += said
            assert bool(said) != bool(outcome.files)
            assert_whole(out, outcome.files)
        path.write_bytes(before[path])
        shutil.rmtree(out, ignore_errors=True)
    assert sentences
    assert not any("\n" in sentence for sentence in sentences)
    assert sorted(path for path in root.rglob("*") if path.is_file()) == files


def assert_whole(out, files) -> None:
    """What was written is what was told, and nothing of it is half a file."""
    there = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert {name for name in there if name.endswith(".npz")} == set(files)
    known = (".npz", ".obj", "converted.jsonl", LOCK)
    assert not [name for name in there if not name.endswith(known)]
    for name in files:
        load(out / name)


@pytest.mark.filterwarnings("ignore")  # numbers out of range warn before they are refused
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.build.__name__)
def test_odd_values_in_a_sound_file_raise_no_error_of_ours(case, tmp_path, mano_dir, monkeypatch):
    root = tmp_path / "in"
    root.mkdir()
    case.write(root)
    source, options, clips = source_named(case.source), case.options(root), case.clips(root)
    decoded = count_decoded(monkeypatch)
    outcomes = list(convert(source, clips, None, ReaderOptions(mano_dir, **options)))
    assert not any(outcome.problem for outcome in outcomes)
    total = decoded.count
    for trial in range(CHANGES if total else 0):
        decoded.draw = random.Random(f"{case.build.__name__} {trial}")
        decoded.count, decoded.change = 0, decoded.draw.randrange(total)
        known = ReaderOptions(mano_dir if trial % 3 else None, **options)
        for outcome in convert(source, clips, None, known, check=trial % 2 == 0):
            said = [outcome.problem] if outcome.problem else list(outcome.contradictions)
            assert not any("\n" in sentence for sentence in said)


class Decoded:
    """Counts the files that are decoded, and changes what one of them holds."""

    def __init__(self) -> None:
        self.count, self.change, self.draw = 0, -1, random.Random(0)

    def through(self, read):
        def decode(path):
            value = read(path)
            if "MANO" in path.name:
                return value
            self.count += 1
            return changed_value(value, self.draw) if self.count - 1 == self.change else value

        return decode


def count_decoded(monkeypatch) -> Decoded:
    """Let all that readers decode go through a counter."""
    decoded = Decoded()
    for source in SOURCES.values():
        source.reader()
    for module in [m for name, m in sys.modules.items() if name.startswith("geneoh.readers")]:
        for name in ("read_values", "read_json"):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, decoded.through(getattr(module, name)))
    return decoded
