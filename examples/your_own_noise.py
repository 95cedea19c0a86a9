"""Put noise of your own on a clean recording, clean it, and measure what is left of the noise."""

from dataclasses import replace
from pathlib import Path

import torch

import geneoh

HERE = Path(__file__).parent
CAMERA_AXIS = torch.tensor([0.0, 1.0, 0.0])
SIZE = 0.03
"""Standard deviation of the noise in metres."""


def main() -> None:
    recording = geneoh.load(HERE / "taco_clean.npz", obj=HERE / "taco_object.obj")
    truth = recording.hand("left")

    # A single camera measures depth badly: the hand jitters along the camera's axis.
    generator = torch.Generator().manual_seed(0)
    shift = SIZE * torch.randn(truth.frames, 1, generator=generator) * CAMERA_AXIS
    noisy = replace(truth, wrist=truth.wrist + shift, joints=truth.joints + shift[:, None])

    result = geneoh.denoise(replace(recording, hands=(noisy,)))
    clean = result.sequence.hand("left")
    for name, hand in (("noisy", noisy), ("clean", clean)):
        error = (hand.joints - truth.joints).norm(dim=-1).mean()
        print(f"{name} track: mean keypoint error {1000 * error:.1f} mm")
    print(f"penetration {result.hands['left'].after.penetration_mean_mm:.1f} mm")


if __name__ == "__main__":
    main()
