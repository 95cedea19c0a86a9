"""The two hands of a body as tracks of their own."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import FINGER_JOINTS, WRISTS, Skeleton, embedded_skeleton
from geneoh.choices import SIDES, Side
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import TIP_PARENTS, forward_kinematics
from geneoh.sequence.sequence import HandTrack

SAME_HAND = 1e-5
"""Largest difference in metres of the offsets of a hand that counts as the embedded one."""


def hand_offsets(skeleton: Skeleton, side: Side) -> Float[Tensor, "*B 20 3"]:
    """Rest offsets of a hand: its 15 bones, and the embedded hand's tip offsets, scaled to it."""
    bones = skeleton.offsets[..., list(FINGER_JOINTS[side]), :]
    own = load_hand(side).shaped(bones.new_zeros(10)).offsets
    last = [parent - 1 for parent in TIP_PARENTS]
    scale = bones[..., last, :].norm(dim=-1) / own[last].norm(dim=-1)
    return torch.cat([bones, scale[..., None] * own[15:]], dim=-2)


def _hand_track(skeleton: Skeleton, motion: BodyMotion, side: Side) -> HandTrack:
    """One hand of T frames in the body's world frame: keypoints, pose and wrist.

    A hand with the skeleton of the embedded hand model gets betas too, all zero.
    """
    posed, wrist = pose(skeleton, motion), WRISTS[side]
    offsets = hand_offsets(skeleton, side)
    turn = torch.cat(
        [posed.rotations[:, [wrist]], motion.rotations[:, list(FINGER_JOINTS[side])]], dim=1
    )
    place = posed.positions[:, wrist]
    joints, _ = forward_kinematics(turn, place, offsets.expand(len(place), 20, 3))
    embedded = hand_offsets(embedded_skeleton(), side).to(offsets)
    same = bool((offsets - embedded).abs().max() < SAME_HAND)
    valid: Bool[Tensor, " T"] = torch.ones(len(place), dtype=torch.bool, device=place.device)
    return HandTrack(
        side,
        valid,
        joints,
        matrix_to_axis_angle(turn),
        place,
        betas=place.new_zeros(10) if same else None,
        hand_model="embedded" if same else None,
    )


def hand_tracks(skeleton: Skeleton, motion: BodyMotion) -> tuple[HandTrack, ...]:
    """The left and the right hand."""
    return tuple(_hand_track(skeleton, motion, side) for side in SIDES)
