"""Clean a noisy track from Python, and print what changed."""

from pathlib import Path

import geneoh

HERE = Path(__file__).parent


def main() -> None:
    sequence = geneoh.load(HERE / "taco_noisy.npz", obj=HERE / "taco_object.obj")
    print(f"read {sequence.frames} frames at {sequence.fps:g} frames per second")

    result = geneoh.denoise(sequence, geneoh.Options(preset="fast", seed=0))

    for side, hand in result.hands.items():
        before, after = hand.before, hand.after
        print(f"{side} hand: keypoints moved by {1000 * hand.moved:.1f} mm on average")
        print(
            f"  penetration {before.penetration_mean_mm:.1f} mm before, "
            f"{after.penetration_mean_mm:.1f} mm after"
        )
        print(
            f"  acceleration {before.acceleration_mm:.1f} mm/frame^2 before, "
            f"{after.acceleration_mm:.1f} mm/frame^2 after"
        )

    geneoh.save(result, "taco_noisy_clean.npz")
    print("wrote taco_noisy_clean.npz")


if __name__ == "__main__":
    main()
