"""The probability that fingers touch: `python -m tools.finger_contact calibrate`, or `table 3`.

`calibrate` finds the constants of `geneoh.pipeline.touch` under which the true contact of made
clips is most probable. They have the object families that networks are trained on, under seeds of
their own. `table N` compares predicted and true contact on the example recording and on clips of
held-out families, over N seeds: the share of fingers and frames that touch; the F-score of contact
by the mesh of the input, by the mesh of the result, and by probabilities above a half; the Brier
score (mean squared error) of the probabilities, and that of always predicting the share.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from scipy.optimize import minimize
from torch import Tensor

from geneoh.bundle import Bundle, concatenated
from geneoh.choices import CASE_NOISES, NOISES, Dataset
from geneoh.evaluation.cases import Case, find_cases
from geneoh.evaluation.options import EvaluationOptions
from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.fitting.subject import subject_of
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics.contact import TOUCH, contact_agreement
from geneoh.pipeline import touch
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.pipeline.stages.alone import measure_hand
from geneoh.seeds import seed_of, seeded_generator
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.normalisation import normalised_hands
from geneoh.sequence.sequence import Sequence
from geneoh.synthesis.data_config import SynthesisConfig

CLIPS, FRAMES = 10, 60
"""Number of made clips to calibrate on, and their length in frames."""
MADE_LIMIT = 8
"""Number of made clips of the table."""
START = (0.1, 0.002, 0.001)
"""Where the search for `SPREAD_SHARE`, `LEAST_SPREAD` and `NEARER` begins."""


@dataclass(frozen=True)
class Contacts(Bundle):
    """Distances of fingers to the object of the input, the result and the truth, metres."""

    given: Float[Tensor, "T 5"]
    found: Float[Tensor, "T 5"]
    true: Float[Tensor, "T 5"]
    probability: Float[Tensor, "T 5"]
    spread: Float[Tensor, "T 5"]  # of the tips of the result

    @property
    def touching(self) -> Bool[Tensor, "T 5"]:
        """Which fingers touch in truth."""
        return self.true <= TOUCH


def compared(clean: Sequence, noisy: Sequence, seed: int) -> Contacts:
    """Clean a clip and compare the contacts of its fingers with the true ones."""
    result = denoise(noisy, Options(seed=seed))
    (hand,) = result.hands.values()
    assert hand.contact is not None, "these clips have objects"
    assert hand.track.joint_spread is not None, "the default preset draws several samples"
    given, found, true = map(finger_distances, (noisy, result.sequence, clean))
    tips = hand.track.joint_spread[:, sorted(TIP_KEYPOINTS)]
    return Contacts(given, found, true, hand.contact, tips)


def finger_distances(sequence: Sequence) -> Float[Tensor, "T 5"]:
    """Distance of each finger to the object, by the mesh of the embedded hand."""
    (hand,) = normalised_hands(sequence)
    subject, surface = subject_of(hand.track, load_hand("right")), hand.object.surface()
    state = subject.parameters()
    inputs = state, subject.shaped, subject.joints, surface, hand.fps, hand.track.observed
    _, apart = measure_hand(*inputs, within=touch.EXACT_WITHIN)
    assert apart is not None, "there is an object"
    return apart


def calibrate() -> Iterator[str]:
    """Find the constants."""
    families, every = SynthesisConfig().common, []
    for index in range(CLIPS):
        clean = draw_clip(families[seed_of("touch", index) % len(families)], 2000 + index, FRAMES)
        for noise in NOISES:
            generator = seeded_generator("touch", index, noise)
            noisy = corrupt_sequence(clean, noise, generator=generator)
            every.append(compared(clean, noisy, index))
    share, least, nearer = constants(every)
    yield f"SPREAD_SHARE, LEAST_SPREAD, NEARER = {share:.2f}, {least:.4f}, {nearer:.4f}"
    yield f"USUAL_SPREAD = {float(concatenated(every).spread.median()):.3f}"


def constants(every: list[Contacts]) -> tuple[float, float, float]:
    """`SPREAD_SHARE`, `LEAST_SPREAD` and `NEARER` under which contacts are most probable."""
    all_of = concatenated(every)

    def surprise(tried: tuple[float, float, float]) -> float:
        probable = touch.finger_touch(all_of.found, all_of.spread, *tried).double()
        touching = all_of.touching.double()
        return float(torch.nn.functional.binary_cross_entropy(probable, touching))

    share, least, nearer = minimize(surprise, START, method="Nelder-Mead").x
    return abs(share), abs(least), nearer


def table(seeds: int) -> Iterator[str]:
    """Lines of a table in Markdown."""
    yield "| clip | noise | touching | input | mesh | probability | Brier | share alone |"
    yield "|---|---|---:|---:|---:|---:|---:|---:|"
    limits: dict[Dataset, int | None] = {"taco": None, "synthetic": MADE_LIMIT}
    for dataset, limit in limits.items():
        options = EvaluationOptions(
            dataset,
            noises=tuple(noise for noise in CASE_NOISES if noise in ("clean", *NOISES)),
            seeds=tuple(range(seeds)),
            limit=limit,
        )
        by_noise: dict[str, list[Case]] = {}
        for case in find_cases(options):
            by_noise.setdefault(case.noise, []).append(case)
        for noise, cases in by_noise.items():
            every = [compared(case.recording, case.noisy, case.seed) for case in cases]
            yield f"| {dataset} | `{noise}` | {row(every)} |"


def row(every: list[Contacts]) -> str:
    """The numbers of a line."""
    all_of = concatenated(every)
    touching, probable = all_of.touching, all_of.probability

    def score(contact: Bool[Tensor, "T 5"]) -> str:
        return f"{float(contact_agreement(contact, touching).f_score):.2f}"

    share = float(touching.float().mean())
    missed = float((probable - touching.float()).square().mean())
    scores = [score(distance <= TOUCH) for distance in (all_of.given, all_of.found)]
    numbers = [f"{share:.2f}", *scores, score(probable > 0.5), f"{missed:.3f}"]
    return " | ".join([*numbers, f"{share * (1 - share):.3f}"])


if __name__ == "__main__":
    lines = calibrate() if sys.argv[1:] == ["calibrate"] else table(int(sys.argv[2]))
    for line in lines:
        print(line, flush=True)
