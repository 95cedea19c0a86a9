"""The recording that all readers of body motion return, in a world with y up."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.body.motion import BodyMotion, pose, turned_body
from geneoh.body.skeleton import JOINT_NAMES, Skeleton
from geneoh.bundle import Bundle, ByValue
from geneoh.choices import Axis
from geneoh.errors import InputError
from geneoh.geometry.rotations import nearest_axis, turn_up
from geneoh.readers.records import Notes
from geneoh.sequence.resample import MOST_FRAMES, evenly
from geneoh.sequence.validation import LARGEST_FPS, SMALLEST_FPS, check_place

SMALLEST_BODY, LARGEST_BODY = 0.3, 3.0
"""Limits in metres of the height of the head above the lower foot in the rest pose."""
LARGEST_HEIGHT = 10.0
"""Height in metres above or below the origin that a recorded pelvis hardly reaches."""
LARGEST_SPEED = 15.0
"""Median speed in metres a second that no pelvis reaches."""


@dataclass(frozen=True, eq=False, repr=False)
class BodyRecording(ByValue, Bundle):
    """One body over T frames, as a file has it, but in metres and in a world with y up."""

    motion: BodyMotion
    """With the finger poses of the file if it has them (`has_fingers`), else with flat hands."""
    skeleton: Skeleton
    rest_root: Float[Tensor, " 3"]
    """Pelvis of the body model at rest, metres: the pelvis is SMPL's translation plus this. Zero if
    the model is unknown."""
    fps: float
    source: str
    """The file and its layout."""
    up: Axis = "y"
    """Axis of the file's world that points up."""
    has_fingers: bool = False
    betas: Float[Tensor, " S"] | None = None
    """SMPL's shape coefficients, as the file has them."""
    gender: str = "neutral"
    sentences: tuple[str, ...] = ()
    """The file's descriptions of what the hands do; each is another wording."""
    notes: Notes = ()
    """Assumptions that were made, as sentences."""

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.motion.root)

    @property
    def file_motion(self) -> BodyMotion:
        """The motion in the world of the file, where `up` points up."""
        return turned_body(self.motion, turn_up("y", self.up).to(self.motion.root))


def upright_body(
    motion: BodyMotion, skeleton: Skeleton, given: Axis | None, *, usual: Axis | None = None
) -> tuple[BodyMotion, Axis, Notes]:
    """A motion rotated from a file's world to one with y up, the file's up axis, and notes.

    The up axis is the caller's (`given`), else the `usual` one of such files, else the axis nearest
    to the mean direction of the spine.
    """
    posed = pose(skeleton, motion).positions
    spine = nearest_axis((posed[:, JOINT_NAMES.index("neck")] - posed[:, 0]).mean(0))
    up, notes = given or usual or spine, ()
    if given is None and usual is None:
        notes = (f"{up} is taken to point up, as the body stands; --up says otherwise",)
    elif given is None and spine != usual:
        notes = (
            f"{up} is taken to point up, as in such files, but the body stands along {spine}; "
            f"--up {spine} says so where it does not lie or bend",
        )
    return turned_body(motion, turn_up(up, "y").to(motion.root)), up, notes


def body_at_rate(recording: BodyRecording, fps: float) -> BodyRecording:
    """The motion resampled to about `fps` frames a second; the first and the last frame stay."""
    steps = (recording.frames - 1) * fps / recording.fps
    if not steps < MOST_FRAMES:
        raise InputError(
            f"{recording.source}: must last at most {MOST_FRAMES} frames at {fps:g} frames a "
            f"second, got {steps:.6g}; cut it into shorter ones, or correct its frame rate"
        )
    last = recording.frames - 1
    frames = max(1, round(steps)) + 1
    if last in (0, frames - 1):
        return recording
    motion = recording.motion
    between = evenly(recording.frames, frames, motion.root.device)
    motion = BodyMotion(between.points(motion.root), between.rotations(motion.rotations))
    return replace(recording, motion=motion, fps=recording.fps * (frames - 1) / last)


def checked_body(recording: BodyRecording) -> BodyRecording:
    """The recording; `InputError` if frame rate, numbers or height cannot be those of a body."""
    name = recording.source
    if not SMALLEST_FPS <= recording.fps <= LARGEST_FPS:
        raise InputError(
            f"{name}: the frame rate must be {SMALLEST_FPS:g} to {LARGEST_FPS:g} frames a second, "
            f"got {recording.fps:g}; correct it in the file or in --fps"
        )
    finite = recording.motion.rotations.flatten(1).isfinite().all(1)
    finite &= recording.motion.root.isfinite().all(1)
    if not bool(finite.all()):
        raise InputError(
            f"{name}: every frame must hold the body in finite numbers, got NaN or infinity in "
            f"{int((~finite).sum())}, the first is {int((~finite).nonzero()[0])}; cut or fill them"
        )
    check_place(recording.motion.root, "the body", name)
    rest = pose(recording.skeleton, resting_body(1)).positions[0]
    height = float(rest[JOINT_NAMES.index("head"), 1] - rest[:, 1].min())
    if not SMALLEST_BODY <= height <= LARGEST_BODY:
        raise InputError(
            f"{name}: the body must be {SMALLEST_BODY:g} to {LARGEST_BODY:g} m high from foot to "
            f"head, got {height:.3g} m; check its unit and its skeleton"
        )
    return replace(recording, notes=(*recording.notes, *about_place(recording)))


def about_place(recording: BodyRecording) -> Notes:
    """A note if height or speed of the pelvis suggest that positions are not in metres."""
    root = recording.motion.root
    far = float(root[:, 1].abs().max())
    speeds = recording.fps * root.diff(dim=0).norm(dim=-1)
    speed = float(speeds.nanmedian()) if len(speeds) else 0
    if far < LARGEST_HEIGHT and speed < LARGEST_SPEED:
        return ()
    return (
        f"the pelvis is up to {far:.3g} m above or below the origin and moves at {speed:.3g} m/s; "
        "check that its places are in metres, and the frame rate",
    )


def resting_body(frames: int) -> BodyMotion:
    """A body in the T-pose at the origin."""
    upright = torch.eye(3).expand(frames, len(JOINT_NAMES), 3, 3).clone()
    return BodyMotion(torch.zeros(frames, 3), upright)
