"""What an object does when a hand does what a verb says: moves between poses of rest.

A move goes to a pose relative to the one in which the object stands on the table, with a
minimum-jerk profile. Turns are about the middle of the object. Lengths in metres, times in frames.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.synthesis.actions import VERBS
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.schedule import minimum_jerk

MOVES = 10  # most moves of an action


@dataclass(frozen=True)
class VerbConfig:
    """How far, how fast and how often objects move; ranges are of one draw per action."""

    move: tuple[float, float] = (18.0, 28.0)  # frames of a move up, down, or of a turn
    way: tuple[float, float] = (26.0, 42.0)  # frames of a way over or along the table
    stop: tuple[float, float] = (4.0, 14.0)  # frames of rest between two moves
    height: tuple[float, float] = (0.06, 0.2)  # of a lifted object over the table
    carried: tuple[float, float] = (0.2, 0.45)  # length of a way through the air
    slid: tuple[float, float] = (0.1, 0.3)  # length of a way along the table
    rotated: tuple[float, float] = (0.9, 2.4)  # turn about the vertical, radians
    tilted: tuple[float, float] = (0.4, 0.9)  # tilt of what is not poured from, radians
    poured: tuple[float, float] = (1.4, 2.1)  # tilt of what is poured from, radians
    inspected: tuple[float, float] = (0.6, 1.3)  # turn of what is looked at from two sides, radians
    shaken: tuple[float, float] = (0.03, 0.08)  # way of a shake to one side
    shake: tuple[float, float] = (4.0, 6.5)  # frames of it
    pressed: tuple[float, float] = (8.0, 24.0)  # frames for which a hand presses
    handed: float = 20.0  # frames in which both hands have what is passed


@dataclass(frozen=True)
class Moves(Bundle):
    """K moves of B objects, one after the other, each from where the one before ended.

    The first is where the object is at the start; it takes no time.
    """

    frames: Float[Tensor, "B K"]  # how long each takes
    rest: Float[Tensor, "B K"]  # frames of rest before it
    shift: Float[Tensor, "B K 3"]  # where it ends
    turn: Float[Tensor, "B K 3"]  # axis-angle of the end, radians
    joint: Float[Tensor, "B K"]  # state of the joint at the end, from 0 (closed) to 1 (open)

    @property
    def duration(self) -> Float[Tensor, " B"]:
        """Frames from the start of the first move to the end of the last one."""
        return (self.frames + self.rest).sum(1)

    def quicker(self, factor: Float[Tensor, " B"]) -> "Moves":
        """The same moves in another time."""
        return Moves(
            self.frames * factor[:, None],
            self.rest * factor[:, None],
            self.shift,
            self.turn,
            self.joint,
        )

    def path(self, start: Float[Tensor, " B"], frames: int) -> Float[Tensor, "B T 7"]:
        """Shift, turn and joint in every frame; the first rest begins at `start`."""
        ends = torch.cat([self.shift, self.turn, self.joint[..., None]], -1)
        begin = start[:, None] + (self.frames + self.rest).cumsum(1) - self.frames
        time = torch.arange(frames, dtype=torch.float32)[None, :, None]
        progress = minimum_jerk((time - begin[:, None]) / self.frames[:, None].clamp(min=1.0))
        return ends[:, :1] + progress[..., 1:] @ torch.diff(ends, dim=1)


@dataclass(frozen=True)
class _Drawn:
    """Random numbers and sizes that the verbs share."""

    config: VerbConfig
    draws: Draws
    radius: Float[Tensor, " B"]  # of the ball around the object, metres

    def range(self, name: str) -> Float[Tensor, " B"]:
        return self.draws.uniform(getattr(self.config, name))

    def up(self, clear: bool = False) -> Float[Tensor, "B 3"]:
        """A place over the table, with room to turn over where that is asked for."""
        height = self.range("height") + (self.radius if clear else 0.0)
        return height[:, None] * torch.eye(3)[2]

    def level(self) -> Float[Tensor, "B 3"]:
        """A horizontal direction."""
        angle = 2 * math.pi * self.draws.share()
        return torch.stack([angle.cos(), angle.sin(), torch.zeros_like(angle)], -1)

    def side(self) -> Float[Tensor, " B"]:
        """Plus or minus one."""
        return torch.where(self.draws.chance(0.5), 1.0, -1.0)


Move = tuple[Tensor | float, Tensor | float, Tensor | float, Tensor | float, Tensor | float]
"""Frames, rest before, shift, turn, joint."""
_HOME: Move = (0.0, 0.0, 0.0, 0.0, 0.0)  # as the object stands on the table, closed


def _lift(d: _Drawn) -> list[Move]:
    return [_HOME, (d.range("move"), 0.0, d.up() + 0.06 * torch.eye(3)[2], 0.0, 0.0)]


def _put_down(d: _Drawn) -> list[Move]:
    there = d.up() + 0.5 * d.range("carried")[:, None] * d.level()
    return [(0.0, 0.0, there, 0.0, 0.0), (d.range("way"), d.range("stop"), 0.0, 0.0, 0.0)]


def _carry(d: _Drawn) -> list[Move]:
    up, way = d.up(), d.range("carried")[:, None] * d.level()
    return [
        _HOME,
        (d.range("move"), 0.0, up, 0.0, 0.0),
        (d.range("way"), 0.0, up + way, 0.0, 0.0),
        (d.range("move"), 0.0, way, 0.0, 0.0),
    ]


def _slide(d: _Drawn) -> list[Move]:
    return [_HOME, (d.range("way"), 0.0, d.range("slid")[:, None] * d.level(), 0.0, 0.0)]


def _rotate(d: _Drawn) -> list[Move]:
    turn = (d.side() * d.range("rotated"))[:, None] * torch.eye(3)[2]
    return [_HOME, (d.range("way"), 0.0, 0.0, turn, 0.0)]


def _tip(d: _Drawn, angle: str) -> list[Move]:
    up, turn = d.up(clear=True), d.range(angle)[:, None] * d.level()
    return [
        _HOME,
        (d.range("move"), 0.0, up, 0.0, 0.0),
        (d.range("move"), 0.0, up, turn, 0.0),
        (d.range("move"), d.range("stop"), up, 0.0, 0.0),
        (d.range("move"), 0.0, 0.0, 0.0, 0.0),
    ]


def _shake(d: _Drawn) -> list[Move]:
    up, frames = d.up(), d.range("shake")
    level = torch.where(d.draws.chance(0.5, 1), d.level(), torch.eye(3)[2])
    side = d.range("shaken")[:, None] * level
    beats: list[Move] = [(frames, 0.0, up + (1 - 2 * (k % 2)) * side, 0.0, 0.0) for k in range(6)]
    lifted: list[Move] = [_HOME, (d.range("move"), 0.0, up, 0.0, 0.0)]
    return [*lifted, *beats, (frames, 0.0, up, 0.0, 0.0), (d.range("move"), 0.0, 0.0, 0.0, 0.0)]


def _inspect(d: _Drawn) -> list[Move]:
    up = d.up(clear=True) + 0.08 * torch.eye(3)[2]
    one, other = (d.range("inspected")[:, None] * d.level() for _ in range(2))
    return [
        _HOME,
        (d.range("move"), 0.0, up, 0.0, 0.0),
        (d.range("move"), 0.0, up, one, 0.0),
        (d.range("move"), 0.5 * d.range("stop"), up, other, 0.0),
        (d.range("move"), 0.5 * d.range("stop"), 0.0, 0.0, 0.0),
    ]


def _press(d: _Drawn) -> list[Move]:
    return [_HOME, (d.range("pressed"), 0.0, 0.0, 0.0, 0.0)]


def _open(d: _Drawn) -> list[Move]:
    return [_HOME, (d.range("way"), 0.0, 0.0, 0.0, 1.0)]


def _close(d: _Drawn) -> list[Move]:
    return [(0.0, 0.0, 0.0, 0.0, 1.0), (d.range("way"), 0.0, 0.0, 0.0, 0.0)]


def _pass(d: _Drawn) -> list[Move]:
    up, way = d.up() + 0.06 * torch.eye(3)[2], 0.5 * d.range("carried")[:, None] * d.level()
    return [
        _HOME,
        (d.range("move"), 0.0, up, 0.0, 0.0),
        (d.range("way"), d.config.handed, way, 0.0, 0.0),
    ]


SCRIPTS: dict[str, Callable[[_Drawn], list[Move]]] = {
    "lift": _lift,
    "put down": _put_down,
    "carry": _carry,
    "slide": _slide,
    "rotate": _rotate,
    "pour": lambda d: _tip(d, "poured"),
    "tilt": lambda d: _tip(d, "tilted"),
    "shake": _shake,
    "inspect": _inspect,
    "press": _press,
    "open": _open,
    "close": _close,
    "pass": _pass,
}
"""The moves of each verb."""


def moves_of(
    verb: Int[Tensor, " B"], radius: Float[Tensor, " B"], config: VerbConfig, draws: Draws
) -> Moves:
    """The moves of each object by its verb; those that are left over rest where the last ended."""
    drawn = _Drawn(config, draws, radius)
    every = [_packed(SCRIPTS[name](drawn), len(verb)) for name in VERBS]
    chosen = torch.stack(every)[verb, torch.arange(len(verb))]
    frames, rest, shift, turn, joint = chosen.split([1, 1, 3, 3, 1], -1)
    return Moves(frames[..., 0], rest[..., 0], shift, turn, joint[..., 0])


def _packed(moves: list[Move], batch: int) -> Float[Tensor, "B K 9"]:
    """The moves of one verb as one tensor."""

    def column(value: Tensor | float, width: int) -> Tensor:
        value = torch.as_tensor(value, dtype=torch.float32)
        value = value[:, None] if value.ndim == 1 and width == 1 else value
        return value.expand(batch, width)

    widths = (1, 1, 3, 3, 1)
    rows = [torch.cat([column(v, w) for v, w in zip(m, widths, strict=True)], -1) for m in moves]
    still = torch.cat([torch.zeros(batch, 2), rows[-1][:, 2:]], -1)
    return torch.stack(rows + [still] * (MOVES - len(rows)), 1)
