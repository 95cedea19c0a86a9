"""SpatialDiff in a stream: it runs every few frames, and the applied shift changes slowly.

It predicts one shift for a whole window, and a sudden change of this shift would make the hand
jump.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.pipeline.presets import PlacePlan
from geneoh.pipeline.stages.context import StageContext
from geneoh.pipeline.stages.run import StageRun
from geneoh.representation.parameters import HandParameters
from geneoh.sequence.windows import WINDOW

PLACE_EVERY = 15  # frames between two runs of SpatialDiff, over which the shift is interpolated
LEAST_PLACED = WINDOW // 2
"""Least number of frames for SpatialDiff. On the example with noise "gauss", its error with 10
frames is 15.3 mm, against 9.2 by MotionDiff alone; with 30 frames 10.8 against 10.2."""
PLACE_BLEND = 0.6  # weight of a new shift in the exponential moving average


@dataclass
class ChangingShift:
    """The applied shift of each sample, metres: from `before` to `after`, by linear interpolation
    over `PLACE_EVERY` frames."""

    before: Float[Tensor, "S 1 3"]
    after: Float[Tensor, "S 1 3"]
    since: int = -PLACE_EVERY  # frame in which the interpolation starts
    width: float = 0.0  # standard deviation of the last shift by SpatialDiff, metres

    def at(self, frames: Float[Tensor, " T"]) -> Float[Tensor, "S T 3"]:
        """The applied shift in some frames."""
        share = ((frames - self.since) / PLACE_EVERY).clamp(0, 1)[:, None]
        return self.before + share * (self.after - self.before)

    def learn(self, shift: Float[Tensor, "S 1 3"], width: float, now: int) -> None:
        """Update with a new shift by SpatialDiff from frame `now` on."""
        self.before = self.at(shift.new_tensor([float(now)]))
        self.after = self.after + PLACE_BLEND * (shift - self.after)
        self.since, self.width = now, width


@dataclass(frozen=True)
class RecentRun(StageRun):
    """The stages of one window, with SpatialDiff run only every `PLACE_EVERY` frames."""

    place: ChangingShift
    first: int  # first frame of the window
    done: int  # next frame to output

    def placed(
        self, observed: HandParameters, hand: HandParameters, context: StageContext, plan: PlacePlan
    ) -> tuple[HandParameters, Float[Tensor, " T"]]:
        """The samples moved by the slowly changing shift, which is updated if it is due."""
        enough = context.frames >= LEAST_PLACED
        if enough and self.done - self.place.since >= PLACE_EVERY:
            found, width = super().placed(observed, hand, context, plan)
            # of the oldest frame: drift within the window is not followed, which gains nothing
            self.place.learn((found.wrist - hand.wrist)[:, :1], float(width[0]), self.done)
        frames = (torch.arange(context.frames) + self.first).to(hand.wrist)
        moved = replace(hand, wrist=hand.wrist + self.place.at(frames))
        return moved, torch.full_like(frames, self.place.width)
