"""Scoring of a generator of actions on held-out objects, beside baselines."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import torch

from geneoh.bundle import concatenated, spread
from geneoh.choices import ActionDataset, Refiner
from geneoh.errors import ConfigError, numbered
from geneoh.evaluation.generation.classifier import (
    ActionClassifier,
    ClassifierConfig,
    ClassifierTask,
    classified,
)
from geneoh.evaluation.generation.measures import ClipMeasures, measure_clips
from geneoh.evaluation.generation.report import GenerationReport
from geneoh.evaluation.generation.rows import (
    BATCH,
    Drawn,
    draw_clips,
    joint_rests,
    nearest_training,
    refined,
    thinned,
)
from geneoh.evaluation.generation.scores import (
    CLIPS,
    REAL,
    REPETITIONS,
    SCORES,
    RowScores,
    ScoredClips,
    mean_scores,
    repeat,
)
from geneoh.files.fingerprints import file_digest, file_digests, package_versions
from geneoh.generators.text2hoi.learning.action_data import action_data
from geneoh.generators.text2hoi.learning.recorded import RecordedConfig
from geneoh.generators.text2hoi.learning.samples import ActionData
from geneoh.generators.text2hoi.networks.library import (
    Text2HoiNetworks,
    load_refiner,
    load_text2hoi,
    text2hoi_weights,
)
from geneoh.generators.text2hoi.networks.refiner import refined_by
from geneoh.generators.text2hoi.physics.resting import finished
from geneoh.progress import OnProgress, OnStep, part_of
from geneoh.readers.base import ReaderOptions
from geneoh.seeds import seeded_generator
from geneoh.streamed import Streamed
from geneoh.synthesis.action_shards import DEFAULTS, action_shard, read_actions
from geneoh.synthesis.actions.action import Actions
from geneoh.synthesis.shards import find_shards
from geneoh.training.data import DataSource, Learned
from geneoh.training.loop import trained

NETWORKS = ("text", "contact", "interaction", "refiner")
CLASSIFIERS = 5  # with different seeds: small differences under a single one may be accidental
FOLDER = "classifier"  # prefix of each classifier's subfolder in the output folder


@dataclass(frozen=True)
class GenerationOptions:
    """Options of the evaluation of a generator of actions."""

    data: Path
    """Folder of actions: the classifier is trained on its training clips, and its validation clips
    are the conditions."""
    dataset: ActionDataset = "synthetic"
    """Kind of the data: shards of `geneoh synthesize --actions`, whose validation clips are of
    held-out objects; or a data set with action labels, of which a subject is held out."""
    limit: int = CLIPS  # largest number of validation clips, spread over all of them
    refine: Refiner = "none"
    """ "geneoh" adds a row refined as by `geneoh generate`: hands are brought to the object and
    cleaned, which takes several seconds per clip."""
    weights: Path | None = None
    """Folder of weights from `geneoh train`; for networks that it lacks, shipped ones are used."""
    seed: int = 0
    repetitions: int = REPETITIONS
    mano: Path | None = None  # folder of the user's MANO, for data sets that need it
    recorded: RecordedConfig = field(default_factory=RecordedConfig)
    """How actions are cut out of recordings."""
    classifier: ClassifierConfig = field(default_factory=ClassifierConfig)
    """The configuration of the first classifier; the others have consecutive seeds."""
    classifiers: int = CLASSIFIERS  # number of classifiers whose mean scores are reported

    def __post_init__(self) -> None:
        if self.classifiers < 1:
            raise ConfigError(
                f"classifiers: expected at least 1, got {self.classifiers}; scores need one"
            )


Row = Callable[[OnStep | None], Actions]  # makes the clips of a row and reports its progress


def evaluate_generator(
    options: GenerationOptions,
    folder: Path,
    *,
    command: str = "",
    jobs: int = 1,
    on_progress: OnProgress | None = None,
) -> GenerationReport:
    """Score every row with every classifier; classifiers are kept in `folder` for later runs.

    `jobs` processes share the clips that are refined; this process does everything else.

    Raises:
        InputError: the data is missing, or holds no actions.
        CheckpointError: weights are missing, or the folder holds a classifier of other data.
    """
    networks = load_text2hoi(options.weights)
    training, held_out, notes = split_clips(options, folder, on_progress)
    validation = held_out.actions.take(slice(None))
    tasks = classifier_tasks(options, training, validation, len(held_out.verb_words))
    models = [
        trained(task, folder / name, on_step=on_progress and partial(on_progress, name))
        for name, task in tasks.items()
    ]
    count = min(options.limit, len(validation.verb))
    real = validation.take(spread(len(validation.verb), count), "B")
    rows: dict[str, Row] = {
        REAL: lambda _: real,
        "nearest training clip": lambda _: nearest_training(real, training),
    }
    alone = replace(held_out, actions=Streamed.of([real]))
    rows |= network_rows(networks, alone, options, jobs)
    measured = {}
    for name, clips in rows.items():
        report = on_progress and partial(on_progress, name)
        made = clips(part_of(report, 0, 2))
        measured[name] = made, measure_clips(made, part_of(report, 1, 2))
    found = mean_scores([scores_under(model, measured, options) for model in models])
    settings = _settings_of(options, tasks, folder, count)
    about = (*_about_run(settings), *about_moving_joints(measured), *notes)
    return GenerationReport(settings, command, found, about)


def about_moving_joints(measured: Mapping[str, tuple[Actions, ClipMeasures]]) -> tuple[str, ...]:
    """A remark with the measures of each row on the clips whose joint moves in the real clip."""
    real, _ = measured[REAL]
    clips = (real.take(slice(n, n + 1), "B") for n in range(len(real.verb)))
    moves = torch.tensor([not joint_rests(clip) for clip in clips])
    if not bool(moves.any()):
        return ()
    rows = []
    for name, (_, clip) in measured.items():
        shown = clip.moved_alone, clip.depth_mm, clip.deepest_mm, clip.contact
        alone, depth, deepest, contact = (float(v[moves].nanmean()) for v in shown)
        rows.append(
            f"{name} {100 * alone:.1f}% alone, {depth:.2f} mm deep, {deepest:.1f} mm at the "
            f"deepest, {100 * contact:.0f}% in contact"
        )
    return (f"Of {int(moves.sum())} clips whose joint moves: {'; '.join(rows)}.",)


def classifier_tasks(
    options: GenerationOptions, training: Actions, validation: Actions, verbs: int
) -> dict[str, ClassifierTask]:
    """One training task per classifier, which differ in their seeds, by subfolder."""
    first = options.classifier
    seeds = range(first.seed, first.seed + options.classifiers)
    return {
        f"{FOLDER}_{n}": ClassifierTask(replace(first, seed=n), training, validation, verbs)
        for n in seeds
    }


def scores_under(
    model: ActionClassifier,
    rows: Mapping[str, tuple[Actions, ClipMeasures]],
    options: GenerationOptions,
) -> dict[str, RowScores]:
    """The scores with one classifier of all rows, and of the real clips with permuted verbs."""
    scored = {}
    for name, (clips, measures) in rows.items():
        features, scores = classified(model, clips)
        scored[name] = ScoredClips(features, clips.verb, scores, measures)
    real, (_, *others) = scored[REAL], scored.items()
    order = torch.randperm(len(real.verb), generator=row_generator(options.seed, "random verbs"))
    random = replace(real, verb=real.verb[order])
    scored = {REAL: real, "random verbs": random, **dict(others)}
    return repeat(scored, seed=options.seed, repetitions=options.repetitions, scores=SCORES)


def network_rows(
    networks: Text2HoiNetworks, real: ActionData, options: GenerationOptions, jobs: int
) -> dict[str, Row]:
    """The rows of the networks, complete and ablated; all are sampled from the same noise."""
    made: dict[bool, Drawn] = {}
    refiner = load_refiner(options.weights)

    def make(on_step: OnStep | None, contact: bool = True, refine: bool = False) -> Actions:
        if contact not in made:  # several rows process the same sampled actions
            generator = row_generator(options.seed, "text2hoi")
            made[contact] = draw_clips(
                networks, real, generator=generator, contact=contact, on_step=on_step
            )
        drawn = made[contact]
        if not refine:
            return drawn.actions
        parts = (drawn.take(slice(n, n + BATCH), "B") for n in range(0, len(drawn.touched), BATCH))
        return concatenated([refined_by(refiner, p.actions, p.touched) for p in parts], "B")

    def mended(on_step: OnStep | None) -> Actions:
        drawn = make(None, refine=True)
        verbs = [real.verb_words[verb] for verb in drawn.verb.tolist()]
        return refined(drawn, verbs, seed=options.seed, jobs=jobs, on_step=on_step)

    rows: dict[str, Row] = {
        "text2hoi, no contact map": lambda on_step: finished(make(on_step, contact=False)),
        "text2hoi, not refined": lambda on_step: finished(make(on_step)),
        "text2hoi, paper's refiner": lambda on_step: finished(make(on_step, refine=True)),
    }
    return rows | ({"text2hoi": mended} if options.refine == "geneoh" else {})


def row_generator(seed: int, row: str) -> torch.Generator:
    """The random number generator of a row."""
    return seeded_generator(seed, "row", row)


def split_clips(
    options: GenerationOptions, folder: Path, on_progress: OnProgress | None
) -> tuple[Actions, ActionData, tuple[str, ...]]:
    """The training clips, of few points to save memory, the validation clips, and notes.

    Shards that are cut out of recordings are kept in `folder`.
    """
    if options.dataset == "synthetic":
        actions, names = read_actions(options.data, "val")
        shards = map(action_shard, find_shards(options.data, "train", DEFAULTS))
        return concatenated(map(thinned, shards), "B"), ActionData(actions, names), ()
    source = DataSource(options.data, options.dataset)
    readers = ReaderOptions(mano_dir=options.mano)
    split = action_data(Learned(source, folder, readers=readers), options.recorded, on_progress)
    return thinned(split.training.actions.take(slice(None))), split.validation, split.notes


def _settings_of(
    options: GenerationOptions, tasks: dict[str, ClassifierTask], folder: Path, clips: int
) -> dict[str, Any]:
    """The settings on which the scores depend."""
    first = next(iter(tasks.values()))
    hashes = {
        str(task.config.seed): file_digest([folder / name / f"{task.name}.safetensors"])
        for name, task in tasks.items()
    }
    return {
        "data": str(options.data.resolve()),
        "dataset": options.dataset,
        "clips": clips,
        "seed": options.seed,
        "refine": options.refine,
        "repetitions": options.repetitions,
        "classifier": {**first.record(), "hashes": hashes},
        "weights": file_digests(text2hoi_weights(name, options.weights) for name in NETWORKS),
        "versions": package_versions(),
    }


def _about_run(settings: dict[str, Any]) -> tuple[str, ...]:
    """Remarks below the table: on the clips, repetitions and classifiers."""
    classifier = settings["classifier"]
    hashes = classifier["hashes"]
    named = ", ".join(f"{seed} {mark}" for seed, mark in hashes.items())
    return (
        f"{settings['clips']} held-out clips; {about_repetitions(settings)}",
        f"Means under {numbered(len(hashes), 'classifier')} of our own, trained alike on "
        f"{classifier['clips']} clips (seed and hash: {named}): scores under another one, such as "
        "the paper's, cannot be compared. Realism is a definition of our own, too.",
    )


def about_repetitions(settings: dict[str, Any]) -> str:
    """Description of the cells of a table, as the end of a sentence."""
    return (
        f"means over {settings['repetitions']} repetitions, each with a random half of them as "
        "conditions, ± 95% intervals over other clips like these; FID is that to the other half."
    )
