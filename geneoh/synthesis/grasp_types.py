"""Kinds of grasps: what of the hand should touch, how closed it likes to be, how it comes."""

from dataclasses import dataclass

from geneoh.synthesis.contact_pads import PAD_OF_PALM

CURLS = (0.2, 2.5)
"""How far hands like to close on what they hold, from person to person and grasp to grasp."""


@dataclass(frozen=True)
class Kind:
    """What tells one kind of grasp from the others."""

    name: str
    share: float
    """Of the attempts."""
    digits: tuple[float, float, float, float, float, float]
    """How likely each takes part: index, middle, pinky, ring, thumb, palm."""
    needed: int
    """Digits that must touch by pads of this kind."""
    fingers: tuple[float, float, float] = (0.0, 0.1, 1.0)
    """How likely the base, middle and distal pad of a finger that takes part should touch."""
    thumb: tuple[float, float, float] = (0.0, 0.1, 1.0)
    side: tuple[float, float] = (0.0, 0.0)
    """The same for the index's middle and distal phalanx on the side of the thumb."""
    finger_curls: tuple[float, float] = CURLS
    thumb_curls: tuple[float, float] = CURLS
    opposition: float = 1.0
    """How far the thumb turns under the palm: 0 beside the index, 1 across from the fingers."""
    opened: tuple[float, float] = (0.0, 0.8)
    """Share of its curl with which the hand comes to the object."""
    over: tuple[float, float, float] = (-1.0, 0.0, 0.045)
    """Place in the hand that comes over the surface: along the palm in lengths of the palm, towards
    the thumb and below the palm in metres."""
    faces: tuple[float, float, float] = PAD_OF_PALM
    """Direction of the hand that looks onto the surface."""
    approaches: int = 1
    """Starts to draw; the one of least energy is taken."""
    bears: tuple[float, float, float] | None = None
    """Outward normal of a surface that rests on the hand, in the hand's frame; None where no weight
    but the grip of opposing contacts holds the object."""

    @property
    def pads(self) -> tuple[float, ...]:
        """How likely each pad should touch if its digit takes part."""
        return (*self.fingers * 4, *self.thumb, *self.side, 1.0, 1.0)


def _precision(
    count: int, share: float, fingers: tuple[float, float, float, float], needed: int
) -> Kind:
    """Thumb and neighbouring fingers, at their tips."""
    return Kind(f"precision {count}", share, (*fingers, 1.0, 0.0), needed, approaches=16)


_WHOLE = (0.5, 0.8, 1.0)
KINDS = (
    Kind("power", 0.38, (0.9, 0.5, 0.95, 0.7, 0.95, 0.0), 3, _WHOLE, _WHOLE, approaches=6),
    _precision(2, 0.08, (1.0, 0.0, 0.0, 0.0), 2),
    _precision(3, 0.1, (1.0, 1.0, 0.0, 0.0), 3),
    _precision(4, 0.09, (1.0, 1.0, 0.0, 1.0), 3),
    _precision(5, 0.08, (1.0, 1.0, 1.0, 1.0), 4),
    Kind(
        "lateral",
        0.09,
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
    Kind(
        "hook",
        0.09,
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
    Kind(
        "support",
        0.09,
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
"""Kinds of grasps; `Grasps.kind` counts them."""
