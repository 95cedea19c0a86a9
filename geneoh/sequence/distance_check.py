"""Check that a hand comes near its object in some frame, and guess the fault if it does not."""

from collections.abc import Iterator
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.errors import InputError
from geneoh.geometry.rigid import Rigid
from geneoh.sequence.gaps import without_placeholders
from geneoh.sequence.sequence import HandTrack, ObjectTrack

FARTHEST_HAND = 0.5
"""Largest distance in metres between the object's bounding ball and the wrist in the frame in which
they are nearest."""

EQUALLY_NEAR = 0.02
"""Metres within which two interpretations are equally good, and a message names both."""
UNIT_SCALES = (1000.0, 100.0, 0.01, 0.001)
"""Factors that are tried on translations, for a unit of millimetres or centimetres."""
TOO_FAR = 10.0
"""Distance in metres from which on the object's translations may be in a smaller unit."""


def check_distance(hand: HandTrack, motion: ObjectTrack, name: str) -> None:
    """Refuse a hand that never comes near its object: the unit, frame or object must be wrong."""
    nearest = least_distance(hand, motion)
    if nearest > FARTHEST_HAND:
        readings = interpretations(hand, motion, nearest)
        tried = [(gap, words) for gap, words in readings if gap < FARTHEST_HAND]
        best = min(gap for gap, _ in tried) if tried else 0.0
        remedy = "; or ".join(words for gap, words in tried if gap < best + EQUALLY_NEAR) or (
            "check that both are in metres and in the same frame, and that the object's poses are "
            "given (--object-pose)"
        )
        raise InputError(
            f"{name}: the {hand.side} hand must come near the object, got a wrist that stays "
            f"{nearest:.3g} m away from it; {remedy}"
        )


def interpretations(
    hand: HandTrack, motion: ObjectTrack, nearest: float
) -> Iterator[tuple[float, str]]:
    """Distance from wrist to object under other interpretations of the numbers, metres, 0 inside,
    and the remedy for each; `nearest` is the distance as they were read."""
    back = Rigid(motion.rotation, motion.translation).inverse()
    inverted = replace(motion, rotation=back.rotation, translation=back.translation)
    gap = max(least_distance(hand, inverted), 0.0)
    yield (
        gap,
        f"inverted, the object's poses bring it to {gap:.2g} m: they seem to be "
        "world to object; invert them to object to world",
    )
    flip = torch.tensor([1.0, -1.0, -1.0], device=hand.valid.device)
    yield (
        max(least_distance(hand.changed(joints=flip.mul, wrist=flip.mul), motion), 0.0),
        "with y and z negated it comes near: hand and object seem to be in the axes of "
        "OpenCV and OpenGL; negate y and z of the hand",
    )
    for scale in UNIT_SCALES:
        if scale < 1 and nearest < TOO_FAR:
            continue
        scaled = replace(motion, translation=scale * motion.translation)
        yield (
            max(least_distance(hand, scaled), 0.0),
            f"with the translations of the object's poses times {scale:g} it comes near: give them "
            "in the unit of the hand (--keypoint-unit is that of both; in TUM's format in metres)",
        )


def least_distance(hand: HandTrack, motion: ObjectTrack) -> float:
    """Least distance over frames from the wrist to the object's bounding balls, metres."""
    return float(distance_to_object(hand, motion)[hand.valid].min())


def distance_to_object(hand: HandTrack, motion: ObjectTrack) -> Float[Tensor, " T"]:
    """Distance in each frame from the wrist to the nearest bounding ball of a part, metres.

    Negative inside; zero without a mesh, a wrist or an observed pose.
    """
    hand = without_placeholders(hand)
    wrist = hand.wrist if hand.joints is None else hand.joints[:, 0]
    if not motion.meshes or wrist is None:
        return torch.zeros(hand.frames, device=hand.valid.device)
    gaps = [
        ball_distance(wrist, mesh.verts, motion.rotation[:, part], motion.translation[:, part])
        for part, mesh in enumerate(motion.meshes)
        if part in motion.seen_parts
    ]
    return torch.stack(gaps).amin(0) if gaps else wrist.new_zeros(hand.frames)


def ball_distance(
    points: Float[Tensor, "T 3"],
    verts: Float[Tensor, "V 3"],
    rotation: Float[Tensor, "T 3 3"],
    translation: Float[Tensor, "T 3"],
) -> Float[Tensor, " T"]:
    """Distance of each frame's point from the bounding ball of the posed mesh; negative inside."""
    center = (verts.amax(0) + verts.amin(0)) / 2
    radius = (verts - center).norm(dim=-1).max()
    center_world = (rotation @ center[:, None])[..., 0] + translation
    return (points - center_world).norm(dim=-1) - radius
