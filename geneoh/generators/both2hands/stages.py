"""Training tasks of the networks of BOTH2Hands, by the stage names of `geneoh train`."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

import torch
from tokenizers import Tokenizer

from geneoh.choices import BodySource, BodyStage
from geneoh.generators.both2hands.library import (
    Speech,
    load_branches,
    reader_of,
    refuse_other_scales,
)
from geneoh.generators.both2hands.networks import BodyHands, HandsConfig
from geneoh.generators.both2hands.recorded import recorded_gestures
from geneoh.generators.both2hands.training import Both2HandsConfig, HandsTask
from geneoh.generators.text import foreign_encoder, learned_pieces, vocabulary_of
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.nn.weights import load_network
from geneoh.progress import OnProgress
from geneoh.synthesis.gestures.clips import Gestures
from geneoh.synthesis.gestures.shards import DEFAULTS, read_gestures
from geneoh.training.data import Learned, TrainingData, made_data
from geneoh.training.run_config import stage_config


def gesture_data(
    learned: Learned, stage: BodyStage, on_progress: OnProgress | None
) -> TrainingData[Gestures]:
    """The clips; of recordings only those with sentences, unless the stage needs none."""
    source, path = learned.data.source, learned.data.path
    if not source:
        return made_data(path, read_gestures, DEFAULTS)
    return recorded_gestures(
        cast(BodySource, source),
        path,
        model=learned.skeleton,
        with_text=stage != "body_hands",
        on_step=on_progress and partial(on_progress, source),
    )


def body_task(
    stage: BodyStage,
    config: Path | None,
    settings: Sequence[str],
    learned: Learned,
    on_progress: OnProgress | None = None,
) -> tuple[HandsTask, tuple[str, ...]]:
    """The task of `geneoh train --stage` and notes on its data; `settings` override the file.

    `settings` are texts such as `a.b=c`. The blend uses the two networks in the folder, or the
    shipped ones. The text network takes scale and noise from `body_hands` in the folder, as one
    reverse process needs, unless it starts from weights, which have a scale.

    Raises:
        InputError: there are no clips.
        CheckpointError: weights in the folder do not fit their network.
        ConfigError: the file cannot be read, or a setting is unknown or of the wrong type.
    """
    chosen = stage_config(Both2HandsConfig(), stage, config, settings)
    data = gesture_data(learned, stage, on_progress)
    folder, text_encoder = learned.folder, learned.text_encoder
    tokenizer, branches = None, None
    if stage == "body_hands":
        speech = _silence
    elif stage == "blend":
        branches = load_branches(folder, text_encoder=text_encoder)
        speech = branches.speech
        if chosen.blend.form == "ours":
            refuse_other_scales(branches, folder)
    elif text_encoder is not None:
        encoder = foreign_encoder(text_encoder)
        speech = cast(Speech, encoder.encode)
        chosen = replace(chosen, text_hands=replace(chosen.text_hands, text=encoder.width))
    else:
        chosen = replace(chosen, text_hands=replace(chosen.text_hands, text=0))
        pieces, start = chosen.text_hands.words.pieces, learned.start
        if start:
            tokenizer = vocabulary_of(load_checkpoint(start).record, start)
        else:
            tokenizer = sentence_vocabulary(data.training, pieces)
        speech = reader_of(tokenizer, chosen.text_hands)
    task = HandsTask(stage, chosen, data, speech, tokenizer, branches)
    path = folder / "body_hands.safetensors"
    if stage == "text_hands" and learned.start is None and path.is_file():
        return scaled_as(path, task, data.notes)
    return task, data.notes


def scaled_as(
    path: Path, task: HandsTask, notes: tuple[str, ...]
) -> tuple[HandsTask, tuple[str, ...]]:
    """The task with the scale and the noise of the body's network in `path`, and a note on it.

    Networks that differ in the frame or the scaling of hands are not blended in one reverse
    process: then the task stays as it is.
    """
    body, own = load_network(path, BodyHands, HandsConfig), task.config.text_hands
    if (body.config.frame, body.config.scaling) != (task.frame, own.scaling):
        return task, notes
    config = replace(task.config, text_hands=replace(own, noise=body.config.noise))
    note = f"scale and noise of hands are those of {path}, for the blend of both"
    return replace(task, config=config, scale=body.scale), (*notes, note)


def sentence_vocabulary(clips: Gestures, pieces: int) -> Tokenizer:
    """At most `pieces` pieces of words, learned on all sentences of clips."""
    sentences = [clips.left, clips.right, clips.joined.ravel()]
    return learned_pieces((str(each) for some in sentences for each in some), pieces)


def _silence(sentences: Sequence[str]) -> torch.Tensor:
    """Empty vectors, for the network that has no text condition."""
    return torch.zeros(len(sentences), 0)
