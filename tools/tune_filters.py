"""Tune the sizes of the low-pass filters: `python -m tools.tune_filters`.

A user does not know the noise of a track. Each filter therefore gets the one size that leaves the
least mean keypoint error over all validation clips and all noises. Validation clips are synthetic
interactions with the object families that networks are trained on, under seeds of their own; test
clips have other families. The printed lines are `geneoh.baselines.filters.TUNED`.
"""

from collections.abc import Iterable, Sequence
from typing import get_args

import torch

from geneoh.baselines.filters import GRID, Domain, Filter, filtered
from geneoh.choices import NOISES, FilterKind, Noise
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.seeds import seeded_generator
from geneoh.sequence.noise import corrupt
from geneoh.sequence.sequence import HandTrack
from geneoh.synthesis.attempts import synthesize_shard
from geneoh.synthesis.data_config import SynthesisConfig

FPS = 30.0
CLIPS, FRAMES = 32, 120
"""Number of validation clips and their length: enough for the best size to be stable."""


def validation_hands() -> list[HandTrack]:
    """Clean hands of synthetic interactions that are in no test and no training."""
    config = SynthesisConfig(count=CLIPS, frames=FRAMES, points=1, shard=CLIPS)
    made = synthesize_shard(config, config.common, generator=seeded_generator("tuning"))
    joints, _ = forward_kinematics(
        axis_angle_to_matrix(made.pose), made.wrist, made.offsets[:, None]
    )
    valid = torch.ones(FRAMES, dtype=torch.bool)
    return [
        HandTrack("right", valid, joints=joints[i], pose=made.pose[i], wrist=made.wrist[i])
        for i in range(CLIPS)
    ]


def noisy_pairs(
    hands: Iterable[HandTrack], noises: Iterable[Noise] = NOISES
) -> list[tuple[HandTrack, HandTrack]]:
    """Each hand as it is, and under each noise."""
    pairs = []
    for index, hand in enumerate(hands):
        for noise in noises:
            generator = seeded_generator("tuning", index, noise)
            pairs.append((hand, corrupt(hand, noise, generator=generator)))
    return pairs


def tuned(
    pairs: Sequence[tuple[HandTrack, HandTrack]], kind: FilterKind, domain: Domain
) -> tuple[Filter, float]:
    """The size of one kind of filter with the least mean error in metres, and that error."""

    def error(chosen: Filter) -> float:
        misses = [
            float((filtered(noisy, chosen, domain, FPS) - clean.joints).norm(dim=-1).mean())
            for clean, noisy in pairs
            if clean.joints is not None
        ]
        return sum(misses) / len(misses)

    errors = {chosen: error(chosen) for chosen in GRID[kind]}
    best = min(errors, key=errors.__getitem__)
    return best, errors[best]


if __name__ == "__main__":
    pairs = noisy_pairs(validation_hands())
    for kind in GRID:
        for domain in get_args(Domain):
            best, error = tuned(pairs, kind, domain)
            numbers = f"{best.size}" + (f", {best.beta}" if best.beta else "")
            made = f'("{kind}", "{domain}"): Filter("{kind}", {numbers})'
            print(f"    {made},  # {1000 * error:.2f} mm")
