"""Contact probability of each finger, from its signed distance to the object and uncertainty."""

from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.geometry.distance import MovingSurface
from geneoh.hand.model import HandModel
from geneoh.hand.skeleton import FINGERS, KEYPOINT_FINGERS, TIP_KEYPOINTS
from geneoh.metrics.contact import TOUCH

EXACT_WITHIN = 0.03
"""Distance up to which the distance of a finger to the object must be exact, metres: at usual
errors of its tip, a finger farther away certainly does not touch."""
NEARER = 0.0032
"""Mean distance by which touching fingers are too far from the object in results, metres."""
SPREAD_SHARE, LEAST_SPREAD = 0.18, 0.0035
"""Standard deviation of a finger's distance: a share of the expected error of its tip (the part
along the surface normal that the fit does not correct), and a constant in metres."""
USUAL_SPREAD = 0.016
"""Expected error of a fingertip in metres if a single sample gives no estimate of it."""


def finger_contact(
    distance: Float[Tensor, "T 5"],
    spread: Float[Tensor, "T 21"] | None,
    evidence: Float[Tensor, " T"],
) -> Float[Tensor, "T 5"]:
    """Probability that each finger touches the object, in the order of the keypoints.

    A finger touches where its skin is in the object or at most 5 mm off it. The constants were
    found by `python -m tools.finger_contact calibrate`.

    Args:
        distance: least signed distance of each finger's skin to the object, metres, negative
            inside.
        spread: `HandTrack.joint_spread` of the hand; None if unknown.
        evidence: reliability of the object's poses, 0 to 1; at 0 the probability is 0.5.
    """
    usual = torch.full_like(distance, USUAL_SPREAD)
    tips = usual if spread is None else spread[:, sorted(TIP_KEYPOINTS)]
    return 0.5 + evidence[:, None] * (finger_touch(distance, tips) - 0.5)


def fingers_apart(
    verts: Float[Tensor, "T V 3"], surface: MovingSurface, model: HandModel
) -> Float[Tensor, "T 5"]:
    """Least signed distance of each finger's skin to the object, metres, negative inside, exact up
    to `EXACT_WITHIN`; fingers in the order of the keypoints. Every second vertex is used."""
    fingers = [finger[::2] for finger in verts_of_fingers(model)]
    query = replace(surface, within=EXACT_WITHIN).query(verts[:, torch.cat(fingers)])
    parts = query.distance.split([len(finger) for finger in fingers], dim=-1)
    return torch.stack([part.amin(-1) for part in parts], dim=-1)


def finger_touch(
    distance: Float[Tensor, "T 5"],
    tips: Float[Tensor, "T 5"],
    share: float = SPREAD_SHARE,
    least: float = LEAST_SPREAD,
    nearer: float = NEARER,
) -> Float[Tensor, "T 5"]:
    """`finger_contact` at `evidence` 1, from the expected errors of the fingertips, metres.

    `share`, `least` and `nearer` replace the constants while these are calibrated.
    """
    width = ((share * tips) ** 2 + least**2).sqrt()
    return torch.special.ndtr((TOUCH + nearer - distance) / width)


def verts_of_fingers(model: HandModel) -> list[Int[Tensor, " _"]]:
    """Vertices of each finger beyond its base, in the order of the keypoints."""
    finger = (model.skin_weights.argmax(-1) - 1).div(3, rounding_mode="floor")  # -1 is the palm
    return [torch.nonzero(finger == FINGERS.index(name))[:, 0] for name in KEYPOINT_FINGERS]
