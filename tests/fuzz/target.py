"""One thing that is fuzzed: sound files and the commands that read them."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Target:
    """A folder of sound files, of which one is changed at a time."""

    name: str
    kind: str
    """Of the files that are changed, as the table calls it."""
    root: Path
    """Folder of all files."""
    changed: tuple[str, ...]
    """The files that may be changed, relative to the folder."""
    command: tuple[str, ...]
    """`geneoh denoise` or another one; {in} and {out} stand for the folders."""
    others: tuple[tuple[str, ...], ...] = ()
    """Other commands that read the files."""

    def ready(self, command: tuple[str, ...], out: Path) -> list[str]:
        """A command with its folders."""
        return [word.replace("{in}", str(self.root)).replace("{out}", str(out)) for word in command]
