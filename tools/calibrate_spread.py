"""Calibrate the spread of keypoints: `python -m tools.calibrate_spread`, or `lost`.

The standard deviation of keypoints over samples differs from their error. This program finds the
ratio of the two, and the change from input to result below which less of the deviation counts, that
tell the smallest errors with which the 90% radius holds the share `LEAST` of the true keypoints
under every noise and of clean hands. Clips are synthetic interactions with the object families and
the scans that networks are trained on, under seeds of their own, each under every noise. The last
printed line has `ERROR_RATIO` and `CHANGED` of `geneoh.pipeline.spread`.

`lost` prints a table for hands that are not seen for some frames, under the noise `gauss`, on the
recording and on clips of held-out families and scans: the root mean square error in these frames,
and the share of the keypoints in the 90% radius as samples alone give it and with
`geneoh.pipeline.spread.LOST`.
"""

import math
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import NOISES, Noise
from geneoh.metrics.accuracy import RADIUS_90
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.pipeline.spread import LOST, joint_spread, seconds_lost
from geneoh.seeds import seeded_generator
from geneoh.sequence.gaps import filled_keypoints
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import Sequence
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.shapes.scans import read_folder
from tools.noisy_objects.clips import EXAMPLES, made_clips, scans_of
from tools.other_noises import clips_of

CLIPS, FRAMES = 10, 90
"""Number of clips of families, and of scans, and their length in frames."""
RATIOS = tuple(round(0.8 + 0.1 * step, 1) for step in range(16))
CHANGES = tuple(0.001 * step for step in range(1, 13))
"""Values of `ERROR_RATIO` and `CHANGED` that are tried; the latter in metres."""
LEAST = 0.9
"""Share of the keypoints whose truth lies in the 90% radius, at least. Most noises have more, since
errors that last need a larger radius than others."""
LENGTHS = (4, 8, 15, 30, 60)
"""Frames for which a hand is not seen."""


@dataclass(frozen=True)
class SpreadErrors:
    """Spread at a ratio of 1 and true error of all keypoints of one noise, metres."""

    sampled: Float[Tensor, "C N"]
    """For each of `CHANGES`."""
    error: Float[Tensor, " N"]

    def inside(self, ratio: float, change: int) -> float:
        """Share of the keypoints whose truth lies in the 90% radius, with a ratio and one of
        `CHANGES` by its index."""
        radius = RADIUS_90 * ratio * self.sampled[change]
        return float((self.error <= radius).float().mean())


def clips_to_calibrate(count: int = CLIPS, frames: int = FRAMES) -> list[Sequence]:
    """Clips of the families and of some of the scans that networks are trained on."""
    families, objects = SynthesisConfig().common, read_folder(EXAMPLES / "objects")
    names = [name for name in objects.names if name not in objects.held_out]
    scans = scans_of(objects, names[:: max(1, len(names) // count)])
    return [
        *made_clips(families, count, 1000, frames),
        *made_clips(scans.names, count, 1000, frames, scans),
    ]


def measured(noise: Literal[Noise, "clean"], clips: Iterable[Sequence]) -> SpreadErrors:
    """Clean clips under a noise, or none; spread and true error of every keypoint."""
    sampled, errors = [], []
    for index, clean in enumerate(clips):
        generator = seeded_generator("calibration", index, noise)
        noisy = clean if noise == "clean" else corrupt_sequence(clean, noise, generator=generator)
        (hand,) = denoise(noisy, Options(seed=index)).hands.values()
        cleaned, truth = hand.track.joints, clean.hands[0].joints
        assert cleaned is not None, "every result has joints"
        assert truth is not None, "synthetic clips have joints"
        spread_at = partial(
            joint_spread,
            hand.samples,
            1.0,
            given=filled_keypoints(noisy.hands[0]),
            alone=1 - hand.evidence,
            observed=~hand.filled,
        )
        sampled.append(torch.stack([spread_at(changed=change).flatten() for change in CHANGES]))
        errors.append((cleaned - truth).norm(dim=-1).flatten())
    return SpreadErrors(torch.cat(sampled, dim=1), torch.cat(errors))


def calibrated(errors: Iterable[SpreadErrors]) -> tuple[float, int]:
    """The ratio and the index of the change with the least expected errors, as the geometric mean
    over the noises, of those with which no noise has fewer than `LEAST` in the radius."""
    errors = list(errors)

    def size(tried: tuple[float, int]) -> float:
        ratio, change = tried
        return math.prod(ratio * float(each.sampled[change].mean()) for each in errors)

    pairs = product(RATIOS, range(len(CHANGES)))
    held = [pair for pair in pairs if all(each.inside(*pair) >= LEAST for each in errors)]
    return min(held, key=size)


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
    clips = clips_to_calibrate()
    errors = {noise: measured(noise, clips) for noise in (*NOISES, "clean")}
    ratio, change = calibrated(errors.values())
    for noise, each in errors.items():
        print(f"{noise}: {100 * each.inside(ratio, change):.0f}% inside")
    print(f"ERROR_RATIO = {ratio:.1f}, CHANGED = {CHANGES[change]:.3f}")


if __name__ == "__main__":
    main()
