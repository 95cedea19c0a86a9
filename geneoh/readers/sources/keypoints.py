"""Any array of keypoints: (T, 21, 3) in a npy, or 'joints' in an npz, in a named order.

Metres unless --keypoint-unit says otherwise. --joint-order names the order; the orders of WebXR and
OpenXR have 25 and 26 points. --side says which hand, --obj and --object-pose add the object. NaN
means not observed.
"""

import numpy as np

from geneoh.errors import ConfigError
from geneoh.files.values import read_values
from geneoh.geometry.mesh import METRES
from geneoh.readers import base
from geneoh.readers.builders import keypoint_track
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.joint_orders import ORDERS, openpose_order
from geneoh.readers.records import Record


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """The one hand of a file, with the caller's object."""
    order = options.joint_order
    if order not in ORDERS:
        raise ConfigError(f"--joint-order {order}: expected {', '.join(ORDERS)}")
    value = read_values(clip.path)
    record = Record(str(clip.path), value if isinstance(value, dict) else {"joints": value})
    side = options.side_of(record)
    count = ORDERS[order].count
    points = record.array("joints", ("T", count, 3), ("T", 3 * count), (count, 3))
    points = METRES[options.keypoint_unit or "m"] * points.reshape(-1, count, 3)
    joints, trust = openpose_order(points, order)
    confidence = None if trust.all() else np.tile(trust, (len(joints), 1))
    yield base.ClipParts(
        f"{clip.path.name} (keypoints in the order {order})",
        [keypoint_track(side, joints, confidence)],
        cross_checks=base.CrossChecks(joints={side: joints}),
    )


READER = DatasetReader(parts, ("*.npy", "*.npz"), fps_assumed=True)
