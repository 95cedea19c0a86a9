"""Dyn-HaMR's world results: {run}/{phase}/{video}_{step}_world_results.npz, for B tracks of hands.

trans (B, T, 3) of MANO's origin, root_orient (B, T, 3), pose_body (B, T, 45) absolute, betas
(B, 10), is_right (B, T); cam_R (B, T, 3, 3) and cam_t (B, T, 3) from the world to the camera;
metres. Every track has the parameters of MANO's right hand: those of a left hand are of the world
mirrored at x = 0, and are mirrored back here. A run has a folder for each phase, with a file for
each of some steps. {run}/track_info.json has the frames in which each hand was detected (in others
it is interpolated or zero), and the numbers of the first frames.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.choices import Side
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points
from geneoh.hand.mano import MENDED
from geneoh.readers import base, foreign_files
from geneoh.readers.dataset_reader import Matches, reads
from geneoh.readers.nested_lists import Shape
from geneoh.readers.records import FRAME_LIMIT, Array, Notes, Record, as_record
from geneoh.readers.transforms import inverse, refuse_other_matrices, rigid_matrices

FIELDS: dict[str, tuple[Shape, ...]] = {
    **{"trans": (("B", "T", 3),), "root_orient": (("B", "T", 3),)},
    **{"pose_body": (("B", "T", 45), ("B", "T", 15, 3)), "is_right": (("B", "T"),)},
}
PHASES = ("init", "root_fit", "smooth_fit", "prior")
"""Folders of a run's phases, in the order in which they refine the hands."""

ENDING = "_world_results.npz"
SEEN_NOTE = "frames in which no hand was detected count as seen: track_info.json does not name them"


def last_results(found: Matches, path: Path) -> Iterator[Path]:
    """The results of the last step of the last phase of every run."""
    inside = (file for file in found if file.parent.name in PHASES)
    last: dict[Path, Path] = {}
    # a file's name has the number of its step in six digits
    for file in sorted(inside, key=lambda file: (PHASES.index(file.parent.name), file.name)):
        last[file.parent.parent] = file
    yield from last.values()


@reads(
    f"*{ENDING}",
    choose=last_results,
    any_file=True,
    fps=None,
    convention=base.ManoConvention("origin", left_hand=MENDED),
    takes=("object_pose", "object_pose_frame"),
)
def dynhamr(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Up to two hands in the world, with the caller's object."""
    record = foreign_files.read_record(clip.path)
    arrays = {name: record.array(name, *shapes) for name, shapes in FIELDS.items()}
    tracks, frames = arrays["is_right"].shape
    if frames > FRAME_LIMIT:
        raise record.refuse("is_right", f"of {FRAME_LIMIT} frames at most")
    for name, array in arrays.items():
        if array.shape[:2] != (tracks, frames):
            raise record.refuse(name, f"of {tracks} tracks and {frames} frames, as 'is_right'")
    betas = record.array("betas", (tracks, 10))
    sides: list[Side] = [
        "right" if right else "left" for right in np.median(arrays["is_right"], axis=1) > 0.5
    ]
    if len(set(sides)) < tracks:
        raise record.refuse("is_right", "of one track at most for each side")
    detected, first, notes = detections(clip.path, tracks, frames)
    poses = np.concatenate(
        [arrays["root_orient"], arrays["pose_body"].reshape(tracks, frames, 45)], axis=2
    ).reshape(tracks, frames, 16, 3)
    poses[~(detected & poses[:, :, 1:].any(axis=(2, 3)))] = np.nan
    hands = []
    for side, pose, trans, shape in zip(sides, poses, arrays["trans"], betas, strict=True):
        if side == "left":
            pose, trans = mirror_axis_angle(pose), mirror_points(trans)
        hands.append(base.ManoParameters(side, pose, trans, shape))
    about: dict[str, Any] = {"camera_poses": camera_of(record, tracks, frames), "first": first}
    yield base.ClipParts(f"Dyn-HaMR {clip.name}", hands, notes=notes, **about)


def detections(results: Path, tracks: int, frames: int) -> tuple[Array, int, Notes]:
    """(B, T) mask of the frames in which each hand was detected, the first frame's number, notes.

    Without a fitting track_info.json in the folder of the run every frame counts.
    """
    everywhere = np.ones((tracks, frames), bool)
    path = results.parent.parent / "track_info.json"
    if not path.is_file():
        return everywhere, 0, (SEEN_NOTE,)
    info = as_record(foreign_files.read_json(path), str(path))
    meta, found = info.record("meta"), info.record("tracks")
    start, end = pair_of(meta, "seq_interval")
    offset, _ = pair_of(meta, "data_interval")
    masks = {}
    for name in found.values:
        track = found.record(name)
        masks[track.integer("index")] = track.numbers("vis_mask").ravel()[start:end] > 0.5
    if end - start != frames or set(masks) != set(range(tracks)):
        return everywhere, 0, (f"{path.name} is left out: it is of other frames or tracks",)
    if any(len(mask) != frames for mask in masks.values()):
        raise info.refuse("tracks", f"of tracks whose 'vis_mask' has {end} frames at least")
    return np.stack([masks[index] for index in range(tracks)]), offset + start, ()


def pair_of(record: Record, name: str) -> tuple[int, int]:
    """The first frame's number and the one after the last of an interval of frames."""
    numbers = record.integers(name)
    if len(numbers) != 2 or not 0 <= numbers[0] < numbers[1]:
        raise record.refuse(name, "the numbers of the first frame and of the one after the last")
    return numbers[0], numbers[1]


def camera_of(record: Record, tracks: int, frames: int) -> Array | None:
    """(T, 4, 4) camera to world, metres; None in a file without it."""
    if "cam_R" not in record:
        return None
    turns = record.array("cam_R", (tracks, frames, 3, 3))[0]
    shifts = record.array("cam_t", (tracks, frames, 3))[0]
    refuse_other_matrices(record, "cam_R", turns)
    return inverse(rigid_matrices(turns, shifts), f"{record.where} 'cam_R', 'cam_t'")
