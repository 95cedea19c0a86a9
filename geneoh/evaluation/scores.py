"""Scores: all measures of one cleaned hand, in the units of the tables."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.evaluation.cases import Case, CaseKey
from geneoh.evaluation.methods import CleanedHand, joints_of
from geneoh.evaluation.options import EvaluationOptions
from geneoh.fitting.fit import fit_keypoints
from geneoh.fitting.subject import Subject, subject_of
from geneoh.geometry.distance import SurfaceQuery
from geneoh.hand.library import hand_of_betas
from geneoh.hand.model import HandModel
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics import accuracy, contact, smoothness
from geneoh.metrics.correspondence import contact_points, object_contact
from geneoh.metrics.smoothness import mean_over_frames
from geneoh.metrics.volume import intersection_volume
from geneoh.seeds import seeded_generator
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.sequence.windows import spread_frames

ScoreKey = tuple[str, str, str, int, str]  # data set, clip, noise, seed and method
TIPS = list(TIP_KEYPOINTS)
SAME_JOINTS = 1e-4  # tolerance in metres within which pose parameters reproduce keypoints


@dataclass(frozen=True)
class Measure:
    """One number of a score."""

    key: str  # name in the files
    title: str  # name in the tables
    unit: str
    better: Literal["less", "more", "as real"]
    meaning: str = ""  # description below the tables; without it, the measure is in the files only
    digits: int = 1  # digits after the point in the tables


MEASURES = (
    Measure("mpjpe_mm", "MPJPE", "mm", "less", "mean distance of the keypoints to the truth"),
    Measure("mpvpe_mm", "MPVPE", "mm", "less", "mean distance of the vertices to the truth"),
    Measure("within_spread_pct", "in 90% radius", "%", "more"),
    Measure(
        *("contact_iou_pct", "C-IoU", "%", "more"),
        "overlap of the contact map on the object with the true one",
    ),
    Measure("contact_iou_verts_pct", "C-IoU by distance", "%", "more"),
    Measure("tips_precision_pct", "tip contact precision", "%", "more"),
    Measure("tips_recall_pct", "tip contact recall", "%", "more"),
    Measure("tips_f_pct", "tip F", "%", "more", "F-score of which fingertips touch and when"),
    Measure(
        "proximity_mm", "prox.", "mm", "less", "error of the vertices' distances to the object"
    ),
    Measure(
        *("acceleration_error_mm", "acc. err.", "mm/f²", "less"),
        "error of the keypoints' acceleration, a frame squared",
    ),
    Measure("volume_cm3", "IV", "cm³", "less", "volume that hand and object share", 2),
    Measure(
        "depth_mm", "depth", "mm", "less", "depth of each frame's deepest vertex in the object", 2
    ),
    Measure(
        *("consistency_mm2", "consist.", "mm²", "less"),
        "motion of the hand against the object where they are nearest",
    ),
    Measure(
        *("slip_mm_s", "tip slip", "mm/s", "less"),
        "speed at which touching fingertips slide over the object",
    ),
    Measure(
        *("acceleration_mm", "accel.", "mm/f²", "less"),
        "mean size of the keypoints' acceleration, a frame squared",
    ),
    Measure("jerk_m_s3", "jerk", "m/s³", "less"),
)
"""Definitions: `geneoh.metrics`. The measures from IV on need no ground truth."""

COLUMNS = tuple(measure for measure in MEASURES if measure.meaning)


@dataclass(frozen=True)
class Score:
    """The measures of one method on one case."""

    dataset: str
    clip: str
    noise: str
    seed: int
    method: str
    values: dict[str, float | None] = field(default_factory=dict)
    """Values by the keys of the measures; None where there is nothing to measure."""
    error_by_frame_mm: list[float | None] = field(default_factory=list)
    """Mean error of each frame, and below of each keypoint; empty without ground truth."""
    error_by_joint_mm: list[float | None] = field(default_factory=list)
    seconds: float = 0.0
    """Processor time of the cleaning, on one core."""
    failed: str = ""
    """Error message if the method failed; empty otherwise."""

    @property
    def case_key(self) -> CaseKey:
        """Unique key of the case."""
        return self.dataset, self.clip, self.noise, self.seed

    @property
    def key(self) -> ScoreKey:
        """Unique key of this score in an evaluation."""
        return *self.case_key, self.method


def fitted_verts(subject: Subject, joints: Float[Tensor, "T 21 3"]) -> Float[Tensor, "T V 3"]:
    """The person's mesh: posed by the track's parameters if these reproduce the keypoints, else
    fitted to the keypoints."""
    shaped, state = subject.shaped, subject.start
    if state is not None:
        made = shaped.joints_from_rotations(state.rotations, state.wrist)[0]
        if bool((made - joints).norm(dim=-1).max() < SAME_JOINTS):
            return shaped.verts_from_rotations(state.rotations, state.wrist).verts[0]
    state = fit_keypoints(joints[None], torch.ones_like(joints[None, ..., 0]), shaped, state)
    return shaped.verts_from_rotations(state.rotations, state.wrist).verts[0]


@dataclass(frozen=True)
class MeasuredHand:
    """A hand over the frames of a case, with its distances to the object."""

    joints: Float[Tensor, "T 21 3"]
    verts: Float[Tensor, "T V 3"]
    query: SurfaceQuery
    tips: Bool[Tensor, "T 5"]  # fingertips that touch the object


class CaseScorer:
    """Scores methods on one case; the ground truth is measured only once."""

    def __init__(self, case: Case, options: EvaluationOptions) -> None:
        """Read the case; the ground truth is measured when it is first needed."""
        self.case, self.options = case, options
        hand, self.fps = case.noisy.hands[0], case.noisy.fps
        self.surface = case.recording.object.surface()  # true poses: the input's may be noisy
        generator = seeded_generator("contact", case.clip.name)
        self.samples = contact_points(self.surface.fields, generator=generator)
        self.faces = self.model(hand).faces
        self.close = torch.tensor(spread_frames(case.noisy.frames, options.closely_measured))

    def model(self, hand: HandTrack) -> HandModel:
        """The hand model with which a track's mesh is measured."""
        source, mano_dir = self.options.cleaner.hand, self.options.cleaner.mano_dir
        return hand_of_betas(hand.side, hand.hand_model, asked=source, mano_dir=mano_dir)

    def subject_in(self, sequence: Sequence) -> Subject:
        """Shape and skeleton of the person, from the betas, pose and keypoints of a sequence."""
        return subject_of(sequence.hands[0], self.model(sequence.hands[0]))

    @cached_property
    def subject(self) -> Subject:
        """The person of the noisy clip, whose mesh is fitted to a method's keypoints."""
        return self.subject_in(self.case.noisy)

    @cached_property
    def truth(self) -> MeasuredHand | None:
        """The clean clip; None without ground truth."""
        clean = self.case.clean
        if clean is None:
            return None
        joints = joints_of(clean)
        return self.measured(joints, fitted_verts(self.subject_in(clean), joints))

    @cached_property
    def truly_touched(self) -> Bool[Tensor, "N P"]:
        """Object points that the clean hand touches, in the same frames as `touched`."""
        assert self.truth is not None, "needed only with ground truth"
        return self.touched(self.truth.verts)

    def measured(
        self, joints: Float[Tensor, "T 21 3"], verts: Float[Tensor, "T V 3"]
    ) -> MeasuredHand:
        """A hand with its distances to the object."""
        query = self.surface.query(verts)
        tips = contact.tips_in_contact(query.distance, verts, joints[:, TIPS])
        return MeasuredHand(joints, verts, query, tips)

    def touched(self, verts: Float[Tensor, "T V 3"]) -> Bool[Tensor, "N P"]:
        """Sampled object points in contact with the mesh, in the N frames of expensive metrics."""
        surface = self.surface.at(self.close)
        return object_contact(verts[self.close], self.faces, surface, self.samples)

    def score(self, method: str, cleaned: CleanedHand, seconds: float) -> Score:
        """All measures of a cleaned hand that a method made in `seconds` of processor time."""
        verts, truth = cleaned.verts, self.truth
        if verts is None:
            verts = fitted_verts(self.subject, cleaned.joints)
        hand = self.measured(cleaned.joints, verts)
        values = self._plausibility(hand)
        by_frame, by_joint = [], []
        if truth is not None:
            values |= self._accuracy(hand, truth)
            if cleaned.spread is not None:
                inside = accuracy.within_spread(hand.joints, truth.joints, cleaned.spread)
                values["within_spread_pct"] = 100 * mean(inside)
            error = 1000 * (hand.joints - truth.joints).norm(dim=-1)
            by_frame, by_joint = error.mean(-1).tolist(), error.mean(0).tolist()
        return Score(
            *self.case.key,
            method,
            values={key: rounded(value, 5) for key, value in values.items()},
            error_by_frame_mm=[rounded(value) for value in by_frame],
            error_by_joint_mm=[rounded(value) for value in by_joint],
            seconds=round(seconds, 3),
        )

    def _plausibility(self, hand: MeasuredHand) -> dict[str, float]:
        """The measures that need no ground truth."""
        joints, verts, query, fps = hand.joints, hand.verts, hand.query, self.fps
        near = self.surface.at(self.close)
        volume = intersection_volume(verts[self.close], self.faces, near)
        slip = contact.fingertip_slip(verts, query, joints[:, TIPS], self.surface, fps)
        consistency = contact.motion_consistency(verts, query, self.surface)
        accelerated = smoothness.in_mm_per_frame_squared(smoothness.acceleration(joints, fps), fps)
        return {
            "volume_cm3": 1e6 * mean(volume),
            "depth_mm": 1000 * mean(contact.penetration_depth(query.distance)),
            "consistency_mm2": 1e6 * mean(consistency),
            "slip_mm_s": 1000 * mean(slip),
            "acceleration_mm": mean(accelerated),
            "jerk_m_s3": mean(smoothness.jerk(joints, fps)),
        }

    def _accuracy(self, hand: MeasuredHand, truth: MeasuredHand) -> dict[str, float]:
        """The measures that compare the hand with the ground truth."""
        tips = contact.contact_agreement(hand.tips, truth.tips)
        touched = self.touched(hand.verts), self.truly_touched
        distance, true = hand.query.distance, truth.query.distance
        error = smoothness.acceleration_error(hand.joints, truth.joints, self.fps)
        error = smoothness.in_mm_per_frame_squared(error, self.fps)
        return {
            "mpjpe_mm": 1000 * mean(accuracy.mpjpe(hand.joints, truth.joints)),
            "mpvpe_mm": 1000 * mean(accuracy.mpvpe(hand.verts, truth.verts)),
            "contact_iou_pct": 100 * float(contact.contact_agreement(*touched).iou),
            "contact_iou_verts_pct": 100 * float(contact.contact_iou(distance, true)),
            "tips_precision_pct": 100 * float(tips.precision),
            "tips_recall_pct": 100 * float(tips.recall),
            "tips_f_pct": 100 * float(tips.f_score),
            "proximity_mm": 1000 * mean(contact.proximity_error(distance, true)),
            "acceleration_error_mm": mean(error),
        }


def mean(values: Float[Tensor, " T"]) -> float:
    """Mean over the frames with a value, as a number."""
    return float(mean_over_frames(values))


def rounded(value: float, digits: int = 2) -> float | None:
    """A rounded number for a file; None for NaN."""
    return None if value != value else round(value, digits)
