"""Inputs for others to clean, and noisy clips that others made: folders of one npz per case."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from geneoh.errors import InputError, MissingAssetError
from geneoh.evaluation.cases import Case, Pending
from geneoh.files.atomic import write_whole
from geneoh.readers.meshes import obj_text
from geneoh.readers.npz_files import load_sequence, save_sequence


def stored_name(clip: str, noise: str, seed: int) -> str:
    """The file of a case in a folder of inputs or predictions."""
    return f"{clip}_{noise}_{seed}.npz"


@dataclass(frozen=True)
class StoredTwin:
    """A case whose noisy input is read from a folder; see `stored_name`."""

    pending: Pending
    folder: Path

    @property
    def dataset(self) -> str:
        """Name of the data set."""
        return self.pending.dataset

    @property
    def clip(self) -> str:
        """Name of the clip."""
        return self.pending.clip

    @property
    def noise(self) -> str:
        """Name of the noise."""
        return self.pending.noise

    @property
    def seed(self) -> int:
        """Of the noise."""
        return self.pending.seed

    def load(self) -> Case:
        """The clip, with the stored hand in place of the drawn one.

        Raises:
            MissingAssetError: there is no file for the case.
            InputError: it has other frames than the clip.
        """
        case = self.pending.load()
        names = (stored_name(case.clip, case.noise, case.seed), f"{case.noise}_{case.seed}.npz")
        paths = [path for name in names if (path := self.folder / name).is_file()]
        if not paths:
            raise MissingAssetError(
                f"{self.folder}: expected {names[0]} or {names[1]}, found neither; "
                "`geneoh eval --inputs DIR` writes such a folder"
            )
        noisy = load_sequence(paths[0], case.noisy.object.meshes, side=case.noisy.hands[0].side)
        if noisy.frames != case.noisy.frames:
            raise InputError(
                f"{paths[0]}: expected the clip's {case.noisy.frames} frames, got {noisy.frames}; "
                "use twins of this clip"
            )
        return replace(case, noisy=noisy)


def write_inputs(cases: Iterable[Pending], folder: Path) -> int:
    """Write every case's noisy input with its meshes, for others to clean; returns how many.

    The files are named as `--predictions` and `--twins` want them. Meshes stand in `objects/`, one
    per part of each clip.
    """
    count = 0
    for pending in cases:
        case = pending.load()
        path = folder / stored_name(case.clip, case.noise, case.seed)
        path.parent.mkdir(parents=True, exist_ok=True)
        for part, mesh in enumerate(case.noisy.object.meshes):
            place = folder / "objects" / f"{case.clip}_{part}.obj"
            write_whole(place, obj_text(mesh), parents=True)
        save_sequence(case.noisy, path)
        count += 1
    return count
