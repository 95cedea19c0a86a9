"""Scoring of a generator of hands on held-out bodies and sentences."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.body.motion import BodyMotion
from geneoh.body.skeleton import BODY_JOINTS
from geneoh.bundle import concatenated, spread
from geneoh.choices import BODY_STAGES, STEPS
from geneoh.evaluation.generation.report import GenerationReport
from geneoh.evaluation.generation.runner import about_repetitions, row_generator
from geneoh.evaluation.generation.scores import CLIPS, REAL, REPETITIONS, repeat
from geneoh.evaluation.gestures.encoder import (
    POOL,
    EncoderConfig,
    EncoderTask,
    GestureEncoder,
    Seen,
)
from geneoh.evaluation.gestures.scores import MEASURES, SCORES, ScoredHands, range_of, score_hands
from geneoh.files.fingerprints import file_digest, file_digests, package_versions
from geneoh.generators.both2hands.features import with_other_fingers
from geneoh.generators.both2hands.library import (
    Both2HandsNetworks,
    both2hands_weights,
    load_both2hands,
)
from geneoh.generators.both2hands.limits import FingerRange
from geneoh.generators.both2hands.sampling import Both2HandsSampling, Branch, sample_hands
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.progress import OnProgress, OnStep, steps
from geneoh.synthesis.gestures.clips import Gestures
from geneoh.synthesis.gestures.shards import read_gestures
from geneoh.training.loop import trained

SHUFFLED = "shuffled hands"
BRANCHES: dict[str, Branch] = {"body only": "body", "text only": "text", "blended": "blended"}
FOLDER = "encoder"  # subfolder of the encoder in the output folder
BATCH = 16  # clips that are sampled together


@dataclass(frozen=True)
class GestureOptions:
    """Options of the evaluation of a generator of hands."""

    data: Path
    """Folder of shards of bodies, made by `geneoh synthesize --bodies`: the encoder is trained on
    its training clips; the conditions are its validation clips, of held-out bodies and ways of
    making gestures."""
    limit: int = CLIPS  # largest number of validation clips, spread over all of them
    weights: Path | None = None
    """Folder of weights from `geneoh train`; for networks that it lacks, shipped ones are used."""
    seed: int = 0
    repetitions: int = REPETITIONS
    steps: int = STEPS  # denoising steps
    prompts: int = 16  # conditions for which several hands are generated (multimodality)
    answers: int = 6  # hands for each of these conditions
    encoder: EncoderConfig = field(default_factory=EncoderConfig)


@dataclass(frozen=True)
class Conditions:
    """The real clips with one sentence each, the encoder and the range of finger joints."""

    real: Gestures
    sentences: list[str]
    texts: Float[Tensor, "B F"]  # features of the sentences
    model: GestureEncoder
    fingers: FingerRange  # of the training clips

    def scored(
        self, motion: BodyMotion, several: Float[Tensor, "P S F"] | None = None
    ) -> ScoredHands:
        """The features and measures of hands for these conditions; see `score_hands`."""
        return score_hands(self.model, self.real, motion, self.texts, self.fingers, several)


def evaluate_gestures(
    options: GestureOptions,
    folder: Path,
    *,
    command: str = "",
    on_progress: OnProgress | None = None,
) -> GenerationReport:
    """Score every row; the encoder is kept in a subfolder of `folder` for later runs.

    Raises:
        InputError: the data is missing, or holds no complete shards of bodies.
        CheckpointError: weights are missing, or the folder holds an encoder of other data.
    """
    training, held_out = (read_gestures(options.data, split) for split in ("train", "val"))
    networks = load_both2hands(options.weights)
    task = EncoderTask(options.encoder, training, held_out)
    model = trained(task, folder / FOLDER, on_step=on_progress and partial(on_progress, FOLDER))
    chosen = conditions(options, task, model)
    real = chosen.real
    seen = Seen.of(real), task.seen
    wrong = shuffled(real, generator=row_generator(options.seed, "shuffled"))
    scored = {
        REAL: chosen.scored(real.motion),
        SHUFFLED: chosen.scored(wrong),
        "mean pose": chosen.scored(mean_pose(real, training)),
        "nearest training body": chosen.scored(nearest_body(real, training, seen)),
    }
    for name, branch in BRANCHES.items():
        report = on_progress and partial(on_progress, name)
        scored[name] = network_row(networks, chosen, branch, options, report)
    rows = repeat(scored, seed=options.seed, repetitions=options.repetitions, scores=SCORES)
    settings = _settings_of(options, task, folder, len(real.body))
    about = _about_run(settings, _told_apart(scored[REAL], scored[SHUFFLED]))
    return GenerationReport(settings, command, rows, measures=MEASURES, about=about)


def conditions(options: GestureOptions, task: EncoderTask, model: GestureEncoder) -> Conditions:
    """At most `options.limit` validation clips, evenly spread, with a random sentence each."""
    held_out = task.validation
    count = min(options.limit, len(held_out.body))
    real = held_out.take(spread(len(held_out.body), count), "B")
    generator = row_generator(options.seed, "sentences")
    which = torch.randint(real.joined.shape[1], (count,), generator=generator).tolist()
    sentences = [str(each[n]) for each, n in zip(real.joined, which, strict=True)]
    texts = model.sentences(task.numbers(sentences))
    return Conditions(real, sentences, texts, model, range_of(task.clips))


def network_row(
    networks: Both2HandsNetworks,
    chosen: Conditions,
    branch: Branch,
    options: GestureOptions,
    on_step: OnStep | None,
) -> ScoredHands:
    """The row of the networks: one sample for every condition, and several for some."""
    generator = row_generator(options.seed, "both2hands")
    config = Both2HandsSampling(steps=options.steps, branch=branch)
    make = partial(made_by_networks, networks, config=config, generator=generator)
    motion = make(chosen.real, chosen.sentences, on_step=on_step)
    prompts = min(options.prompts, len(chosen.sentences))
    some = torch.arange(prompts).repeat_interleave(options.answers)
    again = chosen.real.take(some, "B")
    made = make(again, [chosen.sentences[n] for n in some.tolist()])
    several = chosen.model.motions(Seen.moved(again, made)).unflatten(0, (prompts, options.answers))
    return chosen.scored(motion, several)


def shuffled(real: Gestures, *, generator: torch.Generator) -> BodyMotion:
    """Every body with the hands of another clip."""
    order = torch.randperm(len(real.body), generator=generator)
    other = torch.empty_like(order)
    other[order] = order.roll(1)
    return _hands_of(real, real, other)


def mean_pose(real: Gestures, training: Gestures) -> BodyMotion:
    """Every body with the constant mean finger pose of the training clips."""
    mean = training.pose[training.before_end][:, BODY_JOINTS:].mean(0)
    fingers = axis_angle_to_matrix(mean).expand(*real.pose.shape[:2], -1, -1, -1)
    return with_other_fingers(real.motion, fingers)


def nearest_body(real: Gestures, training: Gestures, seen: tuple[Seen, Seen]) -> BodyMotion:
    """Every body with the hands of the training clip whose body motion is nearest.

    `seen` are the encoder inputs of both; body features are divided by their standard deviation.
    """
    scale = seen[1].body.flatten(0, 1).std(0).clamp(min=1e-3)
    own, known = ((each.body / scale).flatten(1) for each in seen)
    return _hands_of(real, training, torch.cdist(own, known).argmin(1))


def _hands_of(real: Gestures, source: Gestures, which: Int[Tensor, " B"]) -> BodyMotion:
    """The real bodies with the finger poses of clips `which` of `source`."""
    fingers = axis_angle_to_matrix(source.pose[which][:, :, BODY_JOINTS:])
    return with_other_fingers(real.motion, fingers)


def made_by_networks(
    networks: Both2HandsNetworks,
    real: Gestures,
    sentences: Sequence[str],
    *,
    config: Both2HandsSampling,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> BodyMotion:
    """Hands that the networks generate for the real bodies with one sentence each."""
    parts = []
    for start in steps(range(0, len(sentences), BATCH), on_step):
        some = real.take(slice(start, start + BATCH), "B")
        texts = sentences[start : start + BATCH]
        inputs = some.motion, some.skeleton, texts
        parts.append(sample_hands(networks, *inputs, config, generator=generator))
    return concatenated(parts, "B")


def _told_apart(real: ScoredHands, wrong: ScoredHands) -> float:
    """Share of sentences that are nearer to their real clip than to its body with wrong hands."""
    apart, other = ((each.texts - each.features).norm(dim=-1) for each in (real, wrong))
    return float((apart < other).float().mean())


def _settings_of(
    options: GestureOptions, task: EncoderTask, folder: Path, clips: int
) -> dict[str, Any]:
    """The settings on which the scores depend."""
    made = file_digest([folder / FOLDER / f"{task.name}.safetensors"])
    record = {name: value for name, value in task.record().items() if name != "tokenizer"}
    return {
        "data": str(options.data.resolve()),
        "clips": clips,
        "seed": options.seed,
        "steps": options.steps,
        "repetitions": options.repetitions,
        "encoder": {**record, "hash": made},
        "weights": file_digests(both2hands_weights(name, options.weights) for name in BODY_STAGES),
        "versions": package_versions(),
    }


def _about_run(settings: dict[str, Any], apart: float) -> tuple[str, ...]:
    """Remarks below the table: on the clips, repetitions and the encoder."""
    encoder = settings["encoder"]
    chance = " / ".join(f"{100 * n / POOL:.1f}" for n in (1, 2, 3))
    return (
        f"{settings['clips']} clips of held-out bodies and ways of making gestures; "
        f"{about_repetitions(settings)} By chance R@1, 2, 3 are {chance}%.",
        f"The encoder is ours (seed {encoder['config']['seed']}, {encoder['clips']} clips, hash "
        f"{encoder['hash']}): scores under another one, such as the paper's, cannot be compared. "
        f"It tells {100 * apart:.1f}% of the real clips from the same bodies with others' hands.",
    )
