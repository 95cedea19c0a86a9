"""Calibrate the spread of keypoints: `python -m tools.calibrate_spread`.

The standard deviation of keypoints over samples is smaller than their error. This program finds the
factor at which the share of keypoints whose truth lies in the 90% radius is nearest to 90%, over
all noises. Clips are synthetic interactions with the object families that networks are trained on,
under seeds of their own, each under every noise. The last printed line is
`geneoh.pipeline.spread.ERROR_RATIO`.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import NOISES, Noise
from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.metrics.accuracy import RADIUS_90
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.pipeline.spread import joint_spread
from geneoh.seeds import seed_of, seeded_generator
from geneoh.sequence.noise import corrupt_sequence
from geneoh.synthesis.data_config import SynthesisConfig

CLIPS, FRAMES = 5, 60
"""Number of clips and their length in frames."""
GRID = tuple(0.4 + 0.1 * step for step in range(28))
"""Factors that are tried."""
AIM = 0.9
"""Share of the keypoints whose truth is to lie in the 90% radius."""


@dataclass(frozen=True)
class SpreadErrors:
    """Standard deviation over samples and true error of all keypoints of one noise, metres."""

    sampled: Float[Tensor, " N"]
    error: Float[Tensor, " N"]

    def inside(self, scale: float) -> float:
        """Share of the keypoints whose truth lies in the 90% radius, with this factor."""
        return float((self.error <= RADIUS_90 * scale * self.sampled).float().mean())


def measured(noise: Noise, clips: int = CLIPS, frames: int = FRAMES) -> SpreadErrors:
    """Clean clips under a noise; spread over samples and true error of every keypoint."""
    families = SynthesisConfig().common
    found = []
    for index in range(clips):
        clean = draw_clip(families[seed_of("family", index) % len(families)], 1000 + index, frames)
        generator = seeded_generator("calibration", index, noise)
        result = denoise(corrupt_sequence(clean, noise, generator=generator), Options(seed=index))
        cleaned, truth = result.sequence.hands[0].joints, clean.hands[0].joints
        assert cleaned is not None, "every result has joints"
        assert truth is not None, "synthetic clips have joints"
        sampled = joint_spread(result.hands["right"].samples, scale=1.0)
        found.append(torch.stack([sampled, (cleaned - truth).norm(dim=-1)]).flatten(1))
    return SpreadErrors(*torch.cat(found, dim=1))


def calibrated(errors: Iterable[SpreadErrors]) -> float:
    """The factor of the grid that comes nearest to the aim over all noises."""
    errors = list(errors)

    def miss(scale: float) -> float:
        return sum((each.inside(scale) - AIM) ** 2 for each in errors)

    return min(GRID, key=miss)


if __name__ == "__main__":
    errors = {noise: measured(noise) for noise in NOISES}
    scale = calibrated(errors.values())
    for noise, each in errors.items():
        print(f"{noise}: {100 * each.inside(scale):.0f}% inside")
    print(f"ERROR_RATIO = {scale:.2f}")
