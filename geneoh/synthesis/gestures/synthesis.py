"""Synthesis of clips: bodies whose arms reach for the hands of a gesture or an action."""

from dataclasses import dataclass, field, replace

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.body.arms import reach
from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import JOINT_NAMES, Skeleton, embedded_skeleton
from geneoh.choices import SIDES
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.synthesis.actions.action import VERBS, Actions
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.gestures.both_hands import Role, Roles, TwoHands, draw_roles, gesture_motions
from geneoh.synthesis.gestures.clips import NAMES, REST, Gestures
from geneoh.synthesis.gestures.manipulation import IN_REACH, MOST_BEND, doings, manipulating
from geneoh.synthesis.gestures.repertoire import REST_SAYS, GestureShares
from geneoh.synthesis.gestures.sentences import Doing, hand_sentence, joined_sentences
from geneoh.synthesis.gestures.stance import (
    StanceConfig,
    body_skeletons,
    draw_gait,
    standing_bodies,
)
from geneoh.synthesis.gestures.variation import HandSettings

ARM_LENGTH = sum(
    float(embedded_skeleton().offsets[JOINT_NAMES.index(f"left_{name}")].norm())
    for name in ("elbow", "wrist")
)
"""Arm length (shoulder to wrist) of the embedded skeleton, metres; hand places refer to it."""
SHOULDERS = tuple(
    float(
        sum(
            embedded_skeleton().offsets[JOINT_NAMES.index(f"{side}_{name}"), 0]
            for name in ("collar", "shoulder")
        )
    )
    for side in SIDES
)
"""x of the left and the right shoulder of the embedded skeleton, from the middle, metres."""


@dataclass(frozen=True)
class BodyConfig:
    """Settings of what bodies and hands do and how they move."""

    shares: GestureShares = field(default_factory=GestureShares)
    hands: HandSettings = field(default_factory=HandSettings)
    stance: StanceConfig = field(default_factory=StanceConfig)


def gesturing(
    variants: list[tuple[str, int]],
    bodies: list[int],
    frames: int,
    config: BodyConfig,
    *,
    generator: torch.Generator,
) -> Gestures:
    """A clip of random gestures for each of the bodies."""
    one = Draws(1, generator)
    roles = [draw_roles(variants, config.shares, one) for _ in bodies]
    skeleton, motion = bodies_with_hands(roles, bodies, frames, config, generator)
    acts = [role.doings for role in roles]
    names = [[NAMES.index(r.left.name), NAMES.index(r.right.name)] for r in roles]
    made = [[r.left.variant, r.right.variant] for r in roles]
    labels = torch.tensor(names), torch.tensor(made), torch.tensor(bodies)
    length = torch.full((len(bodies),), frames)
    return with_sentences(motion, skeleton, labels, length, acts, generator)


def handling(
    actions: Actions,
    names: list[str],
    bodies: list[int],
    frames: int,
    config: BodyConfig,
    *,
    generator: torch.Generator,
) -> Gestures:
    """Bodies that perform actions; clips with wrists out of reach or bent too far are left out."""
    idle = [Roles(Role(REST), Role(REST))] * len(bodies)
    standing = replace(config, shares=replace(config.shares, walking=0.0))
    last = actions.length[:, None].clamp(max=frames) - 1
    actions = replace(actions.at_frames(torch.arange(frames).minimum(last)), length=last[:, 0] + 1)
    skeleton, body = bodies_with_hands(idle, bodies, frames, standing, generator)
    motion, missed, bent = manipulating(skeleton, body, actions, generator=generator)
    verb = torch.where(actions.hands, actions.verb[:, None] + NAMES.index(VERBS[0]), 0)
    labels = verb, torch.full_like(verb, -1), torch.tensor(bodies)
    acts = doings(actions, names, Doing(REST_SAYS, rests=True))
    made = with_sentences(motion, skeleton, labels, actions.length, acts, generator)
    return made.take((missed < IN_REACH) & (bent < MOST_BEND), "B")


def bodies_with_hands(
    roles: list[Roles],
    bodies: list[int],
    frames: int,
    config: BodyConfig,
    generator: torch.Generator,
) -> tuple[Skeleton, BodyMotion]:
    """Skeletons and motions of bodies whose hands play the passed roles."""
    one, draws = Draws(1, generator), Draws(len(bodies), generator)
    shares = (config.shares if each.pair is None else each.pair for each in roles)
    seated = torch.tensor([bool(one.chance(share.seated)) for share in shares])
    gait = draw_gait(seated, draws.chance(config.shares.walking), frames, config.stance, draws)
    swing = config.stance.arm_swing * torch.stack([-gait.swing, gait.swing], -1)
    each = [
        gesture_motions(role, bool(sits), moved, config.hands, one)
        for role, sits, moved in zip(roles, seated, swing, strict=True)
    ]
    hands = TwoHands(*(torch.stack([getattr(a, n) for a in each]) for n in vars(each[0])))
    skeleton = body_skeletons(bodies, config.stance)
    fingers = axis_angle_to_matrix(hands.fingers.flatten(2, 3))
    body = standing_bodies(
        skeleton, gait, hands.active, hands.stroke, fingers, config.stance, draws
    )
    return skeleton, reach(skeleton, body, *in_world(skeleton, body, hands), hands.swivel)


def in_world(
    skeleton: Skeleton, body: BodyMotion, hands: TwoHands
) -> tuple[Float[Tensor, "B T 2 3"], Float[Tensor, "B T 2 3 3"]]:
    """World positions and rotations of the wrists, from those relative to the shoulders."""
    posed, chest = pose(skeleton, body), JOINT_NAMES.index("spine3")
    offsets = {name: skeleton.offsets[:, number] for number, name in enumerate(JOINT_NAMES)}
    from_chest = []
    for index, side in enumerate(SIDES):
        shoulder = offsets[f"{side}_collar"] + offsets[f"{side}_shoulder"]
        arm = offsets[f"{side}_elbow"].norm(dim=-1) + offsets[f"{side}_wrist"].norm(dim=-1)
        scaled = (arm / ARM_LENGTH)[:, None, None] * hands.place[:, :, index]
        # inward offsets scale with the shoulders' width, so that hands meet in any body's middle
        sideways, out = shoulder[:, None, 0], hands.place[:, :, index, 0]
        inward = sideways * (1 + out / SHOULDERS[index])
        scaled[..., 0] = torch.where(out / SHOULDERS[index] < 0, inward - sideways, scaled[..., 0])
        from_chest.append(shoulder[:, None] + scaled)
    turn = posed.rotations[:, :, chest, None]
    places = (turn @ torch.stack(from_chest, 2)[..., None])[..., 0]
    return posed.positions[:, :, chest, None] + places, turn @ hands.turn


def with_sentences(
    motion: BodyMotion,
    skeleton: Skeleton,
    labels: tuple[Int[Tensor, "B 2"], Int[Tensor, "B 2"], Int[Tensor, " B"]],
    length: Int[Tensor, " B"],
    acts: list[tuple[Doing, Doing]],
    generator: torch.Generator,
) -> Gestures:
    """Clips with labels (gestures, variants, bodies) and sentences that describe the hands."""
    frames = torch.arange(motion.root.shape[1]).minimum(length[:, None] - 1)
    rows = torch.arange(len(length))[:, None]
    one = {
        side: np.array([hand_sentence(side, each[n], generator=generator) for each in acts])
        for n, side in enumerate(SIDES)
    }
    return Gestures(
        *labels,
        length,
        motion.root[rows, frames],
        matrix_to_axis_angle(motion.rotations[rows, frames]),
        skeleton.offsets,
        **one,
        joined=np.array([joined_sentences(*each, generator=generator) for each in acts]),
    )
