"""Read and check the input of `Stream.push`, as a track of one frame."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import torch

from geneoh.choices import Side
from geneoh.config import closest_name
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rigid import Rigid
from geneoh.pipeline.observed import Observed
from geneoh.readers.arrays import array_of
from geneoh.readers.keypoints.missing import FEWEST_KEYPOINTS
from geneoh.readers.npz.files import hand_arrays
from geneoh.readers.npz.hands import read_own
from geneoh.readers.npz.layouts import CAMERA_POSES, HAND_FIELDS, quoted
from geneoh.readers.npz.objects import read_object
from geneoh.readers.object_poses import CAMERA_SHAPES, pose_field
from geneoh.readers.records import Array, Record, float32
from geneoh.sequence.placing import camera_of
from geneoh.sequence.sequence import HandTrack, ObjectTrack
from geneoh.sequence.validation import check_camera, check_hand, check_object, collapsed

FOUND = {"joints": FEWEST_KEYPOINTS / 21, "pose": 1.0, "wrist": 1.0}
"""Least share of finite values per field of a hand; with fewer the hand counts as lost."""


class FrameReader:
    """Reads the frames of one stream; the hand must have the same fields in all of them."""

    def __init__(
        self, side: Side, meshes: tuple[Mesh, ...], betas: Any, hand_model: str | None
    ) -> None:
        """Begin without frames; the arguments are those of `Stream`."""
        self._side: Side = side
        self._meshes = meshes
        self._shape = {} if betas is None else {f"{side}_betas": framed(betas)}
        self._shape |= {} if hand_model is None else {"hand_model": np.array(hand_model)}
        self._away_from_origin = False
        self._known: tuple[str, ...] = ()
        self._has_camera: bool | None = None
        self._first_place: Array | None = None

    def observed(self, hand: Any, object_pose: Any, where: str) -> Observed:
        """One frame from the arguments of `Stream.push`; `where` names it in messages."""
        return Observed(self.hand(hand, where), self.object(object_pose, where))

    def camera(self, given: Any, where: str) -> Rigid | None:
        """The pose of a camera that moves, in one frame, for hand and object in its frame; None
        for those in the world. The world's origin is put where the camera is first: single
        precision has too few digits far from it."""
        has_camera = given is not None
        if self._has_camera not in (None, has_camera):
            got = "one after frames without" if has_camera else "none after frames with one"
            raise InputError(
                f"{where}: the camera's pose must be in every frame or in none, got {got}; give "
                "the last known one where the camera was not tracked"
            )
        poses = None
        if has_camera:
            record = Record(where, {CAMERA_POSES: framed(given)}, "correct it")
            matrices = pose_field(record, CAMERA_POSES, shapes=CAMERA_SHAPES).copy()
            check_camera(float32(matrices), 1, where)
            if self._first_place is None:
                self._first_place = matrices[:, :3, 3].copy()
            matrices[:, :3, 3] -= self._first_place
            poses = float32(matrices)
        self._has_camera = has_camera
        return camera_of(poses)

    def hand(self, given: Any, where: str) -> HandTrack | None:
        """The hand of one frame; None where it is lost."""
        if given is None:
            return None
        fields = {**self._fields(given, where), **self._shape}
        if self._is_unplaced(given):
            return None
        record = Record(where, fields, "correct it")
        if self._away_from_origin and (name := f"{self._side}_joints") in record:
            points = record.numbers(name)  # a keypoint exactly at the origin means missing
            found = np.where((points == 0).all(-1, keepdims=True), np.nan, points)
            record = Record(where, {**fields, name: found}, "correct it")
        if is_lost(record, self._side):
            return None
        (hand,), _ = read_own(record, self._side)
        is_seen = hand.confidence is None or bool(hand.confidence.any())
        if not is_seen or bool(collapsed(hand).all()):
            return None
        check_hand(hand, where)
        has = {name for name, value in vars(hand).items() if value is not None}
        if f"{self._side}_confidence" not in record:  # missing keypoints may have added one
            has -= {"confidence"}
            if hand.confidence is None:
                hand = replace(hand, confidence=torch.ones(1, 21))
        known = tuple(sorted(has))
        self._known = self._known or known
        if known != self._known:
            raise InputError(
                f"{where}: the hand must have the same fields in every frame, got "
                f"{', '.join(known)} after {', '.join(self._known)}; give the same ones, or None "
                "where the hand is lost"
            )
        if hand.joints is not None:
            self._away_from_origin |= bool(hand.joints[:, 0].any())
        return hand

    def _is_unplaced(self, given: Any) -> bool:
        """Whether a field that places the hand is None: one that it had before, or all it has."""
        fields = given if isinstance(given, Mapping) else {}
        places = {name: fields[name] for name in FOUND if name in fields}
        missing = [name for name, value in places.items() if value is None]
        were_there = any(name in self._known for name in missing)
        return were_there or 0 < len(missing) == len(places)

    def _fields(self, given: Any, where: str) -> dict[str, Any]:
        """One frame of a hand as fields of the file format."""
        if isinstance(given, HandTrack):
            if given.side != self._side or given.frames != 1:
                raise InputError(
                    f"{where}: expected one frame of a {self._side} hand, got {given.frames} of a "
                    f"{given.side} one; two hands are two streams"
                )
            return hand_arrays(given)
        fields = given if isinstance(given, Mapping) else {"joints": given}
        if unknown := [name for name in fields if name not in HAND_FIELDS]:
            raise InputError(
                f"{where}: expected fields of a hand without its side, got {quoted(unknown)}; "
                + closest_name(str(unknown[0]), HAND_FIELDS)
            )
        return {
            f"{self._side}_{name}": framed(value)
            for name, value in fields.items()
            if value is not None
        }

    def object(self, given: Any, where: str) -> ObjectTrack:
        """The poses of the object's parts in one frame, NaN where lost."""
        if not self._meshes:
            return ObjectTrack.resting((), 1)
        parts = len(self._meshes)
        rotation = torch.full((1, parts, 3, 3), torch.nan)
        translation = torch.full((1, parts, 3), torch.nan)
        if given is not None:
            pair = is_pair(given)
            names = ("object_rotation", "object_translation") if pair else ("obj_pose",)
            values = map(framed, given if pair else (given,))
            record = Record(where, dict(zip(names, values, strict=True)), "correct it")
            motion = read_object(record, self._meshes, 1)
            check_object(motion, where)
            rotation, translation = motion.rotation, motion.translation
            if motion.valid is not None:
                rotation = rotation.masked_fill(~motion.valid[..., None, None], torch.nan)
                translation = translation.masked_fill(~motion.valid[..., None], torch.nan)
        return ObjectTrack((), rotation, translation)


def is_lost(record: Record, side: Side) -> bool:
    """Whether a hand is lost in one frame, by too few finite values or by `valid`."""
    for name, least in FOUND.items():
        field = f"{side}_{name}"
        if field in record and np.isfinite(record.numbers(field)).mean() < least:
            return True
    valid = f"{side}_valid"
    return valid in record and not bool(record.flags(valid).all())


def is_pair(given: Any) -> bool:
    """Whether a pose is a pair of rotation and translation, and not one or several matrices."""
    if not isinstance(given, tuple | list) or len(given) != 2:
        return False
    try:
        return isinstance(given, tuple) or np.shape(given[1])[-1:] == (3,)
    except ValueError:  # ragged lists
        return False


def framed(value: Any) -> Any:
    """A value of one frame with a leading frame axis; lists stay lists, because they may be
    ragged."""
    return array_of(value)[None] if isinstance(value, torch.Tensor | np.ndarray) else [value]
