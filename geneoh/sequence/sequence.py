"""One interaction: up to two hands and one object of rigid parts over T frames, metres, radians."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import Bundle, ByValue, Index, conform
from geneoh.choices import HAND_SOURCES, OTHER_SIDE, SIDES, Side
from geneoh.errors import InputError, numbered
from geneoh.geometry.distance import MovingSurface, SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mesh_files import meshes_of
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points, mirror_rotations

WELL_SEEN = 0.95  # quantile of confidences: a maximum would depend on a single keypoint


@dataclass(frozen=True, eq=False, repr=False)
class HandTrack(ByValue, Bundle):
    """One hand over T frames in the world frame; at least `joints`, or `pose` with `wrist`."""

    side: Side
    valid: Bool[Tensor, " T"]
    """False where the hand was not observed; the other fields are meaningless in such a frame."""
    joints: Float[Tensor, "T 21 3"] | None = None
    """Keypoints in OpenPose order."""
    pose: Float[Tensor, "T 16 3"] | None = None
    """Axis-angle in MANO joint order, absolute (zero: the flat hand), global orientation first."""
    wrist: Float[Tensor, "T 3"] | None = None
    """Position of the wrist joint (the same point for any hand model)."""
    betas: Float[Tensor, " 10"] | None = None
    """Shape coefficients; they mean something only to `hand_model`."""
    hand_model: str | None = None
    """"embedded", "mano", or "mano-as-shipped" for left betas of the official left MANO file."""
    confidence: Float[Tensor, "T 21"] | None = None
    """Confidence of each keypoint, 0 to 1; only its relation to the others of the track counts."""
    joint_spread: Float[Tensor, "T 21"] | None = None
    """Expected root mean square error of each keypoint in metres; None where it is not known.

    Calibrated so that about 90% of the true keypoints lie within 1.44 times it
    (`geneoh.metrics.accuracy.RADIUS_90`, which takes errors as isotropic and normal): measured, 81
    to 97% on noisy versions of a recording and 94 to 99% on synthetic clips. The cleaner computes
    it from its samples where it draws several (`geneoh.pipeline.spread`)."""
    camera_ray: Float[Tensor, "T 3"] | None = None
    """Unit direction in the world from the camera to the hand, for hands that were estimated from
    images; None where it is not known (`geneoh.sequence.camera`)."""

    def __hash__(self) -> int:
        """A hash of side and length, which equal tracks share."""
        return hash((self.side, len(self.valid)))

    def __post_init__(self) -> None:
        """Convert arrays and lists, and refuse a track that has neither keypoints nor a pose."""
        if self.side not in SIDES:
            raise InputError(f"a hand's side must be 'left' or 'right', got {self.side!r:.60}")
        conform(self, f"the {self.side} hand")
        refuse_unknown_model(self.hand_model, f"the {self.side} hand")
        if self.joints is None and (self.pose is None or self.wrist is None):
            raise InputError(
                f"the {self.side} hand needs 'joints', or 'pose' together with 'wrist'; "
                "got neither, add one of them"
            )

    @property
    def trust(self) -> Float[Tensor, "T 21"]:
        """Weight of each keypoint, 0 to 1: 0 in frames without the hand, else its confidence in
        relation to `usual_confidence`, or 1 without confidences.

        A confidence of zero everywhere has no information and is ignored.
        """
        there = self.valid[:, None].float().expand(-1, 21)
        if self.confidence is None:
            return there
        trust = torch.where(self.valid[:, None], self.confidence.clamp(0, 1), 0.0)
        if not bool(trust.any()):
            return there
        return (trust / usual_confidence(trust)).clamp(max=1)

    @property
    def observed(self) -> Bool[Tensor, " T"]:
        """Frames in which some keypoint is trusted."""
        return self.trust.amax(-1) > 0

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.valid)

    def mirrored(self) -> "HandTrack":
        """The reflection x -> -x of this track: a left hand becomes a right one and back."""
        points = dict.fromkeys(("joints", "wrist", "camera_ray"), mirror_points)
        found = self.changed(pose=mirror_axis_angle, **points)
        return replace(found, side=OTHER_SIDE[self.side])

    def changed(self, **how: Callable[[Tensor], Tensor]) -> "HandTrack":
        """The track with a function applied to each named field that is not None."""
        known = {name: getattr(self, name) for name in how}
        return replace(self, **{n: how[n](old) for n, old in known.items() if old is not None})


def usual_confidence(confidence: Float[Tensor, "T 21"]) -> Float[Tensor, ""]:
    """The confidence of well seen keypoints: the quantile `WELL_SEEN` of those above zero.

    Trackers differ in the scale of their confidences, which says nothing about their errors.
    """
    known = confidence[confidence > 0]
    return known.kthvalue(math.ceil(WELL_SEEN * len(known))).values


def refuse_unknown_model(hand_model: str | None, where: str) -> None:
    """`InputError` for an unknown hand model; None, for betas of an unknown model, is fine."""
    if hand_model not in (None, *HAND_SOURCES):
        raise InputError(
            f"{where}: 'hand_model' must be one of {', '.join(HAND_SOURCES)}, got "
            f"{hand_model!r:.60}; correct it, or leave it out where the betas are not known"
        )


@dataclass(frozen=True, eq=False, repr=False)
class ObjectTrack(ByValue, Bundle):
    """An object of Q rigid parts: p_world = rotation @ p_object + translation."""

    meshes: tuple[Mesh, ...]
    rotation: Float[Tensor, "T Q 3 3"]
    translation: Float[Tensor, "T Q 3"]
    valid: Bool[Tensor, "T Q"] | None = None
    """False where a part's pose was not observed and is filled in; None where all were observed."""
    missing: str = ""
    """Why the meshes that its file names could not be read, in words; else empty."""

    def __hash__(self) -> int:
        """A hash of meshes and length, which equal tracks share."""
        return hash((self.meshes, len(self.rotation)))

    @classmethod
    def resting(cls, meshes: tuple[Mesh, ...], frames: int) -> "ObjectTrack":
        """An object at rest at the origin; without a mesh, no object: no pose is valid."""
        upright = torch.eye(3).expand(frames, max(1, len(meshes)), 3, 3).clone()
        valid = None if meshes else torch.zeros(upright.shape[:2], dtype=torch.bool)
        return cls(meshes, upright, torch.zeros(upright.shape[:3]), valid)

    def __post_init__(self) -> None:
        """Convert arrays and lists, one mesh or its file, and poses without the axis Q of parts."""
        own = isinstance(self.meshes, tuple) and all(isinstance(each, Mesh) for each in self.meshes)
        if not own:
            object.__setattr__(self, "meshes", meshes_of(self.meshes))
        for name, axes in (("rotation", 3), ("translation", 2)):
            motion = getattr(self, name)
            if getattr(motion, "ndim", None) == axes and len(self.meshes) <= 1:
                object.__setattr__(self, name, motion[:, None])
        conform(self, "the object")

    @property
    def observed(self) -> Bool[Tensor, "T Q"]:
        """Mask of the poses that were observed, not filled in."""
        if self.valid is not None:
            return self.valid
        return self.rotation.new_ones(self.rotation.shape[:2], dtype=torch.bool)

    @property
    def is_known(self) -> bool:
        """Whether there is an object at all: its mesh, or a pose of it in some frame."""
        return bool(self.meshes) or self.is_seen

    @property
    def is_seen(self) -> bool:
        """Whether a pose was observed in some frame."""
        return self.valid is None or bool(self.valid.any())

    @property
    def seen_parts(self) -> list[int]:
        """The parts of which a pose was observed in some frame."""
        if self.valid is None:
            return list(range(self.rotation.shape[1]))
        return torch.nonzero(self.valid.any(0))[:, 0].tolist()

    def name_of(self, part: int) -> str:
        """The name of a part in messages."""
        return "the object" if len(self.meshes) == 1 else f"part {part + 1} of the object"

    def seen_from(self, part: int, points: Float[Tensor, "T P 3"]) -> Float[Tensor, "T P 3"]:
        """Points of the world frame, transformed to the frame of a part in each frame, metres."""
        return (points - self.translation[:, part, None]) @ self.rotation[:, part]

    def filled_from(self, other: "ObjectTrack") -> "ObjectTrack":
        """The track with the poses of another one where a part was not observed, unless it never
        was."""
        lost = (~self.observed & self.observed.any(0))[..., None]
        if not bool(lost.any()):
            return self
        rotation = torch.where(lost[..., None], other.rotation, self.rotation)
        translation = torch.where(lost, other.translation, self.translation)
        return replace(self, rotation=rotation, translation=translation)

    def of_parts(self, parts: list[int]) -> "ObjectTrack":
        """The track of some of the parts alone."""
        return replace(
            self,
            meshes=tuple(self.meshes[part] for part in parts),
            rotation=self.rotation[:, parts],
            translation=self.translation[:, parts],
            valid=None if self.valid is None else self.valid[:, parts],
        )

    def mirrored(self) -> "ObjectTrack":
        """The reflection x -> -x of the meshes and of their motion."""
        meshes = tuple(mesh.mirrored() for mesh in self.meshes)
        rotation, translation = mirror_rotations(self.rotation), mirror_points(self.translation)
        return replace(self, meshes=meshes, rotation=rotation, translation=translation)

    def surface(self) -> MovingSurface:
        """The moving surface for distance queries; builds the search trees of the meshes."""
        fields = tuple(SurfaceDistance(mesh) for mesh in self.meshes)
        return MovingSurface(fields, self.rotation, self.translation)


@dataclass(frozen=True, eq=False, repr=False)
class Sequence(ByValue, Bundle):
    """Hands and object that share T frames at `fps` frames a second."""

    hands: tuple[HandTrack, ...]
    """At most one of each side; use `hand` to get one by its side. The right hand comes first from
    `load` and `from_arrays`, the left hand from generators; from `read` the order varies."""
    object: ObjectTrack
    fps: float
    source: str = ""
    """Where it came from, in words a person can use: a file name and the layout that was read."""
    left_out: str = ""
    """What the file holds that a sequence cannot, such as a body, in words; else empty."""
    assumed: tuple[str, ...] = ()
    """What was assumed when it was read, as sentences."""
    camera_to_world: Float[Tensor, "T 4 4"] | None = None
    """Poses of a camera that moves, if hands and object are in its frame instead of the world's."""

    def __post_init__(self) -> None:
        """Take one hand or a list of hands, any number as the rate, and arrays."""
        hands = (self.hands,) if isinstance(self.hands, HandTrack) else tuple(self.hands)
        object.__setattr__(self, "hands", hands)
        kinds = (*(type(hand) for hand in hands), type(self.object))
        if kinds != (HandTrack,) * len(hands) + (ObjectTrack,):
            got = ", ".join(kind.__name__ for kind in kinds)
            raise InputError(
                f"a Sequence is made of HandTracks and an ObjectTrack, got {got}; "
                "geneoh.from_arrays makes one of arrays"
            )
        try:
            object.__setattr__(self, "fps", float(self.fps))
        except (TypeError, ValueError):
            raise InputError(f"'fps' must be a number, got {self.fps!r:.60}; correct it") from None
        conform(self, "the sequence")

    def __repr__(self) -> str:
        """The hands, length, rate and source in one line."""
        hands = " and ".join(hand.side for hand in self.hands) or "no"
        source = self.source if len(self.source) <= 60 else f"{self.source[:60]}..."
        frames = numbered(self.frames, "frame")
        return f"Sequence({hands} hand, {frames}, {self.fps:g} fps, source={source!r})"

    def __str__(self) -> str:
        """The source, length, rate and number of parts in one line."""
        parts = len(self.object.meshes)
        around = f"object of {numbered(parts, 'part')}" if parts else "no object"
        frames = numbered(self.frames, "frame")
        named = self.source or "sequence"
        return f"{named}: {frames} at {self.fps:g} frames a second, {around}"

    def __getitem__(self, frames: Index) -> "Sequence":
        """The chosen frames; a step of n frames divides the frame rate by n."""
        return replace(super().__getitem__(frames), fps=self.fps / step_of(frames))

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.object.rotation)

    def hand(self, side: Side) -> HandTrack:
        """The track of one side; `InputError` when the sequence has none."""
        for hand in self.hands:
            if hand.side == side:
                return hand
        raise InputError(f"{self.source or 'the sequence'} holds no {side} hand")


def without_unseen(sequence: Sequence) -> Sequence:
    """The sequence without hands that are in no frame, unless none would remain: a part of a clip
    may lack one of its hands."""
    seen = tuple(hand for hand in sequence.hands if bool(hand.valid.any()))
    return replace(sequence, hands=seen) if 0 < len(seen) < len(sequence.hands) else sequence


def step_of(frames: Index) -> int:
    """The constant step between chosen frames; 1 where it varies or is not positive."""
    if isinstance(frames, slice):
        return frames.step or 1
    chosen = frames.cpu().numpy() if isinstance(frames, Tensor) else np.asarray(frames)
    steps = np.diff(np.flatnonzero(chosen) if chosen.dtype == bool else chosen)
    return int(steps[0]) if len(steps) and steps[0] > 0 and (steps == steps[0]).all() else 1
