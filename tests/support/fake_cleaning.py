"""A cleaning that only moves the hand: what a batch makes of its clips does not depend on it."""

import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from bad_inputs import BOX_CORNERS, good_arrays, write_mesh

import geneoh
from geneoh.batch import cleaning
from geneoh.batch.cleaning import BatchOptions, CleaningOutcome
from geneoh.batch.clips import BatchClip
from geneoh.metrics.report import InteractionReport
from geneoh.pipeline.results import Denoised, HandResult
from geneoh.sequence.sequence import Sequence

REPORT = InteractionReport(6, 1.0, 2.0, 0.5, 3.0, 0.5, float("nan"), 0.0)
PAUSE = "FAKE_CLEANING_PAUSE"
"""Environment variable with the seconds that a cleaning takes."""


def write_clips(folder: Path, count: int) -> None:
    """Clips that differ, each with the mesh of its name; the later ones are farther from it."""
    folder.mkdir(parents=True, exist_ok=True)
    for index in range(count):
        arrays = good_arrays()
        arrays["joints"] = arrays["joints"] + np.float32(0.001 * index)
        np.savez(folder / f"clip{index}.npz", **arrays)
        write_mesh(folder / f"clip{index}.obj", BOX_CORNERS)


def denoise(sequence: Sequence, options: geneoh.Options) -> Denoised:
    """Move the hand by its height and the seed, in millimetres."""
    time.sleep(float(os.environ.get(PAUSE, "0")))
    (hand,) = sequence.hands
    moved = 0.001 * (1 + options.seed) + float(hand.joints[0, 0, 2])
    track = replace(hand, joints=hand.joints + moved)
    frames = torch.zeros(sequence.frames)
    result = HandResult(
        track=track,
        filled=frames > 0,
        samples=track.joints[None],
        chosen=-1,
        before=REPORT,
        after=replace(REPORT, penetration_mean_mm=0.5),
        moved=moved,
        moved_most=2 * moved,
        windows=1,
        seconds={},
        notes=("a <note>",),
        contact=None,
        evidence=frames + 1,
    )
    clean = replace(sequence, hands=(track,))
    return Denoised(clean, {hand.side: result}, (), options)


def clean_clip(clip: BatchClip, batch: BatchOptions) -> CleaningOutcome:
    """As the real one, in a worker too; a clip beside which there is a file NAME.kill kills it."""
    cleaning.denoise = denoise
    if clip.path.with_suffix(".kill").exists():
        os.kill(os.getpid(), signal.SIGKILL)
    return cleaning.clean_clip(clip, batch)
