"""The hand track that the stages work on: hand shape, keypoints and initial pose parameters."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.errors import numbered
from geneoh.fitting.fit import fit_keypoints
from geneoh.fitting.own_skeleton import OwnSkeleton, own_skeleton
from geneoh.fitting.shape import betas_from_lengths, betas_from_offsets, measured_lengths, size_of
from geneoh.fitting.terms import HandState
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.mano import MANO_NAMES
from geneoh.hand.model import HandModel, ShapedHand
from geneoh.hand.skeleton import (
    MANO_FROM_OPENPOSE,
    forward_kinematics,
    rest_offsets,
    trust_of_bones,
)
from geneoh.sequence.gaps import Carrier, blendable, observed_around
from geneoh.sequence.sequence import HandTrack

POSE_MISFIT = 0.015  # greatest mean distance of input joints to the posed hand's, metres
OTHER_SKELETON = 0.002
"""Root mean square difference of a tracker's rest offsets from those of the shaped hand, metres,
from which its joints lie elsewhere: of the same skeleton, lasting errors explain 1 mm."""
MOVED_BY_FINGERS = tuple(
    [MANO_FROM_OPENPOSE[entry] for entry in (3 * n + 2, 3 * n + 3, 16 + n)] for n in range(5)
)
"""Keypoints that the joints of each finger move, fingers in the order of the joints."""
OTHER_SIZE = 0.07  # share by which joints and betas of one hand may differ in size


@dataclass(frozen=True)
class Subject(Bundle):
    """A right-hand track with filled gaps and one hand shape: the input of the stages."""

    shaped: ShapedHand
    betas: Float[Tensor, " S"]
    offsets: Float[Tensor, "1 20 3"]  # rest skeleton: from pose and joints, else that of `shaped`
    joints: Float[Tensor, "T 21 3"]
    trust: Float[Tensor, "T 21"]  # `HandTrack.trust`: 0 in frames that were filled
    start: HandState | None  # input pose parameters, one sample; None if missing or unusable
    notes: tuple[str, ...]  # assumptions that were made, as sentences for the user

    def parameters(self) -> HandState:
        """Pose parameters of the input, one sample; fitted to the keypoints if it has none.

        Keypoints of another skeleton are followed as loosely as it differs: a hand that follows
        them closely bends and twists to reach joints that it does not have. A finger that is hidden
        in some frames is posed there between the frames around: the fit would relax it.
        """
        if self.start is not None:
            return self.start
        noise = self.keypoint_noise
        found = self._fitted(noise)
        other = self._other_skeleton(found)
        found = found if other < max(noise, OTHER_SKELETON) else self._fitted(other)
        return self._with_hidden_fingers(found)

    def _fitted(self, noise: float) -> HandState:
        """Parameters fitted to keypoints with errors of this standard deviation, metres."""
        given = self.joints[None], self.fit_trust[None]
        return fit_keypoints(*given, self.shaped, noise=noise)

    def _with_hidden_fingers(self, fitted: HandState) -> HandState:
        """The hand with rotations of each finger interpolated in the frames with a hand in which no
        keypoint after the finger's first one is trusted, but in others some is."""
        there, rotations = self.trust.amax(-1) > 0, fitted.rotations.clone()
        for number, points in enumerate(MOVED_BY_FINGERS):
            seen = (self.trust[:, points] > 0).any(-1)
            hidden = there & ~seen
            if bool(hidden.any() and seen.any()):
                own = slice(1 + 3 * number, 4 + 3 * number)
                posed = observed_around(seen).rotations(rotations[0, :, own])
                rotations[0, hidden, own] = posed[hidden]
        return replace(fitted, rotations=rotations)

    def _other_skeleton(self, fitted: HandState) -> float:
        """Root mean square difference of the tracker's own rest offsets from those of the fitted
        hand, metres."""
        own = own_skeleton(fitted, self.joints, self.trust, self.shaped)
        known = trust_of_bones(self.trust).amax(0) > 0
        apart = (own.offsets - self.shaped.offsets).square().sum(-1)[known]
        return float(apart.mean().sqrt().nan_to_num(0.0))

    @property
    def keypoint_noise(self) -> float:
        """Standard deviation of independent noise of the keypoints' coordinates, metres, by how
        much the lengths of bones vary."""
        _, of_length = measured_lengths(self.joints, self.trust)
        return float(of_length.nanmedian().nan_to_num(0.0)) / math.sqrt(2)

    @property
    def fit_trust(self) -> Float[Tensor, "T 21"]:
        """Weight of each keypoint in a fit of the track. Filled frames have weight 1, so that their
        hand follows the interpolated keypoints instead of relaxing."""
        return torch.where(self.trust.amax(-1, keepdim=True) > 0, self.trust, 1.0)

    def in_own_skeleton(self, state: HandState) -> tuple["Subject", HandState]:
        """The subject and its `parameters`, both changed to the tracker's own skeleton if the
        keypoints came without a pose; see `own_skeleton`."""
        if self.start is not None:
            return self, state
        own = self.with_own_lengths(own_skeleton(state, self.joints, self.trust, self.shaped))
        return replace(self, offsets=own.offsets[None]), own.carried(state)

    def with_own_lengths(self, skeleton: OwnSkeleton) -> OwnSkeleton:
        """A skeleton with bones as long as those of the track's keypoints."""
        return skeleton.with_lengths(*measured_lengths(self.joints, self.trust))

    def never_seen(self) -> Iterator[str]:
        """A sentence about keypoints that no frame of the input has, and no pose determines."""
        lost = torch.nonzero((self.trust == 0).all(0))[:, 0].tolist()
        if self.start is None and lost:
            yield (
                f"{numbered(len(lost), 'keypoint')} that no frame has "
                f"({', '.join(map(str, lost))}): estimated from the others, and maybe centimetres "
                "off, more than the expected error tells"
            )

    def completed(self, state: HandState) -> "Subject":
        """The subject with keypoints of zero trust replaced by those of the posed hand; filled
        frames stay as they are."""
        useless = (self.trust == 0) & (self.trust.amax(-1, keepdim=True) > 0)
        made, _ = forward_kinematics(state.rotations[0], state.wrist[0], self.offsets)
        return replace(self, joints=torch.where(useless[..., None], made, self.joints))


def subject_of(track: HandTrack, model: HandModel, carrier: Carrier | None = None) -> Subject:
    """Shape, keypoints and initial pose of a right-hand track, on its device.

    Joints take precedence where joints and pose disagree. Frames of zero trust are gaps; with a
    `carrier`, the hand moves with the object through them. Betas of `model` are used unchanged.
    Otherwise the shape is fitted to the rest skeleton (pose and joints) or to bone lengths (joints
    alone), or is the mean hand (pose alone), with a note.
    """
    notes: list[str] = []
    skeleton: Float[Tensor, "20 3"] | None = None
    trust, model = track.trust, model.to(track.valid.device)
    filled = blendable(track, carrier)
    known = track.betas if track.hand_model == model.name else None
    rotations = None if filled.pose is None else axis_angle_to_matrix(filled.pose)
    if filled.joints is None:
        assert rotations is not None, "a track without joints has a pose"
        assert filled.wrist is not None, "a pose comes with a wrist"
        if known is None:
            known = model.template.new_zeros(model.shape_dirs.shape[-1])
            lacks, cure = "joints and betas", ""
            if track.betas is not None and track.hand_model is None:
                lacks, cure = (
                    "joints and its betas without a hand model",
                    " ('hand_model' names it)",
                )
            elif track.betas is not None:
                lacks = "joints and its betas belong to another hand model"
                if track.hand_model in MANO_NAMES:
                    cure = " (--hand mano takes them)"
            notes.append(f"the pose comes without {lacks}: the mean hand is used{cure}")
        joints = posed = model.shaped(known).joints_from_rotations(rotations, filled.wrist)
    else:
        joints = posed = filled.joints
        if rotations is not None:
            skeleton = _skeleton(rotations, joints, trust, model, known)
            posed = _posed(rotations, joints, trust, skeleton)
            misfit = (trust * (posed - joints).norm(dim=-1)).sum() / trust.sum()
            if misfit > POSE_MISFIT:
                notes.append("the given pose does not reach the given joints: the joints are used")
                rotations = skeleton = None
        if filled.wrist is not None:
            apart = (trust[:, 0] * (filled.wrist - joints[:, 0]).norm(dim=-1)).sum()
            if apart > POSE_MISFIT * trust[:, 0].sum():
                notes.append("the given wrist is not that of the given joints: the joints are used")
    if known is not None:
        betas = known
    elif skeleton is not None:
        betas = betas_from_offsets(model, skeleton)
    else:
        betas = betas_from_lengths(model, measured_lengths(joints, trust)[0])
    shaped = model.shaped(betas)
    if known is not None and filled.joints is not None:
        larger = size_of(joints, trust, shaped) - 1
        if abs(larger) > OTHER_SIZE:
            size = f"{100 * abs(larger):.0f}% {'larger' if larger > 0 else 'smaller'}"
            notes.append(
                f"the given joints are those of a hand {size} than that of the given betas (in a "
                "video with cuts, than that of all shots), whose size is used: leave the betas "
                "out, or clean each shot by itself, to have that of the joints"
            )
    offsets = shaped.offsets if skeleton is None else skeleton
    start = None if rotations is None else HandState(rotations[None], posed[None, :, 0])
    return Subject(shaped, betas, offsets[None], joints, trust, start, tuple(notes))


def _skeleton(
    rotations: Float[Tensor, "T 16 3 3"],
    joints: Float[Tensor, "T 21 3"],
    trust: Float[Tensor, "T 21"],
    model: HandModel,
    betas: Float[Tensor, " S"] | None,
) -> Float[Tensor, "20 3"]:
    """Rest offsets by pose and joints; of bones without trust at one end in every frame those of
    the model, with these betas or those that fit the other bones."""
    found = rest_offsets(rotations, joints, trust)
    known = trust_of_bones(trust).amax(0) > 0
    if bool(known.all()):
        return found
    if betas is None:
        betas = betas_from_offsets(model, found, known)
    return torch.where(known[:, None], found, model.shaped(betas).offsets)


def _posed(
    rotations: Float[Tensor, "T 16 3 3"],
    joints: Float[Tensor, "T 21 3"],
    trust: Float[Tensor, "T 21"],
    skeleton: Float[Tensor, "20 3"],
) -> Float[Tensor, "T 21 3"]:
    """Keypoints of a posed skeleton, placed by the wrist or, where the wrist has zero trust, by
    the trust-weighted mean offset of the other keypoints."""
    made, _ = forward_kinematics(rotations, joints[:, 0], skeleton.expand(len(joints), 20, 3))
    share = trust / trust.sum(-1, keepdim=True).clamp(min=1e-6)
    offset = (share[..., None] * (joints - made)).sum(1)
    return made + torch.where(trust[:, :1] > 0, 0.0, offset)[:, None]
