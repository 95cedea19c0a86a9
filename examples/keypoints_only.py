"""Clean 21 keypoints per frame; the result has hand pose, wrist and shape as well."""

from pathlib import Path

import geneoh

HERE = Path(__file__).parent


def main() -> None:
    recording = geneoh.load(HERE / "taco_noisy.npz", obj=HERE / "taco_object.obj")
    keypoints = recording.hand("left").joints  # (T, 21, 3), metres, world, OpenPose order

    # Everything that a keypoint track needs; numpy arrays and lists will do as well.
    sequence = geneoh.from_arrays(
        left_joints=keypoints,
        object_rotation=recording.object.rotation,
        object_translation=recording.object.translation,
        fps=30.0,
        meshes=HERE / "taco_object.obj",
    )

    clean = geneoh.denoise(sequence, geneoh.Options(preset="fast")).sequence.hand("left")
    print(f"pose {tuple(clean.pose.shape)}: axis-angle of 16 joints in each frame")
    print(f"wrist {tuple(clean.wrist.shape)} and shape {tuple(clean.betas.shape)}")

    ground_truth = geneoh.load(HERE / "taco_clean.npz").hand("left").joints
    for name, joints in (("noisy", keypoints), ("clean", clean.joints)):
        error = (joints - ground_truth).norm(dim=-1).mean()
        print(f"{name} keypoints: mean error {1000 * error:.1f} mm")


if __name__ == "__main__":
    main()
