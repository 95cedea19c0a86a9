"""What every reader of a body's motion gives: one recording, in a world with y up."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.body.motion import BodyMotion, pose, turned_body
from geneoh.body.skeleton import JOINT_NAMES, Skeleton
from geneoh.bundle import Bundle, equal_values, repr_by_shapes
from geneoh.choices import Axis
from geneoh.errors import InputError
from geneoh.geometry.rotations import nearest_axis, turn_up
from geneoh.readers.records import Notes
from geneoh.sequence.resample import MOST_FRAMES, evenly
from geneoh.sequence.validation import LARGEST_FPS, SMALLEST_FPS, check_place

SMALLEST_BODY, LARGEST_BODY = 0.3, 3.0
"""Limits in metres of the height of the head above the lower foot in the rest pose."""
FAR_UP = 10.0
"""Metres above or below the origin at which no pelvis of a recording usually is."""
FAST = 15.0
"""Metres a second that no pelvis does in half of all frames."""


@dataclass(frozen=True, eq=False)
class BodyRecording(Bundle):
    """One body over T frames, as a file has it, but in metres and in a world with y up."""

    motion: BodyMotion
    """With the fingers of the file where it has them (`has_fingers`), else flat hands."""
    skeleton: Skeleton
    rest_root: Float[Tensor, " 3"]
    """The pelvis of the body model at rest, metres: what SMPL's translation lacks of the pelvis.
    Zero where the model is not known."""
    fps: float
    source: str
    """The file and its layout, in words."""
    up: Axis = "y"
    """Axis of the file's world that points up."""
    has_fingers: bool = False
    betas: Float[Tensor, " S"] | None = None
    """SMPL's shape coefficients, as the file has them."""
    gender: str = "neutral"
    sentences: tuple[str, ...] = ()
    """What the file says that the hands do, in any of several wordings."""
    notes: Notes = ()
    """What had to be assumed, in words."""

    __eq__ = equal_values
    __repr__ = repr_by_shapes

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
    """A motion in the world of a file with y up instead; the axis that was up; what was assumed.

    Where nobody says which one that is, it is the `usual` one of such files, else the one along
    which the spine points on average.
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
    """The same motion at about `fps` frames a second; the first and last moment stay frames."""
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
    """The recording, unless it can be no body in metres, radians and frames a second."""
    name = recording.source
    if not SMALLEST_FPS <= recording.fps <= LARGEST_FPS:
        raise InputError(
            f"{name}: the frame rate must be {SMALLEST_FPS:g} to {LARGEST_FPS:g} frames a second, "
            f"got {recording.fps:g}; correct it in the file"
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
    """A note where the pelvis is or moves as one does whose place is not in metres."""
    root = recording.motion.root
    far = float(root[:, 1].abs().max())
    speeds = recording.fps * root.diff(dim=0).norm(dim=-1)
    speed = float(speeds.nanmedian()) if len(speeds) else 0
    if far < FAR_UP and speed < FAST:
        return ()
    return (
        f"the pelvis is up to {far:.3g} m above or below the origin and moves at {speed:.3g} m/s; "
        "check that its places are in metres, and the frame rate",
    )


def resting_body(frames: int) -> BodyMotion:
    """A body in the T-pose at the origin."""
    upright = torch.eye(3).expand(frames, len(JOINT_NAMES), 3, 3).clone()
    return BodyMotion(torch.zeros(frames, 3), upright)
