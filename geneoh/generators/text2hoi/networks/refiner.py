"""The network that refines generated hands in one pass, by a residual, and its losses.

Source: Text2HOI, section 3.3 and supplement. Only hands change; the object stays. Ours: several
frames per token, hands in the object frame, layers that both hands share, and offsets to the
closest object points beside the paper's features, which hardly distinguish a gap of a centimetre
from contact. The losses are, as in the paper, squared distances: from the true hands, into the
object, and of gaps at near contacts.
"""

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from geneoh.bundle import spread
from geneoh.choices import SIDES
from geneoh.config import Limited
from geneoh.generators.sampling import smoothed_clips
from geneoh.generators.text2hoi.networks.losses import ERROR_UNIT, masked_mean
from geneoh.generators.text2hoi.networks.objects import map_as_read
from geneoh.generators.text2hoi.networks.post_norm import PostNormTransformer
from geneoh.generators.text2hoi.networks.tokens import (
    HAND,
    HandFrame,
    Tokens,
    actions_of,
    tokens_of,
)
from geneoh.hand.library import load_hand
from geneoh.nn.blocks import NetworkConfig, in_steps, sinusoid, zeroed
from geneoh.synthesis.actions.action import TOUCHED, Actions

AGENT_ROWS = (0, 1666)  # rows of the paper's sinusoid table that encode the left and the right hand
JOINTS = 63  # coordinates of the keypoints of a hand
LARGEST_OFFSET = 0.05  # entries of offsets to the object are clamped to it, metres
RESIDUAL_FILTER = 2.0  # standard deviation of the Gaussian over the hands' residual, frames
WRIST, TURN = 0.02, 0.1
"""Residuals of the wrist (metres) and of rotation entries for an output of 1 in our form."""
CENTIMETRE = 0.01
"""Unit of penetration depths and gaps in the losses, metres, so that they are of order one."""


@dataclass(frozen=True)
class RefinerConfig(NetworkConfig):
    """Size and form of the network; the paper's are `configs/refiner_paper.toml`."""

    form: Literal["ours", "paper"] = "ours"
    width: int = 128  # features of a token
    depth: int = 4  # transformer blocks
    heads: int = 4
    frames_per_token: int = 5  # frames of a hand in one token (paper: 1)
    points: int = 128  # points of the object that are read (paper: 1,024)
    frame: HandFrame = "object"  # coordinate frame of the hands (paper: the world)


class LayerOfEachHand(nn.Module):
    """A linear layer for the left hand and one for the right, as in the paper."""

    def __init__(self, before: int, after: int) -> None:
        super().__init__()
        self.hands = nn.ModuleList(nn.Linear(before, after) for _ in SIDES)

    def forward(self, tokens: Float[Tensor, "B S 2 N"]) -> Float[Tensor, "B S 2 M"]:
        """The features of both hands."""
        pairs = zip(self.hands, tokens.unbind(2), strict=True)
        return torch.stack([layer(hand) for layer, hand in pairs], dim=2)


class RefinerNetwork(nn.Module):
    """From generated hands to refined ones."""

    def __init__(self, config: RefinerConfig) -> None:
        """Build the network, which is the identity before training.

        Only its last layer starts at zero: two zero layers in a row would get no gradient.
        """
        super().__init__()
        self.config = config
        ours = config.form == "ours"
        layer = nn.Linear if ours else LayerOfEachHand
        width = HAND + 2 * JOINTS + JOINTS * ours + 2 * config.points
        self.input = layer(config.frames_per_token * width, config.width)
        self.trunk = PostNormTransformer(config.width, config.depth, config.heads, levels=False)
        self.output = zeroed(layer(config.width, config.frames_per_token * HAND))

    def forward(
        self, tokens: Tokens, points: Float[Tensor, "B T P 3"], contact: Float[Tensor, "B P"]
    ) -> Tokens:
        """The same clips with refined hands.

        `points` are object points in the hands' coordinate frame, metres, and `contact` is the
        probability that each of them is touched.
        """
        frames = self.config.frames_per_token
        inputs = self.inputs(tokens, points, contact).transpose(1, 2)
        read = self.input(in_steps(inputs, frames).transpose(2, 3).flatten(-2))
        seen = in_steps(tokens.valid, frames).any(-1)[..., None] & tokens.present[:, None]
        steps = torch.arange(read.shape[1], device=read.device)
        agents = sinusoid(torch.tensor(AGENT_ROWS).to(read), read.shape[-1])
        after = self.trunk(
            (read + agents).flatten(1, 2),
            None,
            steps.repeat_interleave(2).to(read),
            seen.flatten(1),
        )
        change = self.output(after.unflatten(1, (-1, 2))).unflatten(-1, (frames, HAND))
        change = change.transpose(1, 2).flatten(2, 3)[:, :, : points.shape[1]]
        if self.config.form == "ours":
            change = change * change.new_tensor([WRIST] * 3 + [TURN] * (HAND - 3))
        return tokens.with_hands(tokens.hands + change)

    @torch.no_grad()
    def inputs(
        self, tokens: Tokens, points: Float[Tensor, "B T P 3"], contact: Float[Tensor, "B P"]
    ) -> Float[Tensor, "B 2 T N"]:
        """Input features of each hand and frame."""
        joints = tokens.joints()
        offset = nearest(joints, points) - joints
        near = torch.exp(-50 * offset.square())
        distance = points.norm(dim=-1)[:, None].expand(-1, 2, -1, -1)
        touched = contact[:, None, None].expand(-1, 2, points.shape[1], -1)
        parts = [tokens.hands, joints.flatten(-2), near.flatten(-2), distance, touched]
        if self.config.form == "ours":
            parts.append(offset.clamp(-LARGEST_OFFSET, LARGEST_OFFSET).flatten(-2) / LARGEST_OFFSET)
        return torch.cat(parts, dim=-1) * tokens.shown[:, :2, :, None]


def nearest(
    joints: Float[Tensor, "B 2 T J 3"], points: Float[Tensor, "B T P 3"]
) -> Float[Tensor, "B 2 T J 3"]:
    """The object point that is closest to each keypoint."""
    places = joints.transpose(1, 2).flatten(2, 3)
    index = torch.cdist(places, points).argmin(-1)
    found = points.gather(2, index[..., None].expand(-1, -1, -1, 3))
    return found.unflatten(2, (2, -1)).transpose(1, 2)


def points_of(
    actions: Actions, tokens: Tokens, contact: Float[Tensor, "B P"], count: int
) -> tuple[Float[Tensor, "B T C 3"], Float[Tensor, "B C"], Float[Tensor, "B T C 3"]]:
    """Object points in the hands' coordinate frame, their contact probabilities, and normals.

    `count` points are taken at equal index steps; object poses in the world are those of `tokens`.
    """
    every = spread(actions.points.shape[1], count).to(contact.device)
    some = actions.take(every, "P")
    points, normals = some.posed_points(), some.posed_normals()
    if tokens.frame == "world":
        turn, shift = tokens.object_rotation, tokens.object[:, :, None, :3]
        points, normals = points @ turn.mT + shift, normals @ turn.mT
    return points, contact[:, every], normals


@torch.no_grad()
def refined_by(network: RefinerNetwork, actions: Actions, contact: Float[Tensor, "B P"]) -> Actions:
    """The same clips with refined hands.

    In our form the residual is smoothed over time, because each token is decoded separately.
    """
    tokens = tokens_of(actions, network.config.frame)
    contact = map_as_read(contact, network.config.form)
    points, touched, _ = points_of(actions, tokens, contact, network.config.points)
    hands = network(tokens, points, touched).hands
    if network.config.form == "ours":
        change = (hands - tokens.hands).transpose(1, 2)
        change = smoothed_clips(change.flatten(2), RESIDUAL_FILTER, actions.length).view_as(change)
        hands = tokens.hands + change.transpose(1, 2)
    return actions_of(tokens.with_hands(hands), actions)


@dataclass(frozen=True)
class RefinerWeights(Limited):
    """Weights of the losses; the paper's are 1, 1 and 5 (in squared metres), and 0."""

    simple: float = 1.0
    penetration: float = 1.0
    contact: float = 5.0
    keypoints: float = 1.0  # squared error of keypoints in units of a decimetre (ours)
    frames: int = 4  # frames of a clip in which contact and penetration count (paper: all)


def refiner_loss(
    found: Tokens,
    coarse: Tokens,
    clean: Tokens,
    points: Float[Tensor, "B T P 3"],
    normals: Float[Tensor, "B T P 3"],
    weights: RefinerWeights,
) -> Float[Tensor, ""]:
    """All losses, weighted and added."""
    shown = clean.shown[:, :2]
    total = weights.simple * masked_mean((found.hands - clean.hands).square(), shown[..., None])
    joints = found.joints()
    if weights.keypoints:
        apart = (joints - clean.joints()).square().sum(-1) / ERROR_UNIT**2
        total = total + weights.keypoints * masked_mean(apart, shown[..., None])
    every = spread(points.shape[1], weights.frames).unique()
    some, points, normals = found.take(every, "T"), points[:, every], normals[:, every]
    before = coarse.take(every, "T").joints()
    touch = contact_distance_loss(joints[:, :, every], before, points, shown[:, :, every])
    inside = penetration_loss(some, points, normals)
    return total + weights.contact * touch + weights.penetration * inside


def contact_distance_loss(
    joints: Float[Tensor, "B 2 T 21 3"],
    coarse: Float[Tensor, "B 2 T 21 3"],
    points: Float[Tensor, "B T P 3"],
    shown: Bool[Tensor, "B 2 T"],
) -> Float[Tensor, ""]:
    """Squared distance of keypoints to the object points closest to the coarse ones, in cm2.

    Only keypoints count that were within `TOUCHED` of the object before.
    """
    goal = nearest(coarse, points)
    touches = ((goal - coarse).norm(dim=-1) < TOUCHED) & shown[..., None]
    return masked_mean((joints - goal).square().sum(-1) / CENTIMETRE**2, touches)


def penetration_loss(
    tokens: Tokens, points: Float[Tensor, "B T P 3"], normals: Float[Tensor, "B T P 3"]
) -> Float[Tensor, ""]:
    """Squared penetration depth of hand vertices below the closest point's tangent plane, in cm2.

    A mean over the vertices that are inside. Vertices farther than `TOUCHED` from the point do not
    count: they are on another side of the object.
    """
    total, count = points.new_zeros(()), points.new_zeros(())
    for number, side in enumerate(SIDES):
        hand = load_hand(side).to(points.device).shaped(points.new_zeros(10))
        verts = hand.verts_from_rotations(
            tokens.rotations[:, number], tokens.hands[:, number, :, :3]
        )
        index = torch.cdist(verts.verts, points).argmin(-1)[..., None].expand(-1, -1, -1, 3)
        apart = verts.verts - points.gather(2, index)
        depth = -(apart * normals.gather(2, index)).sum(-1)
        inside = (depth > 0) & (apart.norm(dim=-1) < TOUCHED) & tokens.shown[:, number, :, None]
        total = total + torch.where(inside, depth, 0.0).square().sum() / CENTIMETRE**2
        count = count + inside.sum()
    return total / count.clamp(min=1)
