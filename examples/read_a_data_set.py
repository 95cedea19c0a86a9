"""Read a recording as it is distributed: `python read_a_data_set.py hoi4d PATH`.

Without arguments, a file such as an estimator leaves is made and read: keypoints as an array.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import geneoh

HERE = Path(__file__).parent


def estimated(folder: Path) -> geneoh.Sequence:
    """The example recording out of arrays that do not say what they are."""
    example = np.load(HERE / "taco_noisy.npz")
    np.save(folder / "keypoints.npy", example["left_joints"])
    pose = np.tile(np.eye(4), (len(example["left_joints"]), 1, 1))  # object to world
    pose[:, :3, :3] = example["object_rotation"][:, 0]
    pose[:, :3, 3] = example["object_translation"][:, 0]
    given = {"side": "left", "fps": 30.0, "obj": HERE / "taco_object.obj", "object_pose": pose}
    return geneoh.read("keypoints", folder / "keypoints.npy", **given)


def main(*arguments: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        sequence = geneoh.read(*arguments) if arguments else estimated(Path(folder))
    print(f"{sequence.source}: {sequence.frames} frames at {sequence.fps:g} frames per second")
    for hand in sequence.hands:
        print(f"{hand.side} hand, observed in {int(hand.valid.sum())} frames")
    for mesh in sequence.object.meshes:
        size = mesh.verts.amax(0) - mesh.verts.amin(0)
        print(f"object part of {len(mesh.faces)} triangles, {100 * size.max():.0f} cm long")


if __name__ == "__main__":
    main(*sys.argv[1:])
