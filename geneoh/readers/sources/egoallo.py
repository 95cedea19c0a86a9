"""EgoAllo's results: {trajectory}/egoallo_outputs/{date}_{start}-{end}.npz, the wearer's body.

For S samples: Ts_world_root (S, T, 7), quaternion wxyz and position of the pelvis; body_quats
(S, T, 21, 4), left_hand_quats and right_hand_quats (S, T, 15, 4), each relative to its parent,
fingers absolute; betas (S, T, 16). Also timestamps_ns (T,). Metres, z up, the world of Aria's SLAM.
The hands have no position of their own: the body is posed first, which needs the user's neutral
SMPL-H model (--body). There is no object.
"""

from pathlib import Path

import numpy as np

from geneoh.body.motion import BodyMotion, pose
from geneoh.choices import SIDES
from geneoh.errors import InputError
from geneoh.readers import base, builders
from geneoh.readers.bodies.model import read_model
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import read_record
from geneoh.readers.nested_lists import Shape
from geneoh.readers.records import Array, float32
from geneoh.readers.transforms import axis_angles_of_wxyz, rotation_matrices
from geneoh.sequence.sequence import HandTrack

FIELDS: dict[str, Shape] = {
    **{"Ts_world_root": ("S", "T", 7), "body_quats": ("S", "T", 21, 4), "betas": ("S", "T", 16)},
    **{f"{side}_hand_quats": ("S", "T", 15, 4) for side in ("left", "right")},
}
BETAS_NOTE = "the body has the mean of the betas of its frames, so that wrists may be off"


@reads(
    "*.npz",
    choose=lambda found, path: (f for f in found if f == path or "egoallo" in f.parent.name),
    fps=None,
    takes=("body", "object_pose"),
)
def egoallo(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands of each sample, with the caller's object."""
    record = read_record(clip.path)
    if options.body is None:
        raise InputError(
            f"{clip.path}: the hands are posed with an SMPL-H body, got no model of it; pass "
            "--body with your neutral SMPL-H model"
        )
    arrays = {name: record.array(name, shape) for name, shape in FIELDS.items()}
    if len({array.shape[:2] for array in arrays.values()}) > 1:
        raise record.refuse("body_quats", "of as many samples and frames as the other fields")
    samples = len(arrays["betas"])
    for index in range(samples):
        name = clip.name if samples == 1 else f"{clip.name}_{index:03d}"
        hands = read_sample({name: array[index] for name, array in arrays.items()}, options.body)
        about = {"notes": (BETAS_NOTE,), "stamps": record}
        yield base.ClipParts(f"EgoAllo {name}", hands, name=name, **about)


def read_sample(sample: dict[str, Array], body: Path) -> list[HandTrack]:
    """Both hands of one sample, by the fields of a file; `body` is the user's model."""
    rest = read_model(body, float32(sample["betas"].mean(0)))
    root = sample["Ts_world_root"]
    quaternions = [root[:, None, :4], sample["body_quats"]]
    fingers = [axis_angles_of_wxyz(sample[f"{side}_hand_quats"]) for side in SIDES]
    vectors = [*map(axis_angles_of_wxyz, quaternions), *fingers]
    rotations = rotation_matrices(np.concatenate(vectors, axis=1))
    posed = pose(rest.skeleton, BodyMotion(float32(root[:, 4:]), float32(rotations)))
    return builders.hands_of_body(posed, np.concatenate(fingers, axis=1))
