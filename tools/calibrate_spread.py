"""Calibrate the spread of keypoints: `python -m tools.calibrate_spread`, or `lost`.

The standard deviation of keypoints over samples is smaller than their error. This program finds the
factor at which the share of keypoints whose truth lies in the 90% radius is nearest to 90%, over
all noises. Clips are synthetic interactions with the object families that networks are trained on,
under seeds of their own, each under every noise. The last printed line is
`geneoh.pipeline.spread.ERROR_RATIO`.

`lost` prints a table for hands that are not seen for some frames, under the noise `gauss`, on the
recording and on clips of held-out families and scans: the root mean square error in these frames,
and the share of the keypoints in the 90% radius as samples alone give it and with
`geneoh.pipeline.spread.LOST`.
"""

import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import NOISES, Noise
from geneoh.evaluation.protocols.synthetic import draw_clip
from geneoh.metrics.accuracy import RADIUS_90
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.pipeline.spread import LOST, joint_spread, seconds_lost
from geneoh.seeds import seed_of, seeded_generator
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import Sequence
from geneoh.synthesis.data_config import SynthesisConfig
from tools.other_noises import clips_of

CLIPS, FRAMES = 5, 60
"""Number of clips and their length in frames."""
GRID = tuple(0.4 + 0.1 * step for step in range(28))
"""Factors that are tried."""
AIM = 0.9
"""Share of the keypoints whose truth is to lie in the 90% radius."""
LENGTHS = (4, 8, 15, 30, 60)
"""Frames for which a hand is not seen."""


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


def while_lost(clip: Sequence, length: int, seed: int) -> Float[Tensor, "3 N"]:
    """Of all keypoints in frames in which the hand is not seen: their error, and their spread by
    the samples alone and as it is told, metres."""
    generator = seeded_generator("lost", seed, length)
    noisy = corrupt_sequence(clip, "gauss", generator=generator)
    (hand,), edge = noisy.hands, min(8, (clip.frames - length) // 2)
    start = int(torch.randint(edge, clip.frames - length - edge + 1, (), generator=generator))
    observed = torch.ones(clip.frames, dtype=torch.bool)
    observed[start : start + length] = False
    lost = replace(noisy, hands=(replace(hand, valid=observed),))
    (found,) = denoise(lost, Options(seed=seed)).sequence.hands
    assert found.joint_spread is not None, "the default preset draws several samples"
    error = (found.joints - clip.hands[0].joints).norm(dim=-1)
    sampled = found.joint_spread / (1 + LOST * seconds_lost(observed))[:, None]
    return torch.stack([error, sampled, found.joint_spread])[:, ~observed].flatten(1)


def lost_row(clips: list[Sequence], length: int) -> str:
    """Error and shares within the radius over all clips, as cells of the table."""
    each = [while_lost(clip, length, seed) for seed, clip in enumerate(clips)]
    error, *spreads = torch.cat(each, dim=1)
    inside = [float((error <= RADIUS_90 * spread).float().mean()) for spread in spreads]
    return f"{1000 * error.square().mean().sqrt():.0f} | " + " | ".join(
        f"{100 * share:.0f}" for share in inside
    )


def main() -> None:
    """Calibrate, or print the table of lost hands."""
    if sys.argv[1:] == ["lost"]:
        groups = clips_of(6, 6)
        print("| frames lost | " + " | ".join(f"{name} | samples | told" for name in groups) + " |")
        print("|---:|" + "---:|" * 3 * len(groups))
        for length in LENGTHS:
            rows = [lost_row(clips, length) for clips in groups.values()]
            print(f"| {length} | " + " | ".join(rows) + " |", flush=True)
        return
    errors = {noise: measured(noise) for noise in NOISES}
    scale = calibrated(errors.values())
    for noise, each in errors.items():
        print(f"{noise}: {100 * each.inside(scale):.0f}% inside")
    print(f"ERROR_RATIO = {scale:.2f}")


if __name__ == "__main__":
    main()
