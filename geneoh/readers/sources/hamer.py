"""What HaMeR and WiLoR put out, dumped by their users: one file of all frames or one for each
image.

pred_mano_params {global_orient (B, 1, 3, 3), hand_pose (B, 15, 3, 3), betas}, pred_keypoints_3d
(B, 21, 3), pred_cam (B, 3), with box_center, box_size, img_size and right from the batch, or what
the demos make of those: pred_cam_t_full and scaled_focal_length; 'frame', the image number of each
row; needed wherever an image may have two hands or none. Both estimate right hands only: left ones
were mirrored, and are here mirrored back. Camera frame, metres; the demos' focal length puts hands
much too far away: --focal.
"""

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points
from geneoh.hand.mano import MENDED
from geneoh.readers import base, transforms
from geneoh.readers.builders import hand_track
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import frame_number, read_record
from geneoh.readers.records import FRAME_LIMIT, Array, Record
from geneoh.sequence.sequence import HandTrack

ENDINGS = (".pkl", ".pickle", ".npz", ".pt", ".pth", ".npy")
DEMO_FOCAL = 5000.0 / 256.0
"""Focal length in the demos, as a share of the longer side of the image."""
FOCAL_NOTE = "the demos' focal length: much too deep, pass --focal"
AS_DUMPED = "dump the estimator's output as the page on estimators shows"
ORDER_NOTE = "no 'frame': each row is taken for the image after that of the row before"

Detection = dict[str, Array]
"""What was estimated for one hand in one image: turns, betas, points, right, trans."""
Found = tuple[int, Detection]
"""A detection with its frame."""


def dumps(found: Iterable[Path], path: Path) -> list[Path]:
    """Every file of several frames, and every folder of one file for each frame."""
    chosen: list[Path] = []
    for folder, files in groupby(sorted(found, key=lambda p: (p.parent, p)), lambda p: p.parent):
        members = list(files)
        numbered = all(p.stem.lstrip("abcdefghijklmnopqrstuvwxyz_").isdigit() for p in members)
        chosen += [folder] if numbered and len(members) > 1 else members
    return chosen


@reads(
    *(f"*{ending}" for ending in ENDINGS),
    choose=dumps,
    any_file=True,
    fps_assumed=True,
    takes=("focal", "object_pose"),
)
def hamer(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Up to two hands in the camera's frame, with the caller's object."""
    detections, notes = read_detections(clip.path, options)
    first, last = min(frame for frame, _ in detections), max(frame for frame, _ in detections)
    hands = [FollowedHand(side, last - first + 1) for side in ("right", "left")]
    for frame, detection in sorted(detections, key=lambda row: row[0]):
        for hand in hands:
            hand.add(frame - first, detection)
    hands = [hand for hand in hands if hand.betas]
    yield base.ClipParts(
        f"HaMeR or WiLoR {clip.name}",
        [hand.track() for hand in hands],
        notes=notes if options.focal else (*notes, FOCAL_NOTE),
        cross_checks=base.CrossChecks(joints={hand.side: hand.joints for hand in hands}),
        first=first,
        camera=(0.0, 0.0, 0.0),
    )


class FollowedHand:
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

    def add(self, frame: int, detection: Detection) -> None:
        """Take a detection of this side, of several at once the nearest to the last; in order."""
        right = detection["right"] > 0.5
        if right != (self.side == "right"):
            return
        points = detection["points"]
        joints = (points if right else mirror_points(points)) + detection["trans"]
        if frame == self.last:
            now = np.linalg.norm(self.joints[frame, 0] - self.before)
            if not np.linalg.norm(joints[0] - self.before) < now:
                return
            self.betas.pop()
        elif self.last >= 0:
            self.before = self.joints[self.last, 0].copy()
        pose = transforms.axis_angles(detection["turns"])
        self.pose[frame] = pose if right else mirror_axis_angle(pose)
        self.joints[frame], self.last = joints, frame
        self.betas.append(detection["betas"])

    def track(self) -> HandTrack:
        """The track; the wrist is the first keypoint."""
        betas, wrist = np.mean(self.betas, axis=0), self.joints[:, 0]
        numbers = {"pose": self.pose, "wrist": wrist, "betas": betas}
        return hand_track(self.side, self.joints, **numbers, left_hand=MENDED)  # right, mirrored


def read_detections(path: Path, options: base.ReaderOptions) -> tuple[list[Found], tuple[str, ...]]:
    """Every detection with its frame, and what was assumed of these."""
    files = [path] if path.is_file() else sorted(p for p in path.iterdir() if p.suffix in ENDINGS)
    found: list[Found] = []
    notes: tuple[str, ...] = ()
    for file in files:
        record = read_record(file, AS_DUMPED)
        if is_empty(record):
            continue
        batch = read_batch(record, options)
        count = len(batch["right"])
        if "frame" in record:
            frames = record.integers("frame")
        elif path.is_file():
            refuse_pairs(record, batch["right"])
            frames, notes = list(range(count)), (ORDER_NOTE,) if count > 1 else ()
        else:
            frames = [frame_number(file)] * count
        if len(frames) != count or min(frames) < 0 or max(frames) > FRAME_LIMIT:
            wanted = f"a frame's number, 0 to {FRAME_LIMIT}, for each of {count} detections"
            raise record.refuse("frame", wanted)
        for index, frame in enumerate(frames):
            found.append((frame, {name: values[index] for name, values in batch.items()}))
    if not found:
        raise InputError(f"{path}: expected detections, got none; check the dump")
    return found, notes


def side_field(record: Record) -> str:
    """The name of the field that says of each detection whether it is a right hand."""
    return "is_right" if "is_right" in record and "right" not in record else "right"


def is_empty(record: Record) -> bool:
    """Whether a file holds no detection, as that of an image without a hand."""
    names = (side_field(record), "pred_keypoints_3d")
    return all(name in record and not record.numbers(name).size for name in names)


def refuse_pairs(record: Record, right: Array) -> None:
    """Refuse hands of both sides that do not say which of them are of one image."""
    if len(np.unique(right > 0.5)) > 1:
        expected = "the number of each row's image, where a file has hands of both sides"
        raise record.refuse("frame", expected, "dump it too, or each hand to its own file")


def read_batch(record: Record, options: base.ReaderOptions) -> Detection:
    """Rotations, betas, keypoints, full-image translation and side of each detection."""
    params = record.record("pred_mano_params")
    orient = params.array("global_orient", ("B", 1, 3, 3))
    fingers = params.array("hand_pose", ("B", 15, 3, 3))
    params.refuse_lengths("global_orient", "hand_pose")
    transforms.refuse_other_matrices(params, "global_orient", orient)
    transforms.refuse_other_matrices(params, "hand_pose", fingers)
    batch = {
        "turns": np.concatenate([orient, fingers], axis=1),
        "betas": params.array("betas", ("B", 10)),
        "points": record.array("pred_keypoints_3d", ("B", 21, 3)),
        "right": record.array(side_field(record), ("B",), ("B", 1)).reshape(-1),
    }
    if ((batch["right"] < 0) | (batch["right"] > 1)).any():
        wanted = "1 for a right hand and 0 for a left one in each row"
        raise record.refuse(side_field(record), wanted)
    batch["trans"] = full_translation(record, batch["right"], options)
    if len({len(values) for values in batch.values()}) > 1:
        raise record.refuse("pred_mano_params", "one row for each detection")
    return batch


def full_translation(record: Record, right: Array, options: base.ReaderOptions) -> Array:
    """(B, 3) in the whole image's camera, from the weak-perspective camera of the crop.

    Source: cam_crop_to_full in HaMeR, with the true focal length where the caller knows it.
    """
    if "pred_cam_t_full" in record and "box_center" not in record:
        place = record.array("pred_cam_t_full", ("B", 3)).copy()
        if options.focal is not None:  # only the depth depends on it
            place[:, 2] *= options.focal / record.finite("scaled_focal_length")
        return place
    for name in ("pred_cam", "box_center", "box_size", "img_size"):
        if name not in record:
            raise record.refuse(name, "dumped as well: a crop's own camera says no place")
    camera = record.side_by_side(pred_cam=3, box_center=2, box_size=1, img_size=2)
    if len(camera) != len(right):
        raise record.refuse("pred_cam", "one row for each detection")
    if (camera[:, 0] <= 0).any():
        raise record.refuse("pred_cam", "a positive scale and two shifts in each row")
    cam, centre, size, image = camera[:, :3], camera[:, 3:5], camera[:, 5], camera[:, 6:]
    focal = DEMO_FOCAL * image.max(1) if options.focal is None else options.focal
    spread = size * cam[:, 0] + 1e-9  # as HaMeR has it, against a division by zero
    shift = 2 * (centre - image / 2) / spread[:, None]
    # The demos turn pred_cam's sign in place; pred_cam_t keeps what it was.
    own = record.side_by_side(pred_cam_t=3) if "pred_cam_t" in record else cam[:, 1:]
    if len(own) != len(right):
        raise record.refuse("pred_cam_t", "one row for each detection")
    across = own[:, 0] * (2 * right - 1)
    return np.stack([across + shift[:, 0], cam[:, 2] + shift[:, 1], 2 * focal / spread], axis=1)
