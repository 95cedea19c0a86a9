"""Motion of the object for each verb: a sequence of moves between poses of rest.

End poses are relative to the object's pose on the table; between them moves have a minimum-jerk
profile. Turns are about the middle of the object. Lengths in metres, times in frames.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.synthesis.actions.action import VERBS
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.motions.object_motion import minimum_jerk

MOST_MOVES = 10  # most moves of an action
WIDTHS = [1, 3, 3, 1, 1]  # number of values of each field of `Move`


@dataclass(frozen=True)
class VerbConfig:
    """How far and how fast objects move; each range is drawn from once or more per action."""

    move: tuple[float, float] = (18.0, 28.0)  # frames of a move up, down, or of a turn
    way: tuple[float, float] = (26.0, 42.0)  # frames of a way over or along the table
    stop: tuple[float, float] = (4.0, 14.0)  # frames of rest between two moves
    height: tuple[float, float] = (0.06, 0.2)  # of a lifted object over the table
    carried: tuple[float, float] = (0.2, 0.45)  # length of a way through the air
    slid: tuple[float, float] = (0.1, 0.3)  # length of a way along the table
    rotated: tuple[float, float] = (0.9, 2.4)  # turn about the vertical, radians
    tilted: tuple[float, float] = (0.4, 0.9)  # tilt of an object that is tilted, radians
    poured: tuple[float, float] = (1.4, 2.1)  # tilt of an object that is poured from, radians
    inspected: tuple[float, float] = (0.6, 1.3)  # each of two turns of an inspected object, radians
    shaken: tuple[float, float] = (0.03, 0.08)  # amplitude of a shake
    shake: tuple[float, float] = (4.0, 6.5)  # frames from one side to the other
    pressed: tuple[float, float] = (8.0, 24.0)  # frames for which a hand presses
    handed: float = 20.0  # frames of rest in which the object changes hands


@dataclass(frozen=True)
class Moves(Bundle):
    """K consecutive moves of B objects, each from the end pose of the previous one.

    The first one takes no time: its end is the pose at the start.
    """

    frames: Float[Tensor, "B K"]  # duration of each move
    rest: Float[Tensor, "B K"]  # frames of rest before it
    shift: Float[Tensor, "B K 3"]  # translation at the end
    turn: Float[Tensor, "B K 3"]  # rotation at the end, axis-angle, radians
    joint: Float[Tensor, "B K"]  # state of the joint at the end, from 0 (closed) to 1 (open)

    @property
    def duration(self) -> Float[Tensor, " B"]:
        """Frames from the start of the first move to the end of the last one."""
        return (self.frames + self.rest).sum(1)

    def quicker(self, factor: Float[Tensor, " B"]) -> "Moves":
        """The same moves with all times multiplied by `factor`."""
        factor = factor[:, None]
        return replace(self, frames=self.frames * factor, rest=self.rest * factor)

    def path(self, start: Float[Tensor, " B"], frames: int) -> Float[Tensor, "B T 7"]:
        """Shift, turn and joint in every frame; the first rest begins at `start`."""
        ends = torch.cat([self.shift, self.turn, self.joint[..., None]], -1)
        begin = start[:, None] + (self.frames + self.rest).cumsum(1) - self.frames
        time = torch.arange(frames, dtype=torch.float32)[None, :, None]
        progress = minimum_jerk((time - begin[:, None]) / self.frames[:, None].clamp(min=1.0))
        return ends[:, :1] + progress[..., 1:] @ torch.diff(ends, dim=1)


@dataclass(frozen=True)
class _Drawn:
    """Settings, random numbers and object sizes from which the moves of verbs are drawn."""

    config: VerbConfig
    draws: Draws
    radius: Float[Tensor, " B"]  # of the ball around the object, metres

    def range(self, name: str) -> Float[Tensor, " B"]:
        return self.draws.uniform(getattr(self.config, name))

    def up(self, clear: bool = False) -> Float[Tensor, "B 3"]:
        """A random height over the table; with `clear` the object can turn over there."""
        height = self.range("height") + (self.radius if clear else 0.0)
        return height[:, None] * torch.eye(3)[2]

    def level(self) -> Float[Tensor, "B 3"]:
        """A horizontal direction."""
        angle = 2 * math.pi * self.draws.share()
        return torch.stack([angle.cos(), angle.sin(), torch.zeros_like(angle)], -1)

    def side(self) -> Float[Tensor, " B"]:
        """Plus or minus one."""
        return torch.where(self.draws.chance(0.5), 1.0, -1.0)


class Move(NamedTuple):
    """One move of B objects, as in `Moves`; a plain number applies to all of them."""

    frames: Tensor | float = 0.0
    shift: Tensor | float = 0.0  # translation at the end, from the pose on the table
    turn: Tensor | float = 0.0
    joint: float = 0.0
    rest: Tensor | float = 0.0  # frames before it


_STANDING = Move()  # as the object stands on the table, closed


def _put_down(d: _Drawn) -> list[Move]:
    there = d.up() + 0.5 * d.range("carried")[:, None] * d.level()
    return [Move(shift=there), Move(d.range("way"), rest=d.range("stop"))]


def _carry(d: _Drawn) -> list[Move]:
    up, way = d.up(), d.range("carried")[:, None] * d.level()
    return [
        _STANDING,
        Move(d.range("move"), up),
        Move(d.range("way"), up + way),
        Move(d.range("move"), way),
    ]


def _rotate(d: _Drawn) -> list[Move]:
    turn = (d.side() * d.range("rotated"))[:, None] * torch.eye(3)[2]
    return [_STANDING, Move(d.range("way"), turn=turn)]


def _tip(d: _Drawn, angle: str) -> list[Move]:
    up, turn = d.up(clear=True), d.range(angle)[:, None] * d.level()
    return [
        _STANDING,
        Move(d.range("move"), up),
        Move(d.range("move"), up, turn),
        Move(d.range("move"), up, rest=d.range("stop")),
        Move(d.range("move")),
    ]


def _shake(d: _Drawn) -> list[Move]:
    up, frames = d.up(), d.range("shake")
    level = torch.where(d.draws.chance(0.5, 1), d.level(), torch.eye(3)[2])
    side = d.range("shaken")[:, None] * level
    beats = [Move(frames, up + (1 - 2 * (k % 2)) * side) for k in range(6)]
    lifted = [_STANDING, Move(d.range("move"), up)]
    return [*lifted, *beats, Move(frames, up), Move(d.range("move"))]


def _inspect(d: _Drawn) -> list[Move]:
    up = d.up(clear=True) + 0.08 * torch.eye(3)[2]
    one, other = (d.range("inspected")[:, None] * d.level() for _ in range(2))
    return [
        _STANDING,
        Move(d.range("move"), up),
        Move(d.range("move"), up, one),
        Move(d.range("move"), up, other, rest=0.5 * d.range("stop")),
        Move(d.range("move"), rest=0.5 * d.range("stop")),
    ]


def _pass(d: _Drawn) -> list[Move]:
    up, way = d.up() + 0.06 * torch.eye(3)[2], 0.5 * d.range("carried")[:, None] * d.level()
    return [_STANDING, Move(d.range("move"), up), Move(d.range("way"), way, rest=d.config.handed)]


SCRIPTS: dict[str, Callable[[_Drawn], list[Move]]] = {
    "lift": lambda d: [_STANDING, Move(d.range("move"), d.up() + 0.06 * torch.eye(3)[2])],
    "put down": _put_down,
    "carry": _carry,
    "slide": lambda d: [_STANDING, Move(d.range("way"), d.range("slid")[:, None] * d.level())],
    "rotate": _rotate,
    "pour": lambda d: _tip(d, "poured"),
    "tilt": lambda d: _tip(d, "tilted"),
    "shake": _shake,
    "inspect": _inspect,
    "press": lambda d: [_STANDING, Move(d.range("pressed"))],
    "open": lambda d: [_STANDING, Move(d.range("way"), joint=1.0)],
    "close": lambda d: [Move(joint=1.0), Move(d.range("way"))],
    "pass": _pass,
}
"""The moves of each verb."""


def moves_of(
    verb: Int[Tensor, " B"], radius: Float[Tensor, " B"], config: VerbConfig, draws: Draws
) -> Moves:
    """The moves of each object by its verb, padded with moves that stay at the last pose."""
    drawn = _Drawn(config, draws, radius)
    every = [_packed(SCRIPTS[name](drawn), len(verb)) for name in VERBS]
    chosen = torch.stack(every)[verb, torch.arange(len(verb))]
    frames, shift, turn, joint, rest = chosen.split(WIDTHS, -1)
    return Moves(frames[..., 0], rest[..., 0], shift, turn, joint[..., 0])


def _packed(moves: list[Move], batch: int) -> Float[Tensor, "B K 9"]:
    """The moves of one verb as one tensor."""

    def column(value: Tensor | float, width: int) -> Tensor:
        value = torch.as_tensor(value, dtype=torch.float32)
        return (value[:, None] if value.ndim == 1 else value).expand(batch, width)

    still = moves[-1]._replace(frames=0.0, rest=0.0)
    padded = moves + [still] * (MOST_MOVES - len(moves))
    rows = [torch.cat(list(map(column, move, WIDTHS)), -1) for move in padded]
    return torch.stack(rows, 1)
