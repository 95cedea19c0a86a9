"""One hand of an interaction as a mesh in the world, and its measures."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.choices import Side
from geneoh.errors import MissingAssetError
from geneoh.fitting.subject import POSE_MISFIT, Subject, subject_of
from geneoh.fitting.terms import HandState
from geneoh.geometry.distance import pairwise_distances
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points
from geneoh.hand.library import hand_of_betas, load_hand
from geneoh.hand.model import HandModel
from geneoh.metrics.report import FrameMeasures, measure_frames
from geneoh.sequence.gaps import blendable
from geneoh.sequence.sequence import HandTrack

NO_OBJECT = 10.0  # distance of all vertices where there is no object, metres
SPREAD_REACH = 0.015  # length scale of the weights that carry spread to vertices, metres


@dataclass(frozen=True)
class PosedTrack:
    """One hand as a mesh in the world over T frames, with measures computed on first use."""

    side: Side
    model: HandModel
    pose: Float[Tensor, "T 16 3"]  # axis-angle, MANO joint order; of the track, or fitted
    wrist: Float[Tensor, "T 3"]
    betas: Float[Tensor, " S"]
    verts: Float[Tensor, "T V 3"]
    joints: Float[Tensor, "T 21 3"]
    """The track's own; those of the pose where it has none or they were not seen."""
    valid: Bool[Tensor, " T"]  # frames with this hand
    fps: float
    distance_of: Callable[[Float[Tensor, "T V 3"]], Float[Tensor, "T V"]] | None
    """Signed distance of vertices to the object, metres; None without an object."""
    joint_spread: Float[Tensor, "T 21"] | None = None  # metres; see `HandTrack`

    @cached_property
    def distance(self) -> Float[Tensor, "T V"]:
        """Signed distance to the object in metres, negative inside; a lower bound beyond 3 cm."""
        if self.distance_of is None:
            return torch.full_like(self.verts[..., 0], NO_OBJECT)
        return self.distance_of(self.verts)

    @cached_property
    def measures(self) -> FrameMeasures:
        """Measures of each frame; without an object, depth and fingertips in contact are NaN."""
        found = measure_frames(self.distance, self.verts, self.joints, self.fps, self.valid)
        if self.distance_of is not None:
            return found
        unknown = torch.full_like(found.depth, torch.nan)
        return replace(found, depth=unknown, fingers=unknown)

    @cached_property
    def spread(self) -> Float[Tensor, "T V"] | None:
        """Expected error (`HandTrack.joint_spread`) carried to the vertices, metres."""
        if self.joint_spread is None:
            return None
        apart = pairwise_distances(self.verts[0], self.joints[0])
        weights = torch.softmax(-((apart / SPREAD_REACH) ** 2), dim=-1)
        return self.joint_spread @ weights.T


def pose_track(
    track: HandTrack,
    distance_of: Callable[[Float[Tensor, "T V 3"]], Float[Tensor, "T V"]] | None,
    fps: float,
    mano_dir: Path | str | None,
) -> PosedTrack:
    """The posed mesh of one track; of the embedded hand where MANO's files are missing."""
    try:
        model = hand_of_betas(track.side, track.hand_model, mano_dir=mano_dir)
    except MissingAssetError:
        model = load_hand(track.side)
    left = track.side == "left"
    right, right_model = (track.mirrored(), model.mirrored()) if left else (track, model)
    with torch.no_grad():
        subject = subject_of(right, right_model)
        state = posed_by_own_wrist(subject, right)
        posed = subject.shaped.verts_from_rotations(state.rotations, state.wrist)
        joints = subject.completed(state).joints
        verts, pose, wrist = posed.verts[0], state.pose[0], state.wrist[0]
        if left:
            verts, joints, wrist = (mirror_points(points) for points in (verts, joints, wrist))
            pose = mirror_axis_angle(pose)
        parameters = (track.side, model, pose, wrist, subject.betas)
        measured = (verts, joints, track.valid, fps, distance_of, track.joint_spread)
        return PosedTrack(*parameters, *measured)


def posed_by_own_wrist(subject: Subject, track: HandTrack) -> HandState:
    """The pose parameters of a subject with the wrist of its track, as other programs pose it,
    where the track has all parameters of the subject's hand.

    The keypoints of a result for keypoints alone are those of its tracker's skeleton, whose wrist
    may be millimetres from that of the hand. A wrist farther from it is taken for a fault.
    """
    state, model = subject.parameters(), subject.shaped.model
    if subject.start is None or track.betas is None or track.hand_model != model.name:
        return state
    wrist = blendable(track).wrist
    assert wrist is not None, "a pose comes with a wrist"
    apart = (wrist - subject.joints[:, 0]).norm(dim=-1)[track.observed].mean()
    return replace(state, wrist=wrist[None]) if apart <= POSE_MISFIT else state
