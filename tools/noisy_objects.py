"""Measure cleaning against noisy objects: `python -m tools.noisy_objects TABLE`.

TABLE is `guard` (every noise of the hand with every noise of the object, against the input and the
tuned filter) or `alone` (the hand without its object). Clips are the example recording and
synthetic interactions with held-out families. Prints the tables of docs/objects.md: mean keypoint
error in mm / mean acceleration of the keypoints in mm per frame squared.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.baselines.filters import TUNED, filtered
from geneoh.choices import NOISES, OBJECT_NOISES
from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.objects.cleaning import clean_object
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.readers.npz_files import load
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.object_noise import corrupt_object
from geneoh.sequence.sequence import ObjectTrack, Sequence
from geneoh.synthesis.shards import seed_of

EXAMPLES = Path(__file__).parents[1] / "examples"
FAMILIES = ("mug",)
"""Of the synthetic clips, one each; none was trained on."""
FRAMES = 60

Score = Float[np.ndarray, " 2"]


def clips() -> Iterator[Sequence]:
    """The recording and the synthetic clips."""
    yield load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")
    for index, family in enumerate(FAMILIES):
        yield draw_clip(family, index, FRAMES)


def score(joints: Float[Tensor, "T 21 3"] | None, clean: Sequence) -> Score:
    """Mean error in mm, and acceleration in mm per frame squared."""
    truth = clean.hands[0].joints
    assert joints is not None, "every result has joints"
    assert truth is not None, "every clip has joints"
    bends = joints.diff(n=2, dim=0)
    return np.array([1e3 * float(v.norm(dim=-1).mean()) for v in (joints - truth, bends)])


def drawn(noise: str, kind: str, *names: object) -> torch.Generator:
    """The random numbers of one case."""
    return torch.Generator().manual_seed(seed_of(noise, kind, *names))


def corrupted(clean: Sequence, noise: str, seed: int) -> Sequence:
    """A clip with a noisy hand, or as it is."""
    if noise == "clean":
        return clean
    return corrupt_sequence(clean, noise, generator=drawn("hand", noise, clean.source, seed))


def with_noisy_object(sequence: Sequence, kind: str, seed: int) -> Sequence:
    """A clip with a noisy object, or as it is."""
    if kind == "exact":
        return sequence
    return corrupt_object(sequence, kind, generator=drawn("object", kind, sequence.source, seed))


def rows(
    kinds: tuple[str, ...], options: Options, recordings: list[Sequence], seed: int = 0
) -> Iterator[str]:
    """One line of a table per noise of the hand, the mean over the clips."""
    yield f"| noise | input | filter | {' | '.join(kinds)} |"
    yield "|---" * (3 + len(kinds)) + "|"
    for noise in ("clean", *NOISES):
        found = []
        for clean in recordings:
            noisy = corrupted(clean, noise, seed)
            hand = noisy.hands[0]
            filter_ = filtered(hand, TUNED["savgol", "parameters"], "parameters", noisy.fps)
            scores = [score(fill_gaps(hand).joints, clean), score(filter_, clean)]
            for kind in kinds:
                result = denoise(with_noisy_object(noisy, kind, seed), replace(options, seed=seed))
                scores.append(score(result.sequence.hands[0].joints, clean))
            found.append(scores)
        cells = " | ".join(f"{error:.1f} / {bend:.1f}" for error, bend in np.mean(found, 0))
        yield f"| {noise} | {cells} |"


def off(motion: ObjectTrack, truth: ObjectTrack) -> Float[Tensor, " T"]:
    """Mean distance in mm of an object's vertices from where they truly are."""
    verts = truth.meshes[0].verts
    places = [t.rotation[:, 0] @ verts.T + t.translation[:, 0, :, None] for t in (motion, truth)]
    return 1e3 * (places[0] - places[1]).norm(dim=1).mean(-1)


def refined(seeds: int = 2) -> Iterator[str]:
    """How far an object is off as given, smoothed, and refined with a hand under noise; mm."""
    yield "| clip | noise of the object | input | smoothed | refined | hand at object | after |"
    yield "|---|---|---|---|---|---|---|"
    for clean in clips():
        for kind in OBJECT_NOISES:
            found = []
            for seed in range(seeds):
                noisy = with_noisy_object(corrupted(clean, "gauss", seed), kind, seed)
                result = denoise(noisy, Options(seed=seed, refine_object=True, preset="fast"))
                smooth, done = clean_object(noisy.object, noisy.fps)[0], result.sequence
                tracks = [noisy.object, smooth, done.object]
                errors = [float(off(t, clean.object).mean()) for t in tracks]
                truth = at_object(clean)
                apart = [1e3 * (at_object(s) - truth).norm(dim=-1).mean() for s in (noisy, done)]
                found.append([*errors, *map(float, apart)])
            cells = " | ".join(f"{value:.1f}" for value in np.mean(found, 0))
            yield f"| {clean.source.split(' (')[0]} | {kind} | {cells} |"


def at_object(sequence: Sequence) -> Float[Tensor, "T 21 3"]:
    """The hand's keypoints in the frame of the object's first part."""
    joints, motion = sequence.hands[0].joints, sequence.object
    assert joints is not None, "every clip has joints"
    return (joints - motion.translation[:, :1]) @ motion.rotation[:, 0]


def main(table: str) -> Iterator[str]:
    """The lines of a table by its name."""
    if table == "guard":
        yield from rows(("exact", *OBJECT_NOISES), Options(preset="fast"), [next(clips())])
    elif table == "alone":
        yield from rows(("exact",), Options(without=("mesh",)), list(clips()))
    elif table == "refined":
        yield from refined()
    else:
        raise SystemExit("usage: python -m tools.noisy_objects guard|alone|refined")


if __name__ == "__main__":
    for line in main(*sys.argv[1:]):
        print(line, flush=True)
