"""Any array of keypoints: (T, 21, 3) in a npy, or 'joints' in an npz, metres, in a named order.

--joint-order names the order; the orders of WebXR and OpenXR have 25 and 26 points. --side says
which hand, --obj and --object-pose bring the object. NaN stands for what was not observed.
"""

from pathlib import Path

import numpy as np

from geneoh.errors import ConfigError, InputError
from geneoh.pickles.files import read_values
from geneoh.readers.base import CrossChecks, ReaderOptions, Recording, SourceClip, clips
from geneoh.readers.builders import joints_track, object_of, recordings, sequence_of
from geneoh.readers.joint_orders import ORDERS, ordered
from geneoh.readers.records import Record

FPS = 30.0


def find(path: Path) -> list[SourceClip]:
    """Every array file."""
    return [clip for pattern in ("*.npy", "*.npz") for clip in clips(path, pattern, 1)]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """One hand."""
    if known.joint_order not in ORDERS:
        raise ConfigError(f"--joint-order {known.joint_order}: expected {', '.join(ORDERS)}")
    value = read_values(clip.path)
    record = Record(str(clip.path), value if isinstance(value, dict) else {"joints": value})
    side = known.side or (record.text("side") if "side" in record else None)
    if side not in ("left", "right"):
        raise InputError(f"{clip.path}: which hand it holds is not said; pass --side left or right")
    count = ORDERS[known.joint_order].count
    shapes = (("T", count, 3), ("T", 3 * count), (count, 3))
    points = record.array("joints", *shapes).reshape(-1, count, 3)
    joints, trust = ordered(points, known.joint_order)
    hand = joints_track(side, joints, None if trust.all() else np.tile(trust, (len(joints), 1)))
    motion, notes = object_of(known, len(joints), str(clip.path))
    said = () if known.fps else (f"{FPS:g} frames a second assumed; --fps says otherwise",)
    sequence = sequence_of(
        [(hand, notes)],
        motion,
        known.rate(FPS),
        f"{clip.path.name} (keypoints in the order {known.joint_order})",
        *said,
    )
    everywhere = np.ones(len(joints), dtype=bool)
    names = tuple(f"{clip.name}_{index}" for index in range(len(motion.meshes)))
    return recordings(
        clip.name,
        sequence,
        object_known=everywhere,
        mesh_names=names,
        evidence=CrossChecks(joints={side: joints}),
    )
