"""Predictions of ArcticNet: {sid}_{seq}_{view}/ with preds/{key}.pt and meta_info/.

pred.mano.pose.{r,l} (T, 16, 3, 3), .beta, .cam_t (convention O, relative to MANO's mean pose,
MANO_LEFT as shipped), pred.object.rot (T, 3), .cam_t, .radian; float16, so good to a millimetre;
that view's camera frame, metres. Images are numbered at 30 a second; windows are padded at the end.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.pickles.files import read_values
from geneoh.readers.base import (
    CrossChecks,
    ReaderOptions,
    Recording,
    SourceClip,
    clip_name,
    finite_frames,
)
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    Track,
    axis_angles,
    mano_track,
    object_track,
    recordings,
    sequence_of,
)
from geneoh.readers.records import Array, Record, frame_number
from geneoh.readers.sources.arctic import part_motion, read_parts

CONVENTION = ManoConvention(origin=True, mean_added=True)
FPS = 30.0
ORTHOGONAL = 0.05
"""Largest entry of R^T R - I that half precision and a network's own projection leave."""


def find(path: Path) -> list[SourceClip]:
    """Every sequence that has predictions."""
    folders = {p.parent for p in path.rglob("preds") if p.is_dir()} if path.is_dir() else set()
    return [SourceClip(clip_name(folder, 1), folder) for folder in sorted(folders)]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Both hands and the two parts of the object, on the images' own time."""
    names = Record(
        str(clip.path), {"imgname": read_values(clip.path / "meta_info/meta_info.imgname.pt")}
    ).items("imgname")
    numbers = [frame_number(Path(str(name))) for name in names]
    words = clip.path.name.split("_")
    if not numbers or len(words) < 3:
        raise InputError(f"{clip.path}: expected a folder sid_object_..._view with images' names")
    time = Time(numbers)
    if known.objects is None:
        raise InputError(
            f"{clip.path}: predictions come without object meshes; pass --objects with ARCTIC's "
            "folder meta/object_vtemplates"
        )
    meshes, said = read_parts(known.objects, words[1])
    motion = part_motion(
        time.placed(prediction(clip.path, "object.radian", ())),
        time.placed(prediction(clip.path, "object.rot", (3,))),
        time.placed(prediction(clip.path, "object.cam_t", (3,))),
    )
    tracks = [read_hand(clip.path, side, time, known) for side in ("right", "left")]
    sequence = sequence_of(
        tracks,
        object_track(meshes, motion),
        known.rate(FPS),
        f"ArcticNet {clip.name}",
        "camera frame, depth from a weak-perspective scale",
        f"frame 0 is image {min(numbers)}, ARCTIC's own frames are those numbers less ioi_offset",
    )
    return recordings(
        clip.name,
        sequence,
        object_known=finite_frames(motion),
        mesh_names=(f"arctic_{words[1]}_bottom", f"arctic_{words[1]}_top"),
        evidence=CrossChecks(said=said),
    )


class Time:
    """The frames that a list of images stands for: from the first to the last, with gaps."""

    def __init__(self, numbers: list[int]) -> None:
        self.index = np.array(numbers) - min(numbers)

    def placed(self, values: Array) -> Array:
        """Values of the images at their frames, NaN between; what is padded at the end is cut."""
        if len(values) < len(self.index):
            raise InputError(f"preds: expected {len(self.index)} frames, got {len(values)}")
        result = np.full((int(self.index.max()) + 1, *values.shape[1:]), np.nan)
        result[self.index] = values[: len(self.index)]
        return result


def prediction(folder: Path, key: str, shape: tuple[int, ...]) -> Array:
    """One predicted quantity, (T, *shape)."""
    path = folder / "preds" / f"pred.{key}.pt"
    wanted = [("T", *shape)] if shape else [("T",), ("T", 1)]
    values = Record(str(path), {key: read_values(path)}).array(key, *wanted)
    return values if shape else values.reshape(-1)


def read_hand(folder: Path, side: Side, time: Time, known: ReaderOptions) -> Track:
    """One hand in the camera's frame."""
    letter = side[0]
    turns = prediction(folder, f"mano.pose.{letter}", (16, 3, 3))
    error = np.abs(turns @ turns.swapaxes(-1, -2) - np.eye(3)).max((1, 2, 3))
    turns[error > ORTHOGONAL] = np.nan
    pose = time.placed(axis_angles(turns).reshape(-1, 48))
    trans = time.placed(prediction(folder, f"mano.cam_t.{letter}", (3,)))
    betas = prediction(folder, f"mano.beta.{letter}", (10,))[: len(time.index)].mean(0)
    return mano_track(
        ManoParameters(side, pose, trans, betas), CONVENTION, known, f"{folder} {side}"
    )
