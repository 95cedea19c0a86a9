"""Types of grasps, and the prior of finger poses: curls from a flat hand to a fist.

A type says which pads touch, how much digits curl, and how the hand approaches. Axis-angle in the
right hand's rest frame (fingers -x, palm -y, thumb +z), radians; joints in MANO order without the
wrist.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.synthesis.grasping.contact_pads import PAD_OF_PALM

# A finger flexes about the line across it, near +z; the thumb opposes by turning about +x at its
# base and flexes about (0.31, -0.86, 0.39).
FLEXION = (0.65, 0.7, 0.55)
"""Flexion of knuckle, middle and distal joint of a half closed finger (curl 1), radians."""
ACROSS = ((0.2, 0.0, 1.0), (-0.05, 0.0, 1.0), (-0.5, 0.0, 0.9), (-0.2, 0.0, 1.0))
"""Flexion axes of index, middle, pinky and ring at the knuckle: closing fingers converge."""
_BASE_STD, _MIDDLE_STD, _DISTAL_STD = (0.3, 0.2, 0.5), (0.18, 0.05, 0.5), (0.06, 0.05, 0.4)
_THUMB = (
    ((1.05, 0.1, 0.2), (0.4, 0.3, 0.25)),
    ((0.06, -0.17, 0.08), (0.35, 0.2, 0.25)),
    ((0.15, -0.42, 0.19), (0.15, 0.3, 0.35)),
)


def curled(curl: Float[Tensor, "B 5"]) -> Float[Tensor, "B 15 3"]:
    """Finger poses of the given curl: 0 is flat, 1 half closed, 2 a fist.

    Fingers in MANO order; the thumb stays opposed and bends at its two outer joints.
    """
    axes, flexion = curl.new_tensor(ACROSS), curl.new_tensor(FLEXION)
    base = curl[:, :4, None] * flexion[0] * axes + curl.new_tensor([0.0, 0.05, 0.0])
    outer = curl[:, :4, None, None] * flexion[1:, None] * curl.new_tensor([0.0, 0.0, 1.0])
    fingers = torch.cat([base[:, :, None], outer], dim=2)
    thumb = curl.new_tensor([mean for mean, _ in _THUMB])
    share = torch.stack([torch.ones_like(curl[:, 4]), curl[:, 4], curl[:, 4]], dim=-1)
    return torch.cat([fingers, (share[..., None] * thumb)[:, None]], dim=1).flatten(1, 2)


FINGER_MEAN = curled(torch.ones(1, 5))[0]
FINGER_STD = torch.tensor(
    [_BASE_STD, _MIDDLE_STD, _DISTAL_STD] * 4 + [list(std) for _, std in _THUMB]
)
FINGER_LOW = FINGER_MEAN.minimum(curled(torch.full((1, 5), 1.5))[0])
FINGER_HIGH = FINGER_MEAN.maximum(curled(torch.full((1, 5), 1.5))[0])
"""Ends of the range of the prior: half closed and three quarters closed."""


def beyond_range(fingers: Float[Tensor, "*B 15 3"]) -> Float[Tensor, "*B 15 3"]:
    """How far joint components are outside of the prior's range, in units of `FINGER_STD`."""
    return torch.maximum(FINGER_LOW - fingers, fingers - FINGER_HIGH).clamp(min=0) / FINGER_STD


CURLS = (0.2, 2.5)  # range of the curl (see `curled`) over people and grasps


@dataclass(frozen=True)
class GraspType:
    """One type of grasp; each range is drawn from once per grasp."""

    name: str
    share: float  # share of the attempts
    digits: tuple[float, float, float, float, float, float]
    """Probability that each digit takes part: index, middle, pinky, ring, thumb, palm."""
    needed: int  # digits that must touch with pads of this type
    fingers: tuple[float, float, float] = (0.0, 0.1, 1.0)
    """Probability that the base, middle and distal pad of a finger that takes part should touch."""
    thumb: tuple[float, float, float] = (0.0, 0.1, 1.0)  # the same for the thumb
    side: tuple[float, float] = (0.0, 0.0)
    """The same for the index's middle and distal phalanx on the side of the thumb."""
    finger_curls: tuple[float, float] = CURLS  # range of the curl of the fingers
    thumb_curls: tuple[float, float] = CURLS  # range of the curl of the thumb
    opposition: float = 1.0
    """How far the thumb turns under the palm: 0 beside the index, 1 across from the fingers."""
    opened: tuple[float, float] = (0.0, 0.8)
    """Range of the curl at the start, as a share of the final curl that is drawn."""
    over: tuple[float, float, float] = (-1.0, 0.0, 0.045)
    """Point in the hand's frame that starts at the surface point: along the palm in palm lengths,
    then towards the thumb and below the palm in metres."""
    faces: tuple[float, float, float] = PAD_OF_PALM  # direction of the hand that faces the surface
    approaches: int = 1  # random starts, of which the one with the least energy is taken
    bears: tuple[float, float, float] | None = None
    """For types that carry the object's weight: outward normal of the surface that rests on the
    hand, in the hand's frame. None for grips, which hold by opposing contacts."""

    @property
    def pads(self) -> tuple[float, ...]:
        """Probability that each pad should touch if its digit takes part."""
        return (*self.fingers * 4, *self.thumb, *self.side, 1.0, 1.0)


def _precision(
    count: int, share: float, fingers: tuple[float, float, float, float], needed: int
) -> GraspType:
    """A precision grip of `count` digits: thumb and neighbouring fingers, at their tips."""
    return GraspType(f"precision {count}", share, (*fingers, 1.0, 0.0), needed, approaches=16)


_WHOLE = (0.8, 0.95, 1.0)
GRASP_TYPES = (
    GraspType("power", 0.44, (0.95, 0.95, 0.85, 0.95, 0.95, 0.8), 4, _WHOLE, _WHOLE, approaches=6),
    _precision(2, 0.08, (1.0, 0.0, 0.0, 0.0), 2),
    _precision(3, 0.1, (1.0, 1.0, 0.0, 0.0), 3),
    _precision(4, 0.08, (1.0, 1.0, 0.0, 1.0), 3),
    _precision(5, 0.06, (1.0, 1.0, 1.0, 1.0), 4),
    GraspType(
        "lateral",
        0.08,
        (1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
        2,
        fingers=(0.0, 0.0, 0.0),
        thumb=(0.0, 0.0, 1.0),
        side=(1.0, 0.5),
        finger_curls=(1.3, 2.0),
        thumb_curls=(0.2, 1.0),
        opposition=0.35,
        opened=(0.9, 1.0),
        over=(-1.05, 0.03, 0.04),
        faces=(0.0, 0.0, 1.0),
        approaches=12,
    ),
    GraspType(
        "hook",
        0.08,
        (1.0, 1.0, 1.0, 1.0, 0.0, 0.0),
        3,
        fingers=(0.2, 1.0, 0.6),
        finger_curls=(1.4, 2.2),
        thumb_curls=(0.0, 0.4),
        opposition=0.4,
        opened=(0.5, 0.9),
        over=(-1.15, 0.0, 0.03),
        approaches=32,
        bears=(-1.0, 0.0, 0.0),
    ),
    GraspType(
        "support",
        0.08,
        (0.9, 0.9, 0.8, 0.9, 0.0, 1.0),
        3,
        fingers=(0.7, 0.7, 0.7),
        finger_curls=(0.0, 0.4),
        thumb_curls=(0.0, 0.4),
        opposition=0.4,
        opened=(0.8, 1.0),
        over=(-0.9, 0.0, 0.02),
        approaches=12,
        bears=(0.0, 1.0, 0.0),
    ),
)
"""All types; `Grasps.types` are indices into them."""


def of_type(name: str, types: Int[Tensor, " B"]) -> Float[Tensor, "B ..."]:
    """The field `name` of the `GraspType` of each hand."""
    return torch.tensor([getattr(each, name) for each in GRASP_TYPES], dtype=torch.float32)[types]
