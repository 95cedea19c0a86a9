"""The place of a hand in a stream: SpatialDiff is asked now and then, and its shift changes slowly.

It answers with one shift for a whole window, which must not make the hand jump where the next
window has another one.
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

PLACE_EVERY = 15  # frames between two runs of SpatialDiff, over which its shift changes
LEAST_PLACED = WINDOW // 2
"""Frames below which SpatialDiff is not asked. Of 10 frames of the example with noise "gauss" it
makes 15.3 mm where MotionDiff alone leaves 9.2; of 30 frames 10.8 and 10.2."""
PLACE_BLEND = 0.6  # share of a new shift of SpatialDiff beside those before


@dataclass
class ChangingShift:
    """The shift of SpatialDiff, of each sample: it changes slowly from one answer to the next."""

    before: Float[Tensor, "S 1 3"]
    after: Float[Tensor, "S 1 3"]
    since: int = -PLACE_EVERY  # frame from which on it changes, over `PLACE_EVERY` frames
    width: float = 0.0  # deviation of the last answer, metres

    def at(self, frames: Float[Tensor, " T"]) -> Float[Tensor, "S T 3"]:
        """The shift in some frames."""
        share = ((frames - self.since) / PLACE_EVERY).clamp(0, 1)[:, None]
        return self.before + share * (self.after - self.before)

    def learn(self, shift: Float[Tensor, "S 1 3"], width: float, now: int) -> None:
        """Take a new answer, which counts from a frame on."""
        self.before = self.at(shift.new_tensor([float(now)]))
        self.after = self.after + PLACE_BLEND * (shift - self.after)
        self.since, self.width = now, width


@dataclass(frozen=True)
class RecentRun(StageRun):
    """The stages of one window, which ask SpatialDiff now and then only."""

    place: ChangingShift
    first: int  # frame that the window begins with
    done: int  # frame that is to be made next

    def placed(
        self, observed: HandParameters, hand: HandParameters, context: StageContext, plan: PlacePlan
    ) -> tuple[HandParameters, Float[Tensor, " T"]]:
        """The samples moved by the shift of SpatialDiff, which is asked where it has not been."""
        enough = context.frames >= LEAST_PLACED
        if enough and self.done - self.place.since >= PLACE_EVERY:
            found, width = super().placed(observed, hand, context, plan)
            # the shift is the same in all frames of one window
            self.place.learn((found.wrist - hand.wrist)[:, :1], float(width[0]), self.done)
        frames = (torch.arange(context.frames) + self.first).to(hand.wrist)
        moved = replace(hand, wrist=hand.wrist + self.place.at(frames))
        return moved, torch.full_like(frames, self.place.width)
