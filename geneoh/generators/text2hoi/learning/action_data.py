"""Training data of the networks of Text2HOI: synthetic actions, or the user's recordings.

Each recording becomes a shard on disk; the validation split is by subject.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from geneoh.bundle import concatenated
from geneoh.choices import ANNOTATED, AnnotatedSource
from geneoh.errors import ConfigError, InputError
from geneoh.files.tensors import all_tensors, opened_tensors
from geneoh.generators.text2hoi.learning.recorded import RecordedConfig, action_of, surface_of
from geneoh.generators.text2hoi.learning.samples import ActionData
from geneoh.generators.text2hoi.sentences.annotation import has_labels, label_files, labels_of
from geneoh.geometry.sampling import PartSamples
from geneoh.progress import OnProgress, OnStep
from geneoh.readers.base import ReaderOptions, SourceClip
from geneoh.readers.dataset_reader import frames_to_keep
from geneoh.readers.recordings import find_clips, source_named
from geneoh.streamed import Streamed
from geneoh.synthesis.action_shards import DEFAULTS, read_actions
from geneoh.synthesis.actions.action import Actions
from geneoh.training.data import Learned, TrainingData, made_data
from geneoh.training.kept_shards import Contents, files_of_clip, kept_shards

FORMAT = 1  # of the shards; raised where the same files give other actions


def action_data(
    learned: Learned, config: RecordedConfig, on_progress: OnProgress | None = None
) -> TrainingData[ActionData]:
    """Synthetic actions of a folder, or those of recordings, whose shards are kept in the folder
    of the networks.

    Raises:
        InputError: there are no actions, or files cannot be read.
        ConfigError: the source has no labels of actions, or there are settings of recordings for
            synthetic actions.
    """
    data = learned.data
    if not data.source:
        if config != RecordedConfig():
            raise ConfigError(
                "recorded: expected no settings of recordings with the made actions of "
                f"{data.path}, got some; leave them out"
            )
        return made_data(data.path, lambda *shards: ActionData(*read_actions(*shards)), DEFAULTS)
    if data.source not in ANNOTATED:
        raise ConfigError(
            f"--data {data.source}=...: expected {', '.join(ANNOTATED)}, whose recordings come "
            "with labels of actions, or a folder alone; choose one of them"
        )
    source = ANNOTATED[ANNOTATED.index(data.source)]
    return recorded_actions(
        source,
        data.path,
        data.shards_in(learned.folder / "recordings", "actions_"),
        config,
        learned.readers,
        on_step=on_progress and partial(on_progress, source),
    )


def recorded_actions(
    source: AnnotatedSource,
    path: Path,
    folder: Path,
    config: RecordedConfig,
    options: ReaderOptions,
    *,
    on_step: OnStep | None = None,
) -> TrainingData[ActionData]:
    """The labelled actions of a data set below a path, split into training and validation.

    Each recording becomes a shard in `folder`, which is reused while the recording's files stay the
    same. Notes report what was found, left out, and could not be read.

    Raises:
        InputError: no recording can be read, or none holds a labelled action.
        ConfigError: the subject to hold out has no clips.
    """
    recordings = Recordings(source, config, options)
    shards, problems = recordings.shards(path, folder, on_step)
    found: list[tuple[Actions, list[dict[str, str]]]] = []
    left_out: Counter[str] = Counter()
    for shard in shards:
        with opened_tensors(shard) as (file, record):
            left_out.update(record["left_out"])
            if record["labels"]:
                found.append((Actions(**all_tensors(file)), record["labels"]))
    reasons = ", ".join(f"{count} {reason}" for reason, count in left_out.items())
    if not found:
        raise InputError(
            f"{path}: expected labelled actions of {source}, found none "
            f"({reasons or 'no labels'}); check that the data set is whole"
        )
    labels = [label for _, of_shard in found for label in of_shard]
    verbs, names = (sorted({label[key] for label in labels}) for key in ("verb", "noun"))
    together = Streamed.of(
        replace(
            actions,
            verb=torch.tensor([verbs.index(label["verb"]) for label in of_shard]),
            name=torch.tensor([names.index(label["noun"]) for label in of_shard]),
        )
        for actions, of_shard in found
    )
    held, words = _held_out([label["subject"] for label in labels], config.held_out)
    parts = [
        ActionData(together.only(kept), tuple(names), tuple(verbs))
        for kept in ((~held, held) if bool(held.any()) else (~held, ~held))
    ]
    about = f"{source}: {len(labels)} actions of {len(names)} objects, {words}"
    notes = f"{about}; actions left out: {reasons or 'none'}", *problems
    made = recordings.wanted | {"source": source, "held_out": config.held_out}
    return TrainingData(parts[0], parts[1], made, notes)


def _held_out(subjects: list[str], chosen: str) -> tuple[Tensor, str]:
    """Mask of the actions of the held-out subject, and the words of the note on it."""
    known = sorted(set(subjects), key=lambda name: (len(name), name))
    if chosen and chosen not in known:
        raise ConfigError(
            f"recorded.held_out: expected one of {', '.join(known)}, got '{chosen}'; name another"
        )
    if len(known) < 2:
        none = torch.zeros(len(subjects), dtype=torch.bool)
        return none, "validated on the training data: there is no other subject"
    subject = chosen or known[-1]
    held = torch.tensor([name == subject for name in subjects])
    return held, f"{int(held.sum())} of {subject} held out for validation"


@dataclass(frozen=True)
class Recordings:
    """The recordings of a data set, and how actions are cut out of them."""

    source: AnnotatedSource
    config: RecordedConfig
    options: ReaderOptions
    surfaces: dict[tuple[str, ...], PartSamples] = field(default_factory=dict)
    """Surface points of the objects read so far, which are the same in all recordings."""

    @property
    def wanted(self) -> dict[str, Any]:
        """The settings that a shard depends on; the held-out subject is none of them."""
        settings = asdict(self.config)
        del settings["held_out"]
        return {"format": FORMAT, "recorded": settings}

    def shards(
        self, path: Path, folder: Path, on_step: OnStep | None
    ) -> tuple[list[Path], list[str]]:
        """The shards of all recordings, written where missing or outdated, and the failures."""
        clips = find_clips(source_named(self.source), [path])
        labelled = [clip for clip in clips if has_labels(self.source, clip)]
        if not labelled:
            raise InputError(
                f"{path}: expected labels of actions in action_label of camera 4, found none among "
                f"{len(clips)} clips; download the labels of all views"
            )
        return kept_shards(labelled, folder, self.wanted, self.files, self.contents, on_step)

    def files(self, clip: SourceClip) -> list[tuple[str, Path]]:
        """The files that the actions of a recording are made from, by name."""
        labels = ((path.name, path) for path in label_files(self.source, clip))
        return [*files_of_clip(clip, self.options), *labels]

    def contents(self, clip: SourceClip) -> Contents:
        """The labelled actions of one recording, their labels, and how many were left out."""
        found: list[Actions] = []
        labels: list[dict[str, str]] = []
        left_out: Counter[str] = Counter()
        for action, label in self.cut(clip):
            if isinstance(action, str):
                left_out[action] += 1
            else:
                found.append(action)
                labels.append(label)
        tensors = vars(concatenated(found, "B")) if found else {}
        return tensors, {"labels": labels, "left_out": dict(left_out)}

    def cut(self, clip: SourceClip) -> Iterator[tuple[Actions | str, dict[str, str]]]:
        """Each labelled stretch of a recording as an action, or the reason why it is not used."""
        labels = labels_of(self.source, clip)
        reader = source_named(self.source).reader()
        for parts in reader.parts(clip, self.options) if labels else ():
            names = {name.split("_")[1] for name in parts.meshes}
            of_object = [label for label in labels if label.object in names]
            if not of_object or parts.motion is None:
                continue
            sequence = reader.whole(parts, clip, self.options)[0].sequence
            key = tuple(mesh.sha256 for mesh in sequence.object.meshes)
            if key not in self.surfaces:
                self.surfaces[key] = surface_of(sequence.object.meshes, self.config.points)
            surface, up = self.surfaces[key], self.config.up
            seen = torch.from_numpy(frames_to_keep(parts))
            for label in of_object:
                words = {"verb": label.verb, "noun": label.noun, "subject": label.subject}
                yield action_of(sequence, label, surface, up, seen), words
