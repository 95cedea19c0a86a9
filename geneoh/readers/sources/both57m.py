"""BOTH57M clips: a joblib list of dicts with trans, root_orient, body_pose (T, 21, 3), hand_pose.

hand_pose (T, 30, 3) holds left, then right, absolute, relative to the wrists of an SMPL+H body
(male, zero betas, y up, 30 frames a second). The hands have no position of their own: the body is
posed first, which needs the user's SMPL+H model (--body). There is no object.
"""

import numpy as np

from geneoh.body import motion as motions
from geneoh.body.motion import BodyMotion, PosedBody
from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.readers import base, builders, transforms
from geneoh.readers.bodies.model import RestBody, read_model
from geneoh.readers.dataset_reader import reads
from geneoh.readers.records import Record, as_record, float32


@reads("*.p", "*.pkl", takes=("body", "object_pose"))
def both57m(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands of each clip in a list, with the caller's object."""
    values = read_values(clip.path)
    if not isinstance(values, list) or not values:
        raise InputError(f"{clip.path}: expected a list of clips, got {type(values).__name__}")
    if options.body is None:
        raise InputError(
            f"{clip.path}: the hands are posed with an SMPL+H body, got no model of it; pass "
            "--body with your SMPL+H male model"
        )
    rest = read_model(options.body)
    for index, value in enumerate(values):
        record = as_record(value, f"{clip.path} clip {index}")
        posed = pose_body(record, rest)
        fingers = record.array("hand_pose", ("T", 30, 3))
        record.refuse_lengths("hand_pose", "root_orient")
        name = f"{clip.name}_{index:03d}"
        yield base.ClipParts(f"BOTH57M {name}", builders.hands_of_body(posed, fingers), name=name)


def pose_body(record: Record, rest: RestBody) -> PosedBody:
    """The body's joints in the world."""
    root, trans = record.array("root_orient", ("T", 3)), record.array("trans", ("T", 3))
    body = record.array("body_pose", ("T", 21, 3))
    record.refuse_lengths("root_orient", "body_pose", "trans")
    turns = transforms.rotation_matrices(np.concatenate([root[:, None], body], axis=1))
    fingers = np.broadcast_to(np.eye(3), (len(turns), 30, 3, 3))
    rotations = float32(np.concatenate([turns, fingers], axis=1))
    return motions.pose(rest.skeleton, BodyMotion(float32(trans) + rest.rest_root, rotations))
