"""Viewing rays from the camera to a hand, along which estimators err most, for a whole clip."""

import logging
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from geneoh.errors import InputError
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.keypoints import keypoints_of
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.sequence.validation import FARTHEST_SCENE

LOG = logging.getLogger(__name__)

SHORTEST_RAY = 1e-6
"""Length in metres below which a vector has no direction."""


def with_rays(sequence: Sequence, rays: Float[Tensor, "N 3"], name: str) -> Sequence:
    """The sequence with viewing rays from the camera for all of its hands.

    `rays` are directions of any length in the world, one per frame or one for all; `name` is the
    field in messages. `InputError` for another number of rays, or one that is zero or not finite.
    """
    ray = unit_rays(rays, sequence.frames, name)
    return replace(sequence, hands=tuple(replace(h, camera_ray=ray) for h in sequence.hands))


def seen_from(sequence: Sequence, position: Float[Tensor, "N 3"], name: str) -> Sequence:
    """The sequence with the viewing rays from a camera to the wrist of each hand.

    `position` is the camera's in the world, metres, one per frame or one for all; `name` is the
    field in messages. Logs a warning for an implausible position. `InputError` as `with_rays`, and
    where camera and wrist coincide.
    """
    place = of_each_frame(position, sequence.frames, name)
    if (away := float(place.norm(dim=-1).min())) > FARTHEST_SCENE:
        LOG.warning(
            "%s is %.0f m from the origin of the world, farther than scenes reach; give it in "
            "metres (--camera), and move the origin near",
            *(name, away),
        )
    rays = [unit_rays(wrist_of(hand) - place, sequence.frames, name) for hand in sequence.hands]
    hands = (replace(h, camera_ray=ray) for h, ray in zip(sequence.hands, rays, strict=True))
    return replace(sequence, hands=tuple(hands))


def wrist_of(hand: HandTrack) -> Float[Tensor, "T 3"]:
    """Positions of the wrist in the world, gaps filled."""
    return keypoints_of(fill_gaps(hand))[:, 0]


def of_each_frame(values: Float[Tensor, "N 3"], frames: int, name: str) -> Float[Tensor, "T 3"]:
    """Vectors for every frame, from one per frame or from one for all."""
    if len(values) not in (1, frames):
        raise InputError(
            f"{name} must be one vector or one for each of the {frames} frames, got {len(values)}; "
            "cut it to the same frames"
        )
    return values.expand(frames, 3)


def unit_rays(rays: Float[Tensor, "N 3"], frames: int, name: str) -> Float[Tensor, "T 3"]:
    """Directions of length 1 for every frame."""
    rays = of_each_frame(rays, frames, name)
    for wrong, what in (
        (~rays.isfinite().all(-1), "must be finite in every frame, got NaN or infinity"),
        (rays.norm(dim=-1) < SHORTEST_RAY, "must give a direction in every frame, got length 0"),
    ):
        if bool(wrong.any()):
            first = int(torch.nonzero(wrong)[0])
            raise InputError(f"{name} {what} in frame {first}; correct it or leave it out")
    return normalize(rays, dim=-1)
