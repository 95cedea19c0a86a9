"""One input: a file changed, the command run on it in a child, and what became of everything."""

import hashlib
import random
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from forked import Ended, forked

from tests.fuzz.guard import TRAPPED, set_trap
from tests.fuzz.mutate import mutated
from tests.fuzz.target import Target

WRONG_RESULT = 98
"""Exit code of a child whose result cannot be read, or is not finite."""
LONGEST_MESSAGE = 1500


@dataclass(frozen=True)
class Case:
    """An input, and how it is used."""

    target: Target
    file: str
    """The file that is changed, relative to the target's folder."""
    data: bytes
    command: tuple[str, ...]
    whole: bool
    """Whether the hands are cleaned; else the files are only read and checked."""


@dataclass(frozen=True)
class Outcome:
    """What became of an input."""

    case: Case
    ended: Ended
    problem: str | None

    @property
    def denoised(self) -> bool:
        """Whether a hand was cleaned to the end."""
        return self.case.whole and self.ended.code == 0


def draw_case(targets: Sequence[Target], draw: random.Random, *, whole: bool) -> Case:
    """The next input for one of some targets."""
    target = draw.choice(targets)
    whole = whole and target.command[0] == "denoise"
    command = target.command
    if target.others and not whole and draw.random() < 0.25:
        command = draw.choice(target.others)
    if whole and draw.random() < 0.1:
        command = (*command, "--report", "{out}/clean.html")
    file = draw.choice(target.changed)
    sound = (target.root / file).read_bytes()
    return Case(target, file, mutated(sound, Path(file).suffix, draw), command, whole)


def run_case(case: Case, out: Path, old: bytes) -> Outcome:
    """Run the command on an input; `old` is the result that stands in the place of the new."""
    path, root = case.target.root / case.file, case.target.root
    sound = path.read_bytes()
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    (out / "notes.txt").write_bytes(b"not ours")
    (out / "clean.npz").write_bytes(old)
    path.write_bytes(case.data)
    before = digests(root)
    try:
        ended = forked(
            run_command(case, out), out.with_name("said.txt"), before=lambda: traps(root, out)
        )
        problem = ended.problem or misplaced(case, ended, out, old)
        if digests(root) != before:
            problem = "an input was changed"
    finally:
        path.write_bytes(sound)
    return Outcome(case, ended, problem)


def traps(root: Path, out: Path) -> None:
    """Set the trap: all inputs lie beside each other."""
    set_trap(root.parent, out)


def run_command(case: Case, out: Path) -> Callable[[], None]:
    """The command, with a look at its result; without the cleaning where it is only to read."""
    words = case.target.ready(case.command, out)

    def run() -> None:
        import geneoh
        from geneoh_cli.main import cli

        if not case.whole:
            geneoh.denoise = stop
        try:
            cli.main(words, prog_name="geneoh")
        except SystemExit as error:
            if error.code == 0 and case.whole and not sound_result(out / "clean.npz"):
                raise SystemExit(WRONG_RESULT) from None
            raise

    return run


def stop(*_: object, **__: object) -> None:
    """Stands in for the cleaning of a sequence that was read and checked."""
    raise SystemExit(0)


def sound_result(path: Path) -> bool:
    """Whether a result can be read and every hand has a finite place in every frame."""
    from geneoh.readers.npz.files import load

    hands = load(path).hands
    return all(bool(torch.isfinite(hand.joints).all()) for hand in hands)


def misplaced(case: Case, ended: Ended, out: Path, old: bytes) -> str | None:
    """What is wrong with the files or with the words, where the exit code is right."""
    there = {path.name for path in out.iterdir()}
    known = {
        "notes.txt",
        "clean.npz",
        "clean.html",
        "page.html",
        "scene.glb",
        "all",
        "run",
        "clip.npz",
        "clip.bvh",
    }
    if (out / "notes.txt").read_bytes() != b"not ours":
        return "a file of others was changed"
    if left := sorted(there - known):
        return f"left {left[0]}"
    if ended.code == 2:
        if (out / "clean.npz").read_bytes() != old:
            return "an older result was changed"
        return wrong_words(ended.said) if case.command[0] != "convert" else None
    return None


def wrong_words(said: str) -> str | None:
    """What is wrong with a refusal: it ends in one line that says Error, of a length to read."""
    last = (said.strip().splitlines() or [""])[-1]
    if not last.startswith("Error: "):
        return "a refusal without a sentence"
    return "a sentence without an end" if len(last) > LONGEST_MESSAGE else None


def digests(root: Path) -> dict[str, bytes]:
    """The content of every file of a folder."""
    files = (path for path in root.rglob("*") if path.is_file())
    return {str(path): hashlib.blake2b(path.read_bytes()).digest() for path in files}


__all__ = ["TRAPPED", "Case", "Outcome", "draw_case", "run_case"]
