"""Training clips from the user's recordings of bodies: windows with the sentences on them.

Source: BOTH2Hands, section 3 (clips of five seconds), and its code: 30 frames a second. Ours: every
window of a recording and not only the first, shorter recordings too, and whole recordings held out
for validation.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.body.motion import BodyMotion, grounded
from geneoh.body.skeleton import BODY_JOINTS
from geneoh.bundle import concatenated
from geneoh.choices import BodySource
from geneoh.errors import GeneOHError, InputError, numbered
from geneoh.generators.both2hands.features import placed
from geneoh.generators.both2hands.windows import FRAMES, ClipWindows
from geneoh.generators.text import words_of
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.progress import OnStep, steps
from geneoh.readers.bodies.base import BodyRecording, body_at_rate
from geneoh.readers.bodies.data_sets import SourceBody, body_files, read_source_bodies
from geneoh.synthesis.actions.action import FPS
from geneoh.synthesis.gestures.clips import Gestures
from geneoh.training.data import TrainingData
from geneoh.training.held_out import held_names

SHORTEST_RECORDING = 30  # frames of the shortest recording that is used
STILL_FINGERS = 1e-3
"""Largest change of rotation entries for which fingers count as not recorded, but left at rest."""


@dataclass(frozen=True)
class Window:
    """One window of a recording, with the sentences on it."""

    clip: Gestures  # a batch of one, without its sentences
    sentences: tuple[str, ...]
    group: str  # recording or person, which is held out as a whole


def recorded_gestures(
    source: BodySource,
    path: Path,
    *,
    model: Path | None = None,
    with_text: bool = True,
    on_step: OnStep | None = None,
) -> TrainingData[Gestures]:
    """The clips of a body data set in a folder or file; if `with_text`, only those with sentences.

    The bones are those of `model`, the user's SMPL-H or SMPL-X model, else of a typical adult.

    Raises:
        InputError: no file can be read, or none holds a clip to learn from.
    """
    left_out: Counter[str] = Counter()
    windows: list[Window] = []
    problems: list[str] = []
    for file in steps(body_files(source, path), on_step):
        try:
            for each in read_source_bodies(source, file, model):
                windows += windows_of(each, with_text, left_out)
        except GeneOHError as error:
            problems.append(f"not read, {error}")
    reasons = ", ".join(f"{count} {reason}" for reason, count in left_out.items())
    if not any(window.sentences or not with_text for window in windows):
        if problems and not left_out:
            raise InputError(problems[0].removeprefix("not read, "))
        wanted = "fingers and sentences on them" if with_text else "fingers"
        raise InputError(
            f"{path}: expected recordings of {source} with {wanted}, got none ({reasons}); check "
            "that the data set is whole"
        )
    groups_held = held_names([[window.group for window in windows]])
    held = torch.tensor([window.group in groups_held for window in windows])
    kept = [n for n, window in enumerate(windows) if window.sentences or not with_text]
    windows, held = [windows[n] for n in kept], held[kept]
    clips, divided = _joined(windows), bool(held.any() and not held.all())
    parts = [clips.take(some, "B") for some in ((~held, held) if divided else (slice(None),) * 2)]
    split = "validated on the training data: there is no other recording"
    if divided:
        groups = len({window.group for window, out in zip(windows, held, strict=True) if out})
        of = "1 recording or person" if groups == 1 else f"{groups} recordings or people"
        split = f"{numbered(int(held.sum()), 'clip')}, of {of}, held out for validation"
    about = f"{source}: {len(windows)} clips; {split}; recordings left out: {reasons or 'none'}"
    made = {"source": source, "clips": len(windows), "skeleton": model is not None}
    return TrainingData(parts[0], parts[1], made, (about, *problems))


def windows_of(each: SourceBody, with_text: bool, left_out: Counter[str]) -> list[Window]:
    """The windows of a recording; if it cannot be used, `left_out` counts the reason.

    Windows without sentences are included, so that `with_text` does not change the split.
    """
    paced = body_at_rate(each.body, FPS)
    reason = reason_against(paced)
    found = [] if reason else list(cut(each, paced))
    if with_text and found and not any(window.sentences for window in found):
        reason = "without sentences"
    if reason:
        left_out[reason] += 1
    return found


def reason_against(body: BodyRecording) -> str:
    """The reason why a recording cannot be used, in words; empty if it can."""
    fingers = body.motion.rotations[:, BODY_JOINTS:]
    if not body.has_fingers:
        return "without fingers"
    if bool((fingers - fingers[:1]).abs().max() < STILL_FINGERS):
        return "whose fingers never move"
    return "" if body.frames >= SHORTEST_RECORDING else f"of fewer than {SHORTEST_RECORDING} frames"


def cut(each: SourceBody, paced: BodyRecording) -> Iterator[Window]:
    """The windows of a recording at 30 frames a second, each with the sentences on the recording
    and on the window's first, middle and last frame."""
    motion, count = grounded(paced.skeleton, paced.motion), min(paced.frames, FRAMES)
    for start in ClipWindows.of(max(paced.frames, FRAMES)).starts:
        at = [round((start + share * (count - 1)) * each.body.fps / FPS) for share in (0, 0.5, 1)]
        shown = (each.by_frame.get(frame, "") for frame in at)
        texts = dict.fromkeys((*each.body.sentences, *shown))
        sentences = tuple(sentence for sentence in texts if words_of(sentence))
        clip = clip_of(paced.skeleton.offsets, motion[start : start + count])
        yield Window(clip, sentences, each.group)


def clip_of(offsets: Float[Tensor, "52 3"], motion: BodyMotion) -> Gestures:
    """A stretch of at most `FRAMES` frames as one clip of `FRAMES`, without gesture labels."""
    motion, frames = placed(motion, "world"), torch.arange(FRAMES).clamp(max=len(motion.root) - 1)
    unknown = torch.full((1, 2), -1)
    return Gestures(
        gesture=unknown,
        variant=unknown,
        body=unknown[:, 0],
        length=torch.tensor([len(motion.root)]),
        root=motion.root[None, frames],
        pose=matrix_to_axis_angle(motion.rotations)[None, frames],
        offsets=offsets[None],
        left=np.array([""]),
        right=np.array([""]),
        joined=np.array([[""]]),
    )


def _joined(windows: Sequence[Window]) -> Gestures:
    """All clips as one batch; sentences of a clip are repeated up to the largest number of any."""
    most = max(1, *(len(window.sentences) for window in windows))
    texts = [window.sentences or ("",) for window in windows]
    rows = [[each[n % len(each)] for n in range(most)] for each in texts]
    clips = concatenated((window.clip for window in windows), "B")
    return Gestures(**{**vars(clips), "joined": np.array(rows)})
