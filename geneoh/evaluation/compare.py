"""One recording, many noisy twins: what each way of cleaning leaves of the error."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.errors import InputError
from geneoh.evaluation.filters import best_window
from geneoh.fitting.fit import FitConfig, fit_hand, start_from_keypoints
from geneoh.geometry.distance import SurfaceDistance
from geneoh.hand.library import load_hand
from geneoh.metrics.accuracy import mpjpe
from geneoh.metrics.frames import mean_over_frames
from geneoh.metrics.report import measure
from geneoh.pipeline.denoise import Options, denoise
from geneoh.pipeline.person import person_of
from geneoh.sequence.files import load_sequence
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.noise import Noise, corrupt_sequence
from geneoh.sequence.tracks import Sequence

TwinNoise = Noise | Literal["clean"]
"""A noise, or the recording itself: what a cleaner does to a track that needs little cleaning."""


@dataclass(frozen=True)
class Score:
    """One way of cleaning on one noisy twin; all but `mpjpe_mm` need no ground truth."""

    noise: str
    seed: int
    row: str
    mpjpe_mm: float
    """Mean keypoint error over all frames; of the input over its observed frames."""
    acceleration_mm: float
    """Mean acceleration of the keypoints, mm per frame squared."""
    penetration_mm: float
    """Depth of the deepest vertex, mean over frames."""
    consistency_mm2: float


@dataclass(frozen=True)
class Twin:
    """A noisy version of the recording."""

    noise: str
    seed: int
    sequence: Sequence


def drawn_twins(clean: Sequence, noises: Iterable[TwinNoise], seeds: int) -> Iterator[Twin]:
    """Twins made here, by the noises of `geneoh corrupt`; "clean" is the recording itself."""
    for noise in noises:
        if noise == "clean":
            yield Twin("clean", 0, clean)
            continue
        for seed in range(seeds):
            generator = torch.Generator().manual_seed(seed)
            yield Twin(noise, seed, corrupt_sequence(clean, noise, generator=generator))


def stored_twins(
    clean: Sequence, folder: Path, noises: Iterable[TwinNoise], seeds: int
) -> Iterator[Twin]:
    """Twins read from `folder`/NOISE_SEED.npz, which hold the same frames as the recording."""
    for noise in noises:
        if noise == "clean":
            yield Twin("clean", 0, clean)
            continue
        for seed in range(seeds):
            path = folder / f"{noise}_{seed}.npz"
            sequence = load_sequence(path, clean.object.meshes)
            if sequence.frames != clean.frames:
                raise InputError(
                    f"{path}: expected {clean.frames} frames as the recording has, "
                    f"got {sequence.frames}; use twins of this recording"
                )
            yield Twin(noise, seed, sequence)


def compare(
    clean: Sequence,
    twins: Iterable[Twin],
    options: Iterable[Options],
    *,
    on_score: Callable[[Score], None] | None = None,
) -> list[Score]:
    """Score the input, the best filters and every given way of cleaning on every twin.

    The filters' windows are chosen per twin with the ground truth in hand, which no user has. The
    mesh of each row is our hand fitted to its keypoints without looking at the object, except for
    our own rows, whose mesh is their result.
    """
    truth = fill_gaps(clean.hands[0]).joints
    assert truth is not None, "the recording has keypoints"
    fields_ = tuple(SurfaceDistance(mesh) for mesh in clean.object.meshes)
    scores: list[Score] = []

    def add(twin: Twin, row: str, joints: Tensor, verts: Tensor | None, valid: Tensor) -> None:
        if verts is None:
            verts = _mesh(twin.sequence, joints)
        motion = clean.object
        report = measure(
            verts, joints, fields_, motion.rotation, motion.translation, clean.fps, valid
        )
        off = mpjpe(joints, truth)
        score = Score(
            twin.noise,
            twin.seed,
            row,
            1000 * float(mean_over_frames(off, valid)),
            report.acceleration_mm,
            report.penetration_mean_mm,
            report.consistency_mm2,
        )
        scores.append(score)
        if on_score is not None:
            on_score(score)

    for twin in twins:
        hand = twin.sequence.hands[0]
        everywhere = torch.ones_like(hand.valid)
        joints = fill_gaps(hand).joints
        assert joints is not None, "the comparison needs keypoints"
        add(twin, "input", joints, None, hand.valid)
        for on in ("keypoints", "parameters"):
            _, filtered = best_window(hand, truth, on=on)
            add(twin, f"best filter on {on}", filtered, None, everywhere)
        for chosen in options:
            result = denoise(twin.sequence, replace(chosen, seed=twin.seed))
            track = result.hands[hand.side].track
            assert track.joints is not None, "results carry keypoints"
            verts = result_verts(result.sequence)
            add(twin, f"geneoh {chosen.preset}", track.joints, verts, everywhere)
    return scores


def result_verts(sequence: Sequence) -> Float[Tensor, "T V 3"]:
    """Vertices of a cleaned sequence's first hand."""
    hand = sequence.hands[0]
    assert hand.pose is not None, "results carry a pose"
    assert hand.wrist is not None, "results carry a wrist"
    assert hand.betas is not None, "results carry betas"
    return load_hand(hand.side).shaped(hand.betas).posed(hand.pose, hand.wrist).verts


def _mesh(sequence: Sequence, joints: Float[Tensor, "T 21 3"]) -> Float[Tensor, "T V 3"]:
    """Our hand of the twin's person, fitted to keypoints alone."""
    hand = sequence.hands[0]
    model = load_hand(hand.side)
    person = person_of(hand, model)
    start = person.start or start_from_keypoints(joints[None], person.shaped)
    state = fit_hand(
        joints[None],
        torch.ones_like(joints[None, ..., 0]),
        person.shaped,
        start,
        config=FitConfig(steady_finger=0.2, steady_wrist=0.0),
    )
    return person.shaped.verts_from_rotations(state.rotations, state.wrist).verts[0]


def table(scores: list[Score]) -> list[str]:
    """Means and standard deviations over seeds as lines of text, one block per noise."""
    lines = [f"{'noise':<13}{'':<27}{'MPJPE mm':>14}{'accel mm/f²':>14}{'depth mm':>14}"]
    for noise in dict.fromkeys(score.noise for score in scores):
        of_noise = [score for score in scores if score.noise == noise]
        for row in dict.fromkeys(score.row for score in of_noise):
            cells = ""
            for name in ("mpjpe_mm", "acceleration_mm", "penetration_mm"):
                values = torch.tensor([getattr(s, name) for s in of_noise if s.row == row])
                deviation = values.std(correction=0)
                cells += f"{values.mean():>8.1f} ±{deviation:>4.1f}"
            lines.append(f"{noise:<13}{row:<27}{cells}")
    return lines
