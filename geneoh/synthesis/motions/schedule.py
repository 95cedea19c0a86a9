"""When a hand grasps, carries and releases its object, in frames from the start of a clip."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.bimanual import HandPairs


@dataclass(frozen=True)
class ScheduleConfig:
    """Times of the events of a clip."""

    close: tuple[float, float] = (-0.25, 0.55)
    """Range of the time at which the hand has closed, as a share of the clip (< 0: before it)."""
    hold: tuple[float, float] = (0.4, 1.1)  # range of the grasp's duration, as a share of the clip
    grip_frames: float = 4.0
    """Frames from the closed hand to the object's first motion, and from its last to release."""
    shortest_move: float = 12.0  # fewest frames between rest points, as in recordings
    regrasp_share: float = 0.15
    """Share of the clips with a regrasp: the hand opens and grasps again while the object rests."""
    regrasp_frames: float = 16.0  # frames from the regrasp to the release
    regrasp_rest: float = 8.0
    """Frames that the object rests before a regrasp, in addition to `grip_frames`."""
    regrasp_hold: float = 64.0
    """Shortest grasp in frames that has a regrasp: the object needs time to move before."""


@dataclass(frozen=True)
class Schedule:
    """Times of the events of B clips, in frames; events before or after the clip are not seen."""

    frames: int  # length of every clip
    close: Float[Tensor, " B"]  # the hand has closed on the object
    release: Float[Tensor, " B"]  # the hand starts to open
    lift: Float[Tensor, " B"]
    """The object starts to move; before this hand closes if a second hand already holds it."""
    put_down: Float[Tensor, " B"]  # the object is at rest from here on
    regrasp: Float[Tensor, " B"]  # the hand is open for a moment, where `regrasps`
    regrasps: Bool[Tensor, " B"]
    shortest_move: float

    @property
    def time(self) -> Float[Tensor, " T"]:
        """The frames of a clip."""
        return torch.arange(self.frames, dtype=torch.float32)

    def moves(self, rests: Float[Tensor, "B K C"], draws: Draws) -> Float[Tensor, "B T C"]:
        """Smooth moves through rest points: zero before `lift`, the last one after `put_down`."""
        batch, count = rests.shape[:2]
        cuts = draws.share(count - 1).sort(1).values
        cuts = torch.cat([torch.zeros(batch, 1), cuts, torch.ones(batch, 1)], 1)
        held = self.put_down - self.lift
        # the last move ends when the object is put down, where the hold is long enough for a move
        latest = (held - self.shortest_move).clamp(min=0)[:, None]
        starts = self.lift[:, None] + torch.minimum(cuts * held.clamp(min=0)[:, None], latest)
        progress = (self.time[None, :, None] - starts[:, None, :-1]) / (
            (starts[:, 1:] - starts[:, :-1])[:, None].clamp(min=self.shortest_move)
        )
        steps = torch.diff(rests, dim=1, prepend=torch.zeros_like(rests[:, :1]))
        return minimum_jerk(progress) @ steps


def minimum_jerk(x: Float[Tensor, "*S"]) -> Float[Tensor, "*S"]:
    """Minimum-jerk profile from 0 to 1, constant outside."""
    x = x.clamp(0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)


def draw_schedule(frames: int, pairs: HandPairs, config: ScheduleConfig, draws: Draws) -> Schedule:
    """Random times; the grasps of two hands on one object overlap in time."""
    second, first = pairs.second, pairs.leader
    close = draws.uniform(config.close) * frames
    hold = draws.uniform(config.hold) * frames
    release = close + hold
    meet = release[first] - config.shortest_move
    close = torch.where(second, torch.minimum(close, meet), close)
    meet = close[first] + config.shortest_move
    release = torch.where(second, torch.maximum(release, meet), release)
    lift, put_down, leader = close.clone(), release.clone(), first[second]
    lift[leader] = torch.minimum(close[leader], close[second])
    put_down[leader] = torch.maximum(release[leader], release[second])
    regrasps = draws.chance(config.regrasp_share) & ~pairs.shared & (hold > config.regrasp_hold)
    earlier = put_down - config.regrasp_frames - config.regrasp_rest
    put_down = torch.where(regrasps, earlier, put_down)
    return Schedule(
        frames,
        close,
        release,
        lift + config.grip_frames,
        put_down - config.grip_frames,
        release - config.regrasp_frames,
        regrasps,
        config.shortest_move,
    )
