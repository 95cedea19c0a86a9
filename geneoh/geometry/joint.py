"""Joints of objects of two parts: the second part turns about a hinge of the first, or slides."""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.errors import InputError
from geneoh.geometry.rigid import Rigid, joint_poses

FORM = "hinge:X,Y,Z:AX,AY,AZ[:DEGREES] or slide:AX,AY,AZ[:CENTIMETRES]"
"""The form in which users write a joint."""
UNITS = {"hinge": math.radians(1.0), "slide": 0.01}
"""Radians per degree and metres per centimetre, the units of ranges in texts."""
WIDEST = {"hinge": math.pi, "slide": 0.5}
"""Largest range, radians or metres."""


@dataclass(frozen=True, eq=False)
class Joint:
    """The joint of an object of two parts, in the frame of its meshes, metres and radians.

    At state 0 the second part is closed, as modelled. With growing state it turns about the axis by
    the right-hand rule, or slides along it.
    """

    axis: Float[Tensor, " 3"]  # a unit vector
    pivot: Float[Tensor, " 3"]  # a point of a hinge's axis; unused by a slide
    slides: bool
    most: float | None = None  # state when fully open; None where unknown

    @classmethod
    def read(cls, text: str) -> "Joint":
        """The joint that a text of the form `FORM` describes.

        Raises:
            InputError: the text has another form, the axis is zero, or the range is no positive
                number or too large.
        """
        kind, *fields = text.strip().split(":")
        points = {"hinge": 2, "slide": 1}.get(kind, 0)
        if not points or len(fields) not in (points, points + 1):
            raise InputError(f"joint '{text:.80}': expected {FORM}; write it so")
        *places, axis = (_three(text, each) for each in fields[:points])
        if not any(axis):
            raise InputError(
                f"joint '{text:.80}': expected an axis with a direction, got zeros; name the "
                f"direction in which the part {'slides' if kind == 'slide' else 'turns'}"
            )
        most = _range(text, kind, fields[points]) if len(fields) > points else None
        direction = torch.nn.functional.normalize(torch.tensor(axis, dtype=torch.float64), dim=0)
        pivot = torch.tensor(places[0] if places else (0.0, 0.0, 0.0))
        return cls(direction.float(), pivot, kind == "slide", most)

    @property
    def kind(self) -> str:
        """The kind of joint, as texts name it."""
        return "slide" if self.slides else "hinge"

    def __str__(self) -> str:
        """The joint as a text for `read`, in four decimals."""
        places = [self.axis] if self.slides else [self.pivot, self.axis]
        words = [self.kind, *(",".join(f"{round(float(v), 4) + 0.0:g}" for v in p) for p in places)]
        return ":".join(words + ([] if self.most is None else [self.in_unit(self.most)]))

    def in_unit(self, state: float) -> str:
        """A state in degrees or centimetres, without the unit."""
        return f"{state / UNITS[self.kind]:.3g}"

    def with_unit_axis(self) -> "Joint":
        """The joint with an axis of unit length; `InputError` where its axis has no direction."""
        axis = self.axis.double()
        if not 0 < float(axis.norm()) < math.inf:
            raise InputError(
                f"joint: expected an axis with a direction, got {self.axis.tolist()}; name the "
                f"direction in which the part {'slides' if self.slides else 'turns'}"
            )
        return replace(self, axis=(axis / axis.norm()).float())

    def pose(self, states: Float[Tensor, " T"]) -> Rigid:
        """The poses (T) of the second part in the frame of the first one."""
        slides = torch.tensor([self.slides])
        turn, shift = joint_poses(states[None], self.axis[None], self.pivot[None], slides)
        return Rigid(turn[0], shift[0])

    def moved(self, rotation: Float[Tensor, "3 3"], shift: Float[Tensor, " 3"]) -> "Joint":
        """The joint in another frame: p_new = rotation @ p + shift."""
        return Joint(rotation @ self.axis, rotation @ self.pivot + shift, self.slides, self.most)


def _three(text: str, numbers: str) -> tuple[float, float, float]:
    """Three finite numbers."""
    try:
        x, y, z = map(float, numbers.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(
            f"joint '{text:.80}': expected three numbers X,Y,Z, got '{numbers:.40}'; the form is "
            f"{FORM}"
        )
    return x, y, z


def _range(text: str, kind: str, number: str) -> float:
    """A range in radians or metres."""
    unit, name = UNITS[kind], "degrees" if kind == "hinge" else "centimetres"
    try:
        most = unit * float(number)
    except ValueError:
        most = math.nan
    if not 0 < most <= WIDEST[kind] + 1e-9:
        raise InputError(
            f"joint '{text:.80}': expected a range above 0 and up to {WIDEST[kind] / unit:g} "
            f"{name}, got '{number:.40}'; where the part goes the other way, turn its axis round"
        )
    return most
