"""The subject of a track: the hand's shape, its keypoints, and parameters to start from."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.fitting.fit import fit_keypoints
from geneoh.fitting.shape import betas_from_lengths, betas_from_offsets
from geneoh.fitting.terms import HandState
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.model import HandModel, ShapedHand
from geneoh.hand.skeleton import bone_lengths, forward_kinematics, rest_offsets
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.sequence import HandTrack

POSE_MISFIT = 0.015
"""Mean distance of given joints to the given pose's own beyond which this is not used, metres."""


@dataclass(frozen=True)
class Subject(Bundle):
    """A right-hand track with gaps filled and one hand shape, as the stages take it."""

    shaped: ShapedHand
    betas: Float[Tensor, " S"]
    offsets: Float[Tensor, "1 20 3"]
    """The subject's own skeleton: exact where pose and joints are given, else that of `shaped`."""
    joints: Float[Tensor, "T 21 3"]
    trust: Float[Tensor, "T 21"]
    """Weight of each keypoint: 0 in frames that were filled, elsewhere the confidence, or 1."""
    start: HandState | None  # parameters of the input, one sample; None where it has no usable ones
    notes: tuple[str, ...]  # what had to be assumed, in words

    def parameters(self) -> HandState:
        """Parameters of the input, one sample; fitted to its keypoints where it has none."""
        if self.start is not None:
            return self.start
        return fit_keypoints(self.joints[None], self.trust[None], self.shaped)


def subject_of(track: HandTrack, model: HandModel) -> Subject:
    """Shape, keypoints and start of a right-hand track, on its device; joints decide over the pose.

    Betas of `model` are used as they are; else the shape is fitted to the rest skeleton (pose and
    joints) or to bone lengths (joints), or it is the mean hand (pose), which is noted.
    """
    notes: list[str] = []
    filled, model = fill_gaps(track), model.to(track.valid.device)
    known = track.betas if track.hand_model == model.name else None
    rotations = None if filled.pose is None else axis_angle_to_matrix(filled.pose)
    if filled.joints is None:
        assert rotations is not None, "a track without joints has a pose"
        assert filled.wrist is not None, "a pose comes with a wrist"
        if known is None:
            known = model.template.new_zeros(model.shape_dirs.shape[-1])
            notes.append(
                "the pose comes without joints and its betas belong to another hand model: "
                "the mean hand is used"
            )
        joints = model.shaped(known).joints_from_rotations(rotations, filled.wrist)
    else:
        joints = filled.joints
        if rotations is not None and _misfit(rotations, joints, track.valid) > POSE_MISFIT:
            notes.append("the given pose does not reach the given joints: the joints are used")
            rotations = None
    if known is not None:
        betas = known
    elif rotations is not None:
        betas = betas_from_offsets(model, rest_offsets(rotations, joints, track.valid))
    else:
        lengths = bone_lengths(joints[track.valid]).median(0).values
        betas = betas_from_lengths(model, lengths)
    trust = torch.ones_like(joints[..., 0]) if filled.confidence is None else filled.confidence
    trust = trust.clamp(0, 1) * track.valid[:, None]
    start = None if rotations is None else HandState(rotations[None], joints[None, :, 0])
    shaped = model.shaped(betas)
    if rotations is None or filled.joints is None:
        offsets = shaped.offsets
    else:
        offsets = rest_offsets(rotations, joints, track.valid)
    return Subject(shaped, betas, offsets[None], joints, trust, start, tuple(notes))


def _misfit(
    rotations: Float[Tensor, "T 16 3 3"],
    joints: Float[Tensor, "T 21 3"],
    valid: Bool[Tensor, " T"],
) -> float:
    """Mean distance in metres of joints to those of the pose with the best constant skeleton."""
    offsets = rest_offsets(rotations, joints, valid)
    made, _ = forward_kinematics(
        rotations[valid], joints[valid][:, 0], offsets.expand(int(valid.sum()), 20, 3)
    )
    return float((made - joints[valid]).norm(dim=-1).mean())
