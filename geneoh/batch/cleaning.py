"""Cleaning of one clip of a batch, in any process: files in, clean files and an outcome out."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from geneoh.batch.clips import FOR_NPZ, BatchClip
from geneoh.errors import CheckpointError, GeneOHError
from geneoh.files.atomic import make_folder
from geneoh.files.fingerprints import fingerprint, fingerprints
from geneoh.files.outputs import keep_others, refuse_inputs
from geneoh.files.reading import noted_reads
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options, with_settings
from geneoh.pipeline.results import Denoised, save
from geneoh.readers.base import SourceClip
from geneoh.readers.npz.files import load
from geneoh.readers.recordings import (
    check_recording,
    options_with_files,
    read_clip,
    source_named,
)
from geneoh.sequence.sequence import Sequence

LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class BatchOptions:
    """Options that hold for every clip."""

    folder: Path  # output folder
    options: Options = field(default_factory=Options)
    reading: dict[str, Any] = field(default_factory=dict)  # options of `geneoh.read` by name


@dataclass(frozen=True)
class CleaningOutcome:
    """The outcome of cleaning a clip."""

    clip: str
    failed: str = ""  # error message in one sentence; empty on success
    inputs: dict[str, str] = field(default_factory=dict)
    """Fingerprint of each file that was read, by its path."""
    files: dict[str, str] = field(default_factory=dict)
    """Fingerprint of each file that was written, by its path below the folder of results."""
    hands: list[dict[str, Any]] = field(default_factory=list)  # a summary of each clean hand


def clean_clip(clip: BatchClip, batch: BatchOptions) -> CleaningOutcome:
    """Clean a clip and write its results; errors of this clip alone are returned, not raised.

    Raises:
        InputError: a result cannot be written, as on a full disk; this concerns all clips.
        CheckpointError: weights are missing or damaged; this concerns all clips.
    """
    with without_warnings():
        try:
            if clip.problem:
                raise GeneOHError(clip.problem)
            options = with_settings(batch.options, clip.settings)
            inputs = fingerprints([clip.path])  # before it is read
            with noted_reads() as read:
                recordings = sequences_of(clip, batch.reading, options.mano_dir)
            inputs = fingerprints({clip.path, *read}) | inputs
            made = []
            for name, sequence in recordings:
                place = batch.folder / f"{name}.npz"
                refuse_inputs(place, place.resolve(), [clip.path])
                keep_others(place)
                made.append((f"{name}.npz", denoise(sequence, options)))
        except CheckpointError:
            raise
        except GeneOHError as error:
            return CleaningOutcome(clip.name, str(error))
        except Exception as error:  # a defect of geneoh on one clip must not stop the others
            LOG.debug("%s", clip.path, exc_info=True)
            return CleaningOutcome(
                clip.name, f"{clip.path}: unexpected {type(error).__name__}: {error}"
            )
    files = {}
    for name, result in made:
        make_folder((batch.folder / name).parent)
        save(result, batch.folder / name, overwrite=True)  # `keep_others` refused foreign files
        files[name] = fingerprint(batch.folder / name)
    hands = [row for name, result in made for row in _rows_of(name, result)]
    return CleaningOutcome(clip.name, "", inputs, files, hands)


@contextmanager
def without_warnings() -> Iterator[None]:
    """Silence warnings about single clips, because the summary reports them."""
    log = logging.getLogger("geneoh")
    before = log.level
    log.setLevel(max(before, logging.ERROR) if log.getEffectiveLevel() > logging.DEBUG else before)
    try:
        yield
    finally:
        log.setLevel(before)


def sequences_of(
    clip: BatchClip, reading: dict[str, Any], mano_dir: Path | None
) -> list[tuple[str, Sequence]]:
    """The recordings of a clip with their names; most have one."""
    given = {**reading, **clip.reading}
    if clip.source is None:
        bare = {name: value for name, value in given.items() if name in FOR_NPZ}
        obj = clip.meshes or None
        return [(clip.name, load(clip.path, obj=obj, mano_dir=mano_dir, **bare))]
    options = options_with_files(obj=clip.meshes, mano_dir=mano_dir, **given)
    source_clip = SourceClip(clip.name, clip.path)
    recordings = read_clip(source_named(clip.source), source_clip, options)
    for recording in recordings:
        check_recording(recording)
    return [(recording.name, recording.sequence) for recording in recordings]


def _rows_of(file: str, result: Denoised) -> Iterator[dict[str, Any]]:
    """A JSON-compatible summary of each hand of a result."""
    for side, hand in result.hands.items():
        yield {
            "file": file,
            "side": side,
            "frames": result.sequence.frames,
            "filled": int(hand.filled.sum()),
            "moved_mm": 1000 * hand.moved,
            "before": hand.before.as_dict(),
            "after": hand.after.as_dict(),
            "notes": list(dict.fromkeys((*result.notes_of_clip(), *hand.notes))),
        }
