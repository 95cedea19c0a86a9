"""How a scene is shown: the quantity in the hands' colours, what is up, which frames."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from geneoh.choices import AXES, COLOURINGS, Axis, Colouring
from geneoh.errors import ConfigError

STRIP_CELL = 260
"""Side of one picture in a filmstrip, pixels."""


@dataclass(frozen=True)
class Look:
    """How a scene is shown; each format uses what applies to it."""

    colouring: Colouring = "penetration"
    """What the hands' colours show in pictures and films; a page can switch."""
    up: Axis = "z"
    """Axis of the world that points up."""
    frames: tuple[int, ...] = ()
    """Frames of a filmstrip; evenly spread ones when empty."""
    cell: int = STRIP_CELL
    """Side of one picture in a filmstrip, pixels."""

    def __post_init__(self) -> None:
        """Refuse choices that do not exist."""
        for name, value, choices in (
            ("colouring", self.colouring, COLOURINGS),
            ("up", self.up, AXES),
        ):
            if value not in choices:
                known = ", ".join(choices)
                raise ConfigError(f"{name}: expected one of {known}, got {value!r}; choose one")

    @property
    def upward(self) -> Float[np.ndarray, " 3"]:
        """The unit vector in the world that points up."""
        return np.eye(3)["xyz".index(self.up[-1])] * (-1.0 if self.up.startswith("-") else 1.0)
