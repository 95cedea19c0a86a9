"""Predictions of ArcticNet: {sid}_{seq}_{view}/ with preds/{key}.pt and meta_info/.

pred.mano.pose.{r,l} (T, 16, 3, 3), .beta, .cam_t (of MANO's origin, relative to MANO's mean pose,
left hand as shipped), pred.object.rot (T, 3), .cam_t, .radian; float16, so good to a millimetre;
that view's camera frame, metres. Images are numbered at 30 a second; windows are padded at the end.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.readers import base
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.foreign_files import frame_number
from geneoh.readers.records import Array, Record, Shape
from geneoh.readers.sources.arctic import CONVENTION, part_motion, read_parts
from geneoh.readers.transforms import axis_angles

ORTHOGONAL = 0.05
"""Largest entry of R^T R - I that half precision and a network's own projection leave."""


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands and the two parts of the object, one frame for each image number."""
    words = clip.path.name.split("_")
    path = clip.path / "meta_info/meta_info.imgname.pt"
    names = Record(str(path), {"imgname": read_values(path)}).texts("imgname")
    numbers = [frame_number(Path(name)) for name in names]
    if not numbers or len(words) < 3:
        raise InputError(f"{clip.path}: expected a folder sid_object_..._view with images' names")
    if options.objects is None:
        raise InputError(
            f"{clip.path}: predictions come without object meshes; pass --objects with "
            "ARCTIC's folder meta/object_vtemplates"
        )
    meshes, contradictions = read_parts(options.objects, words[1])
    images = Images(clip.path / "preds", np.array(numbers) - min(numbers))
    motion = part_motion(
        images.placed(images.read("object.radian", ("T",), ("T", 1)).reshape(-1)),
        images.placed(images.read("object.rot", ("T", 3))),
        images.placed(images.read("object.cam_t", ("T", 3))),
    )
    yield base.ClipParts(
        f"ArcticNet {clip.name}",
        [read_hand(images, side) for side in ("right", "left")],
        meshes,
        motion,
        notes=(
            "camera frame, depth from a weak-perspective scale",
            f"frame 0 is image {min(numbers)}, ARCTIC's own frames are those numbers less "
            "ioi_offset",
        ),
        cross_checks=base.CrossChecks(contradictions=contradictions),
        camera=(0.0, 0.0, 0.0),
    )


@dataclass(frozen=True)
class Images:
    """The images that were predicted, and the frames that they are."""

    folder: Path
    """The predictions."""
    frames: Array
    """(N,) the frame of each image, counted from the first one."""

    def read(self, key: str, *shapes: Shape) -> Array:
        """(N, ...) one predicted quantity; what the last window is padded with is cut."""
        path = self.folder / f"pred.{key}.pt"
        values = Record(str(path), {key: read_values(path)}).array(key, *shapes)
        if len(values) < len(self.frames):
            raise InputError(f"{path}: expected {len(self.frames)} frames, got {len(values)}")
        return values[: len(self.frames)]

    def placed(self, values: Array) -> Array:
        """(T, ...) values of the images at their frames, NaN in frames without an image."""
        result = np.full((int(self.frames.max()) + 1, *values.shape[1:]), np.nan)
        result[self.frames] = values
        return result


def read_hand(images: Images, side: Side) -> base.ManoParameters:
    """One hand in the camera's frame."""
    turns = images.read(f"mano.pose.{side[0]}", ("T", 16, 3, 3))
    error = np.abs(turns @ turns.swapaxes(-1, -2) - np.eye(3)).max((1, 2, 3))
    turns[error > ORTHOGONAL] = np.nan
    return base.ManoParameters(
        side,
        images.placed(axis_angles(turns)),
        images.placed(images.read(f"mano.cam_t.{side[0]}", ("T", 3))),
        images.read(f"mano.beta.{side[0]}", ("T", 10)).mean(0),
    )


READER = DatasetReader(parts, ("preds/",), clip_is_folder=True, convention=CONVENTION)
