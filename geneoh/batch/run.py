"""Cleaning of many clips, with a journal so that an interrupted run resumes.

The journal's first line holds the settings of the run. Each other line is a clip with the state
`done`, `failed` or `left` (to do); the last line of a clip counts. A resumed run cleans the clips
that are left or failed, and those whose input changed or whose result is missing or changed.
"""

from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from typing import Any

from geneoh.batch.cleaning import BatchOptions, CleaningOutcome, clean_clip
from geneoh.batch.clips import BatchClip
from geneoh.batch.summary import SUMMARY_FILES, write_summary
from geneoh.config import as_dict, setting_differences
from geneoh.denoisers.library import all_weights
from geneoh.errors import ConfigError
from geneoh.files import journal
from geneoh.files.fingerprints import file_digests, is_done
from geneoh.files.outputs import keep_others
from geneoh.files.text import with_nan
from geneoh.progress import OnProgress
from geneoh.workers.cluster import on_cluster
from geneoh.workers.pool import results_of


@dataclass(frozen=True)
class Cleaned:
    """The outcomes of all clips of a batch."""

    outcomes: tuple[CleaningOutcome, ...]  # one per clip, in the order of the clips
    before: int  # number of clips that were done by an earlier run

    @property
    def failed(self) -> list[CleaningOutcome]:
        """The clips without a result."""
        return [outcome for outcome in self.outcomes if outcome.failed]


def clean_batch(
    clips: list[BatchClip],
    batch: BatchOptions,
    *,
    jobs: int = 1,
    ray: str | None = None,
    on_progress: OnProgress | None = None,
) -> Cleaned:
    """Clean all clips that are not done yet; results, journal and summary go to `batch.folder`.

    The work is done by `jobs` processes (by this one if 1), or by the Ray cluster at the address
    `ray`; "local" starts a cluster on this machine.

    Raises:
        ConfigError: the folder holds results that were made with other settings.
        InputError: another run works in the folder, it holds the result of another clip of the
            same name, or it cannot be written to.
    """
    batch.options.resolved()
    path, settings = batch.folder / journal.CLEANED, _settings_of(batch)
    with journal.only_run_in(batch.folder):
        records = _records_before(clips, batch, settings)
        journal.begin_journal(path, [settings, *records.values()])
        left = [clip for clip in clips if records[clip.name]["state"] == "left"]
        before = done = len(clips) - len(left)
        clean = partial(clean_clip, batch=batch)
        if ray is not None and left:
            found = on_cluster(left, clean, address=ray, lost=_lost)
        else:
            found = results_of(left, clean, jobs=max(1, min(jobs, len(left))), lost=_lost)
        for outcome in found:
            state = "failed" if outcome.failed else "done"
            record = {"clip": outcome.clip, "state": state, "asked": records[outcome.clip]["asked"]}
            records[outcome.clip] = record | asdict(outcome)
            journal.append_journal(path, [records[outcome.clip]])
            done += 1
            if on_progress is not None:
                on_progress("clips", done, len(clips))
        # rewritten with only the last record of each clip
        journal.begin_journal(path, [settings, *records.values()])
        outcomes = tuple(outcome_in(records[clip.name]) for clip in clips)
        write_summary(outcomes, batch.folder)
    return Cleaned(outcomes, before)


def _lost(clip: BatchClip, why: str) -> CleaningOutcome:
    """The outcome of a clip whose workers died."""
    return CleaningOutcome(clip.name, f"{clip.path}: {why}")


def _records_before(
    clips: list[BatchClip], batch: BatchOptions, settings: dict[str, Any]
) -> dict[str, dict[str, Any]]:
    """The journal's records by clip name, with those of clips that only earlier runs had.

    Clips that must be cleaned get a new record with the state `left`. `ConfigError` if clips were
    done with other settings, `InputError` if a clip has the name of another one that was done.
    """
    path = batch.folder / journal.CLEANED
    keep_others(path)
    records = journal.read_journal(path)
    done = any(record.get("state") == "done" for record in records)
    if done and (differ := setting_differences(records[0], settings)):
        raise ConfigError(
            f"{batch.folder}: holds results of other settings ({differ}); "
            "use the same settings, or name another folder"
        )
    if not records:
        keep_others(*(batch.folder / name for name in SUMMARY_FILES))
    known = {record["clip"]: record for record in records[1:] if "clip" in record}
    for clip in clips:
        described = clip.described()
        record = known.pop(clip.name, {})
        journal.refuse_namesake(record, clip.path, batch.folder)
        if record.get("state") != "done" or not is_done(record, described, batch.folder):
            record = {"clip": clip.name, "state": "left", "asked": described}
        known[clip.name] = record  # after the records of other clips, in the order of `clips`
    return known


def outcome_in(record: dict[str, Any]) -> CleaningOutcome:
    """The outcome in a journal record."""
    held = CleaningOutcome(**{field.name: record[field.name] for field in fields(CleaningOutcome)})
    return replace(held, hands=[with_nan(hand) for hand in held.hands])


def _settings_of(batch: BatchOptions) -> dict[str, Any]:
    """The settings on which the results of all clips depend; they identify a run."""
    return {
        "options": as_dict(batch.options),
        "reading": {name: str(value) for name, value in batch.reading.items()},
        "weights": file_digests(all_weights(batch.options.weights)),
    }
