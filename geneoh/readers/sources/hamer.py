"""What HaMeR and WiLoR put out, dumped by their users: one file of all frames or one for each
image.

pred_mano_params {global_orient (B, 1, 3, 3), hand_pose (B, 15, 3, 3), betas}, pred_keypoints_3d
(B, 21, 3), pred_cam (B, 3), with box_center, box_size, img_size and right from the batch, or what
the demos make of those: pred_cam_t_full and scaled_focal_length; 'frame' where rows are not frames
in order. Both see right hands only: left ones were mirrored, and are here mirrored back. Camera
frame, metres; the demos' focal length puts hands much too far away: --focal.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.hand.mano import MENDED
from geneoh.readers.base import CrossChecks, ReaderOptions, Recording, SourceClip, clip_name
from geneoh.readers.builders import (
    FLIP_X,
    axis_angles,
    hand_track,
    mirrored_x,
    object_of,
    recordings,
    sequence_of,
)
from geneoh.readers.records import FRAME_LIMIT, Array, Record, frame_number, read_record
from geneoh.sequence.sequence import HandTrack

FPS = 30.0
ENDINGS = (".pkl", ".pickle", ".npz", ".pt", ".pth", ".npy")
DEMO_FOCAL = 5000.0 / 256.0
"""Focal length in the demos, as a share of the longer side of the image."""


def find(path: Path) -> list[SourceClip]:
    """Every file of several frames, and every folder of one file for each frame."""
    if path.is_file():
        return [SourceClip(clip_name(path, 1), path)]
    files = sorted(p for p in path.rglob("*") if p.suffix in ENDINGS and p.is_file())
    folders: dict[Path, list[Path]] = {}
    for file in files:
        folders.setdefault(file.parent, []).append(file)
    found = []
    for folder, members in sorted(folders.items()):
        numbered = all(p.stem.lstrip("abcdefghijklmnopqrstuvwxyz_").isdigit() for p in members)
        if numbered and len(members) > 1:
            found.append(SourceClip(clip_name(folder, 1), folder))
        else:
            found += [SourceClip(clip_name(file, 1), file) for file in members]
    return found


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Up to two hands in the camera's frame; of several of one side, the one that goes on."""
    rows, frames = read_rows(clip.path, known)
    stored, tracks = {}, []
    for side in ("right", "left"):
        track = Detections(side, frames)
        for frame, values in sorted(rows, key=lambda row: row[0]):
            track.add(frame, values)
        if track.betas:
            stored[side] = track.joints
            tracks.append((track.hand(), ()))
    motion, notes = object_of(known, frames, str(clip.path))
    said = [] if known.focal else ["the demos' focal length: much too deep, pass --focal"]
    if known.fps is None:
        said.append(f"{FPS:g} frames a second assumed; --fps says otherwise")
    sequence = sequence_of(
        tracks, motion, known.rate(FPS), f"HaMeR or WiLoR {clip.name}", *notes, *said
    )
    names = tuple(f"{clip.name}_{index}" for index in range(len(motion.meshes)))
    return recordings(
        clip.name,
        sequence,
        object_known=np.ones(frames, dtype=bool),
        mesh_names=names,
        evidence=CrossChecks(joints=stored),
    )


class Detections:
    """The hand of one side over all frames; NaN where it was not detected."""

    def __init__(self, side: Side, frames: int) -> None:
        self.side: Side = side
        self.pose = np.full((frames, 16, 3), np.nan)
        self.joints = np.full((frames, 21, 3), np.nan)
        self.betas: list[Array] = []
        self.last = -1
        """The latest frame with a hand."""
        self.before = np.full(3, np.nan)
        """The wrist in the frame with a hand before that one."""

    def add(self, frame: int, values: dict[str, Array]) -> None:
        """Take a detection of this side, of several in one frame the one nearest to the last.

        Detections must come in the order of their frames.
        """
        right = values["right"] > 0.5
        if right != (self.side == "right"):
            return
        joints = values["points"] * (1 if right else FLIP_X) + values["trans"]
        if frame == self.last:
            now = np.linalg.norm(self.joints[frame, 0] - self.before)
            if not np.linalg.norm(joints[0] - self.before) < now:
                return
            self.betas.pop()
        elif self.last >= 0:
            self.before = self.joints[self.last, 0].copy()
        pose = axis_angles(values["turns"])
        self.pose[frame] = pose if right else mirrored_x(pose)
        self.joints[frame], self.last = joints, frame
        self.betas.append(values["betas"])

    def hand(self) -> HandTrack:
        """The track; the wrist is the first keypoint."""
        return hand_track(
            self.side,
            pose=self.pose,
            wrist=self.joints[:, 0],
            joints=self.joints,
            betas=np.mean(self.betas, axis=0),
            hand=MENDED,  # a mirrored right hand
        )


def read_rows(path: Path, known: ReaderOptions) -> tuple[list[tuple[int, dict[str, Array]]], int]:
    """Every detection with its frame, and the number of frames."""
    files = [path] if path.is_file() else sorted(p for p in path.iterdir() if p.suffix in ENDINGS)
    rows: list[tuple[int, dict[str, Array]]] = []
    for file in files:
        record = read_record(file)
        batch = read_batch(record, known)
        count = len(batch["right"])
        if "frame" in record:
            numbers = record.array("frame", ("B",)).astype(int).tolist()
        else:
            numbers = list(range(count)) if path.is_file() else [frame_number(file)] * count
        if len(numbers) != count or min(numbers) < 0 or max(numbers) > FRAME_LIMIT:
            raise record.refuse("frame", f"one frame number for each of {count} detections")
        rows += [
            (number, {name: values[index] for name, values in batch.items()})
            for index, number in enumerate(numbers)
        ]
    if not rows:
        raise InputError(f"{path}: expected detections, got none; check the dump")
    first = min(number for number, _ in rows)
    rows = [(number - first, values) for number, values in rows]
    return rows, max(number for number, _ in rows) + 1


def read_batch(record: Record, known: ReaderOptions) -> dict[str, Array]:
    """Rotations, betas, keypoints, full-image translation and side of each detection."""
    params = record.record("pred_mano_params")
    turns = np.concatenate(
        [
            params.array("global_orient", ("B", 1, 3, 3)),
            params.array("hand_pose", ("B", 15, 3, 3)),
        ],
        axis=1,
    )
    name = "right" if "right" in record else "is_right"
    batch = {
        "turns": turns,
        "betas": params.array("betas", ("B", 10)),
        "points": record.array("pred_keypoints_3d", ("B", 21, 3)),
        "right": record.array(name, ("B",), ("B", 1)).reshape(-1),
    }
    batch["trans"] = full_translation(record, batch["right"], known)
    if len({len(values) for values in batch.values()}) > 1:
        raise record.refuse("pred_mano_params", "one row for each detection")
    return batch


def full_translation(record: Record, right: Array, known: ReaderOptions) -> Array:
    """(B, 3) in the whole image's camera, from the weak-perspective camera of the crop.

    Source: cam_crop_to_full in HaMeR, with the true focal length where the caller knows it.
    """
    if "pred_cam_t_full" in record and "box_center" not in record:
        place = record.array("pred_cam_t_full", ("B", 3)).copy()
        if known.focal is not None:  # only the depth depends on it
            place[:, 2] *= known.focal / record.number("scaled_focal_length")
        return place
    for name in ("pred_cam", "box_center", "box_size", "img_size"):
        if name not in record:
            raise record.refuse(name, "dumped as well: a crop's own camera says no place")
    cam = record.array("pred_cam", ("B", 3))
    centre = record.array("box_center", ("B", 2))
    size = record.array("box_size", ("B",), ("B", 1)).reshape(-1)
    image = record.array("img_size", ("B", 2))
    focal = DEMO_FOCAL * image.max(1) if known.focal is None else known.focal
    spread = size * cam[:, 0] + 1e-9
    shift = 2 * (centre - image / 2) / spread[:, None]
    # The demos turn pred_cam's sign in place; pred_cam_t keeps what it was.
    own = record.array("pred_cam_t", ("B", 3))[:, 0] if "pred_cam_t" in record else cam[:, 1]
    across = own * (2 * right - 1)
    return np.stack([across + shift[:, 0], cam[:, 2] + shift[:, 1], 2 * focal / spread], axis=1)
