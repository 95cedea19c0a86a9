"""Ask how far off each keypoint may be, and compare with how far off it is."""

from pathlib import Path

import geneoh
from geneoh.hand.skeleton import TIP_KEYPOINTS

HERE = Path(__file__).parent
WITHIN_90 = 1.44
"""Radius that holds nine in ten keypoints, in units of the spread: see the page on uncertainty."""


def main() -> None:
    sequence = geneoh.load(HERE / "taco_noisy.npz", obj=HERE / "taco_object.obj")
    clean = geneoh.denoise(sequence, geneoh.Options(samples=4)).sequence.hand("left")
    spread = clean.joint_spread  # (T, 21), metres
    print(f"expected error of a keypoint: {1000 * spread.mean():.1f} mm on average")
    print(f"of a fingertip: {1000 * spread[:, list(TIP_KEYPOINTS)].mean():.1f} mm")
    print(f"least certain frame: {int(spread.mean(-1).argmax())}")

    truth = geneoh.load(HERE / "taco_clean.npz").hand("left").joints
    error = (clean.joints - truth).norm(dim=-1)
    inside = (error <= WITHIN_90 * spread).float().mean()
    print(f"real error: {1000 * error.mean():.1f} mm; {100 * inside:.0f}% within the 90% radius")


if __name__ == "__main__":
    main()
