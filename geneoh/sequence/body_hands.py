"""The two hands of a body as tracks of their own."""

from dataclasses import replace

import torch
from jaxtyping import Float
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


def hand_tracks(skeleton: Skeleton, motion: BodyMotion) -> tuple[HandTrack, ...]:
    """The left and the right hand over T frames, world frame: keypoints, pose and wrist.

    A hand with the skeleton of the embedded hand model gets betas too, all zero.
    """
    posed, tracks = pose(skeleton, motion), []
    for side in SIDES:
        offsets, wrist = hand_offsets(skeleton, side), WRISTS[side]
        fingers = motion.rotations[:, list(FINGER_JOINTS[side])]
        turn = torch.cat([posed.rotations[:, [wrist]], fingers], dim=1)
        place = posed.positions[:, wrist]
        joints, _ = forward_kinematics(turn, place, offsets.expand(len(place), 20, 3))
        track = HandTrack(
            side,
            torch.ones(len(place), dtype=torch.bool, device=place.device),
            joints,
            matrix_to_axis_angle(turn),
            place,
        )
        embedded = hand_offsets(embedded_skeleton(), side).to(offsets)
        if bool((offsets - embedded).abs().max() < SAME_HAND):
            track = replace(track, betas=place.new_zeros(10), hand_model="embedded")
        tracks.append(track)
    return tuple(tracks)
