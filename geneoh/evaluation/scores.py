"""One clip, many rows: all that is measured on a cleaned hand, in the units of the tables."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.evaluation.cases import Case
from geneoh.evaluation.rows import Cleaned, joints_of
from geneoh.fitting.fit import fit_keypoints
from geneoh.geometry.distance import SurfaceDistance, SurfaceQuery, query_parts
from geneoh.hand.library import Source, load_hand
from geneoh.metrics.accuracy import mpjpe, mpvpe
from geneoh.metrics.contact import (
    contact_iou,
    motion_consistency,
    penetration_depth,
    proximity_error,
)
from geneoh.metrics.frames import mean_over_frames, valid_differences
from geneoh.metrics.smoothness import acceleration, acceleration_error, per_frame_squared
from geneoh.metrics.volume import intersection_volume
from geneoh.pipeline.person import Person, person_of
from geneoh.sequence.tracks import Sequence

Key = tuple[str, str, str, int, str]
"""Data set, clip, noise, seed, row."""
SAME = 1e-4
"""Metres up to which given parameters are taken to make the given keypoints."""


@dataclass(frozen=True)
class Measure:
    """One column of the tables."""

    key: str
    title: str
    unit: str
    better: Literal["less", "more"]
    digits: int = 1
    truth: bool = True
    """Whether it needs the ground truth."""


MEASURES = (
    Measure("mpjpe_mm", "MPJPE", "mm", "less"),
    Measure("mpvpe_mm", "MPVPE", "mm", "less"),
    Measure("contact_iou_pct", "C-IoU", "%", "more"),
    Measure("proximity_mm", "prox.", "mm", "less"),
    Measure("acceleration_error_mm", "acc.err", "mm/f²", "less"),
    Measure("volume_cm3", "IV", "cm³", "less", 2, truth=False),
    Measure("depth_mm", "depth", "mm", "less", 2, truth=False),
    Measure("consistency_mm2", "consist.", "mm²", "less", truth=False),
    Measure("acceleration_mm", "accel.", "mm/f²", "less", truth=False),
)
"""Mean over the scored frames, each."""


@dataclass(frozen=True)
class Score:
    """What one row did to one case."""

    dataset: str
    clip: str
    noise: str
    seed: int
    row: str
    values: dict[str, float | None] = field(default_factory=dict)
    """By the measures' keys; None where there is nothing to measure."""
    error_by_frame_mm: list[float | None] = field(default_factory=list)
    """Mean keypoint error of each frame; empty without ground truth."""
    error_by_joint_mm: list[float | None] = field(default_factory=list)
    seconds: float = 0.0
    """What cleaning took, on one core."""
    failed: str = ""
    """Why there is nothing, in words."""

    @property
    def key(self) -> Key:
        """What tells this score from every other one of an evaluation."""
        return self.dataset, self.clip, self.noise, self.seed, self.row


@dataclass(frozen=True)
class Body:
    """The mesh by which every row of keypoints is judged."""

    source: Source = "embedded"
    mano_dir: Path | None = None

    def person(self, sequence: Sequence) -> Person:
        """Whose hand it is, by a sequence's own shape, pose and keypoints."""
        hand = sequence.hands[0]
        return person_of(hand, load_hand(hand.side, source=self.source, mano_dir=self.mano_dir))

    def fitted(self, person: Person, joints: Float[Tensor, "T 21 3"]) -> Float[Tensor, "T V 3"]:
        """The person's mesh on keypoints, without a look at the object.

        The given parameters themselves where they make these keypoints, else a fit.
        """
        state = person.start
        if state is None or not self._makes(person, joints):
            state = fit_keypoints(
                joints[None], torch.ones_like(joints[None, ..., 0]), person.shaped, state
            )
        return person.shaped.verts_from_rotations(state.rotations, state.wrist).verts[0]

    @staticmethod
    def _makes(person: Person, joints: Float[Tensor, "T 21 3"]) -> bool:
        assert person.start is not None, "asked only of a person with parameters"
        made = person.shaped.joints_from_rotations(person.start.rotations, person.start.wrist)[0]
        return bool((made - joints).norm(dim=-1).max() < SAME)


class Bench:
    """A case with what all its rows are held against, made once."""

    def __init__(self, case: Case, body: Body) -> None:
        """Nothing is measured yet."""
        self.case, self.body = case, body
        self.moving = case.noisy.object
        self.fields = tuple(SurfaceDistance(mesh) for mesh in self.moving.meshes)

    @cached_property
    def person(self) -> Person:
        """Whose hand the noisy clip shows: rows of keypoints get this person's mesh."""
        return self.body.person(self.case.noisy)

    @cached_property
    def truth(self) -> tuple[Tensor, Tensor, SurfaceQuery] | None:
        """Keypoints, vertices and the vertices' relation to the object of the clean clip."""
        clean = self.case.clean
        if clean is None:
            return None
        joints = joints_of(clean)
        verts = self.body.fitted(self.body.person(clean), joints)
        return joints, verts, self.query(verts)

    def query(self, verts: Float[Tensor, "T V 3"]) -> SurfaceQuery:
        """The object's answer to hand vertices."""
        return query_parts(self.fields, self.moving.rotation, self.moving.translation, verts)

    def score(self, row: str, cleaned: Cleaned, seconds: float) -> Score:
        """All measures of one cleaned hand."""
        verts = cleaned.verts
        if verts is None:
            verts = self.body.fitted(self.person, cleaned.joints)
        values = self._plausibility(cleaned.joints, verts, cleaned.valid)
        by_frame: list[float | None] = []
        by_joint: list[float | None] = []
        if self.truth is not None:
            values |= self._accuracy(cleaned.joints, verts, cleaned.valid)
            off = 1000 * (cleaned.joints - self.truth[0]).norm(dim=-1)
            off[~cleaned.valid] = torch.nan
            by_frame = [rounded(x) for x in off.mean(-1).tolist()]
            by_joint = [rounded(x) for x in off.nanmean(0).tolist()]
        case = self.case
        return Score(
            *(case.dataset, case.clip, case.noise, case.seed, row),
            values={key: rounded(value, 5) for key, value in values.items()},
            error_by_frame_mm=by_frame,
            error_by_joint_mm=by_joint,
            seconds=round(seconds, 3),
        )

    def _plausibility(
        self,
        joints: Float[Tensor, "T 21 3"],
        verts: Float[Tensor, "T V 3"],
        valid: Bool[Tensor, " T"],
    ) -> dict[str, float]:
        """What needs no ground truth."""
        place = (self.fields, self.moving.rotation, self.moving.translation)
        query = self.query(verts)
        hand = load_hand(
            self.case.noisy.hands[0].side, source=self.body.source, mano_dir=self.body.mano_dir
        )
        shared = intersection_volume(verts, hand.faces, *place).volume
        moved = motion_consistency(verts, query, *place)
        fps = self.case.noisy.fps
        accelerated = per_frame_squared(acceleration(joints, fps), fps)
        return {
            "volume_cm3": 1e6 * mean(shared, valid),
            "depth_mm": 1000 * mean(penetration_depth(query.distance), valid),
            "consistency_mm2": 1e6 * mean(moved, valid_differences(valid, 1)),
            "acceleration_mm": mean(accelerated, valid_differences(valid, 2)),
        }

    def _accuracy(
        self,
        joints: Float[Tensor, "T 21 3"],
        verts: Float[Tensor, "T V 3"],
        valid: Bool[Tensor, " T"],
    ) -> dict[str, float]:
        """How far from the clean clip."""
        assert self.truth is not None, "asked only where there is a ground truth"
        true_joints, true_verts, true_query = self.truth
        distance = self.query(verts).distance
        fps = self.case.noisy.fps
        jolted = per_frame_squared(acceleration_error(joints, true_joints, fps), fps)
        values = {
            "mpjpe_mm": 1000 * mean(mpjpe(joints, true_joints), valid),
            "acceleration_error_mm": mean(jolted, valid_differences(valid, 2)),
        }
        if verts.shape == true_verts.shape:
            values |= {
                "mpvpe_mm": 1000 * mean(mpvpe(verts, true_verts), valid),
                "proximity_mm": 1000 * mean(proximity_error(distance, true_query.distance), valid),
                "contact_iou_pct": 100
                * float(contact_iou(distance[valid], true_query.distance[valid])),
            }
        return values


def mean(values: Float[Tensor, " T"], valid: Bool[Tensor, " T"]) -> float:
    """Mean over the scored frames that have a value."""
    return float(mean_over_frames(values, valid))


def rounded(value: Any, digits: int = 2) -> float | None:
    """A number for a file; None for what is none."""
    return None if value != value else round(value, digits)
