"""One clip, many rows: all that is measured on a cleaned hand, in the units of the tables."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.choices import HandSource
from geneoh.evaluation.cases import Case
from geneoh.evaluation.methods import Cleaned, joints_of
from geneoh.fitting.fit import fit_keypoints
from geneoh.geometry.distance import SurfaceQuery
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics.accuracy import mpjpe, mpvpe, within_spread
from geneoh.metrics.contact import (
    contact_agreement,
    contact_iou,
    fingertip_slip,
    motion_consistency,
    penetration_depth,
    proximity_error,
    tips_in_contact,
)
from geneoh.metrics.correspondence import contact_points, object_contact
from geneoh.metrics.frames import mean_over_frames, valid_differences
from geneoh.metrics.smoothness import acceleration, acceleration_error, jerk, per_frame_squared
from geneoh.metrics.volume import intersection_volume
from geneoh.pipeline.subject import Subject, subject_of
from geneoh.sequence.sequence import Sequence
from geneoh.synthesis.shards import seed_of

Key = tuple[str, str, str, int, str]
"""Data set, clip, noise, seed, row."""
TIPS = list(TIP_KEYPOINTS)
SAME = 1e-4
"""Metres up to which given parameters are taken to make the given keypoints."""


@dataclass(frozen=True)
class Measure:
    """One number of a score, mean over the scored frames."""

    key: str
    title: str
    unit: str
    better: Literal["less", "more"]
    digits: int = 1
    tabled: bool = True
    """Whether it is a column of the tables; the others stand in the files."""


MEASURES = (
    Measure("mpjpe_mm", "MPJPE", "mm", "less"),
    Measure("mpvpe_mm", "MPVPE", "mm", "less"),
    Measure("within_spread_pct", "in 90% radius", "%", "more", tabled=False),
    Measure("contact_iou_pct", "C-IoU", "%", "more"),
    Measure("contact_iou_verts_pct", "C-IoU by distance", "%", "more", tabled=False),
    Measure("tips_precision_pct", "tip contact precision", "%", "more", tabled=False),
    Measure("tips_recall_pct", "tip contact recall", "%", "more", tabled=False),
    Measure("tips_f_pct", "tip F", "%", "more"),
    Measure("proximity_mm", "prox.", "mm", "less"),
    Measure("acceleration_error_mm", "acc. err.", "mm/f²", "less"),
    Measure("volume_cm3", "IV", "cm³", "less", 2),
    Measure("depth_mm", "depth", "mm", "less", 2),
    Measure("consistency_mm2", "consist.", "mm²", "less"),
    Measure("slip_mm_s", "tip slip", "mm/s", "less"),
    Measure("acceleration_mm", "accel.", "mm/f²", "less"),
    Measure("jerk_m_s3", "jerk", "m/s³", "less", tabled=False),
)
"""Definitions: `geneoh.metrics`. All from IV on need no ground truth."""

COLUMNS = tuple(measure for measure in MEASURES if measure.tabled)


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
class Judge:
    """How rows are judged: by which mesh where they are keypoints alone, and how closely."""

    source: HandSource = "embedded"
    mano_dir: Path | None = None
    close_frames: int = 20
    """Frames of a clip at most in which the dear measures are taken, volume and contact on the
    object: evenly spread, the same for every row."""

    def close(self, frames: int) -> Int[Tensor, " N"]:
        """Those frames of a clip."""
        count = min(frames, self.close_frames)
        return ((torch.arange(count) + 0.5) * frames / count).long()

    def subject(self, sequence: Sequence) -> Subject:
        """Whose hand it is, by a sequence's own shape, pose and keypoints."""
        hand = sequence.hands[0]
        return subject_of(hand, load_hand(hand.side, source=self.source, mano_dir=self.mano_dir))

    def fitted(self, subject: Subject, joints: Float[Tensor, "T 21 3"]) -> Float[Tensor, "T V 3"]:
        """The person's mesh on keypoints, without a look at the object.

        The given parameters themselves where they make these keypoints, else a fit.
        """
        state = subject.start
        if state is None or not self._makes(subject, joints):
            state = fit_keypoints(
                joints[None], torch.ones_like(joints[None, ..., 0]), subject.shaped, state
            )
        return subject.shaped.verts_from_rotations(state.rotations, state.wrist).verts[0]

    @staticmethod
    def _makes(subject: Subject, joints: Float[Tensor, "T 21 3"]) -> bool:
        assert subject.start is not None, "asked only of a person with parameters"
        made = subject.shaped.joints_from_rotations(subject.start.rotations, subject.start.wrist)[0]
        return bool((made - joints).norm(dim=-1).max() < SAME)


@dataclass(frozen=True)
class Truth:
    """The clean clip, as far as rows are held against it."""

    joints: Float[Tensor, "T 21 3"]
    verts: Float[Tensor, "T V 3"]
    distance: Float[Tensor, "T V"]
    tips: Bool[Tensor, "T 5"]
    """Fingertips that touch the object."""
    touched: Bool[Tensor, "N P"]
    """Object points in contact, in the frames that are looked at closely."""


class Bench:
    """A case with what all its rows are held against, made once."""

    def __init__(self, case: Case, judge: Judge) -> None:
        """Nothing is measured yet."""
        self.case, self.judge = case, judge
        self.side, self.fps = case.noisy.hands[0].side, case.noisy.fps
        self.surface = case.noisy.object.surface()
        generator = torch.Generator().manual_seed(seed_of("contact", case.clip))
        self.samples = contact_points(self.surface.fields, generator=generator)
        model = load_hand(self.side, source=judge.source, mano_dir=judge.mano_dir)
        self.faces = model.faces
        self.close = judge.close(case.noisy.frames)

    @cached_property
    def subject(self) -> Subject:
        """Whose hand the noisy clip shows: rows of keypoints get this person's mesh."""
        return self.judge.subject(self.case.noisy)

    @cached_property
    def truth(self) -> Truth | None:
        """The clean clip; None where there is none."""
        clean = self.case.clean
        if clean is None:
            return None
        joints = joints_of(clean)
        verts = self.judge.fitted(self.judge.subject(clean), joints)
        distance = self.surface.query(verts).distance
        tips = tips_in_contact(distance, verts, joints[:, TIPS])
        return Truth(joints, verts, distance, tips, self.touched(verts))

    def touched(self, verts: Float[Tensor, "T V 3"]) -> Bool[Tensor, "N P"]:
        """Object points in contact, in the frames that are looked at closely."""
        surface = self.surface.at(self.close)
        return object_contact(verts[self.close], self.faces, surface, self.samples)

    def score(self, row: str, cleaned: Cleaned, seconds: float) -> Score:
        """All measures of one cleaned hand."""
        joints, verts, valid = cleaned.joints, cleaned.verts, cleaned.valid
        if verts is None:
            verts = self.judge.fitted(self.subject, joints)
        query = self.surface.query(verts)
        values = self._plausibility(joints, verts, query, valid)
        by_frame: list[float | None] = []
        by_joint: list[float | None] = []
        if self.truth is not None:
            values |= self._accuracy(self.truth, joints, verts, query, valid)
            off = 1000 * (joints - self.truth.joints).norm(dim=-1)
            off[~valid] = torch.nan
            spread = cleaned.spread
            if spread is not None:
                inside = within_spread(joints, self.truth.joints, spread)
                values["within_spread_pct"] = 100 * mean(inside, valid)
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
        query: SurfaceQuery,
        valid: Bool[Tensor, " T"],
    ) -> dict[str, float]:
        """What needs no ground truth."""
        surface, fps = self.surface, self.fps
        shared = intersection_volume(verts[self.close], self.faces, surface.at(self.close))
        slip = fingertip_slip(verts, query, joints[:, TIPS], surface, fps)
        accelerated = per_frame_squared(acceleration(joints, fps), fps)
        pairs = valid_differences(valid, 1)
        return {
            "volume_cm3": 1e6 * mean(shared, valid[self.close]),
            "depth_mm": 1000 * mean(penetration_depth(query.distance), valid),
            "consistency_mm2": 1e6 * mean(motion_consistency(verts, query, surface), pairs),
            "slip_mm_s": 1000 * mean(slip, pairs),
            "acceleration_mm": mean(accelerated, valid_differences(valid, 2)),
            "jerk_m_s3": mean(jerk(joints, fps), valid_differences(valid, 3)),
        }

    def _accuracy(
        self,
        truth: Truth,
        joints: Float[Tensor, "T 21 3"],
        verts: Float[Tensor, "T V 3"],
        query: SurfaceQuery,
        valid: Bool[Tensor, " T"],
    ) -> dict[str, float]:
        """How far from the clean clip."""
        jolted = acceleration_error(joints, truth.joints, self.fps)
        tips = tips_in_contact(query.distance, verts, joints[:, TIPS])
        close = valid[self.close]
        fingers = contact_agreement(tips[valid], truth.tips[valid])
        on_object = contact_agreement(self.touched(verts)[close], truth.touched[close])
        distance, true = query.distance, truth.distance
        on_hand = contact_iou(distance[valid], true[valid])
        jolted = per_frame_squared(jolted, self.fps)
        return {
            "mpjpe_mm": 1000 * mean(mpjpe(joints, truth.joints), valid),
            "mpvpe_mm": 1000 * mean(mpvpe(verts, truth.verts), valid),
            "contact_iou_pct": 100 * float(on_object.iou),
            "contact_iou_verts_pct": 100 * float(on_hand),
            "tips_precision_pct": 100 * float(fingers.precision),
            "tips_recall_pct": 100 * float(fingers.recall),
            "tips_f_pct": 100 * float(fingers.f_score),
            "proximity_mm": 1000 * mean(proximity_error(distance, true), valid),
            "acceleration_error_mm": mean(jolted, valid_differences(valid, 2)),
        }


def mean(values: Float[Tensor, " T"], valid: Bool[Tensor, " T"]) -> float:
    """Mean over the scored frames that have a value."""
    return float(mean_over_frames(values, valid))


def rounded(value: Any, digits: int = 2) -> float | None:
    """A number for a file; None for what is none."""
    return None if value != value else round(value, digits)
