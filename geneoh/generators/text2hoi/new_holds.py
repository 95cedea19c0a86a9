"""A new hold for a hand that carries its object, where none of the drawn poses can hold it."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.generators.text2hoi.held_hands import HeldHands, mean_offsets
from geneoh.synthesis.contact_pads import OtherHands
from geneoh.synthesis.grasps import GraspConfig, synthesize_grasps
from geneoh.synthesis.holding import unheld
from geneoh.synthesis.solids import Solids
from geneoh.synthesis.table import Table

TRIES = 12  # grasps that are looked for at once
TOUCH = 0.003  # distance from the surface at which a pad touches, metres
FIRM = 0.5
"""Share of a push from the worst side that a hold may leave unheld (`geneoh.synthesis.holding`)."""
GRASPS = GraspConfig(grips=0)


@dataclass(frozen=True)
class Holding:
    """What hands at an object touch, and how firmly."""

    touching: Float[Tensor, " N"]  # number of pads
    loose: Float[Tensor, " N"]  # share of the worst push that is not held, 0 to 1

    @classmethod
    def of(cls, solids: Solids, hands: HeldHands) -> "Holding":
        """The holding of N hands at N objects."""
        pads = hands.pads
        gap, normal = solids.distance_and_normal(pads)
        touching = gap.abs() < TOUCH
        return cls(touching.sum(1).to(gap), unheld(pads, normal, touching))


def new_hold(
    solids: Solids,
    drawn: HeldHands,
    before: OtherHands | None,
    table: Table,
    generator: torch.Generator,
) -> HeldHands | None:
    """The firm grasp that is nearest to a drawn hand, as the training data were grasped.

    It is looked for from the drawn hand's side of the object, over the table, and keeps out of the
    hand `before`. None where no grasp passes the checks of the training data.
    """
    copies = torch.zeros(TRIES, dtype=torch.long)
    toward = torch.nn.functional.normalize(drawn.wrist, dim=-1).expand(TRIES, -1)
    offsets = mean_offsets().expand(TRIES, -1, -1)
    solids = solids.take(copies, "B")
    grasps = synthesize_grasps(
        solids,
        offsets,
        GRASPS,
        generator=generator,
        toward=toward,
        table=table.take(copies, "B"),
        other=None if before is None else before.take(copies, "B"),
    )
    found = HeldHands(grasps.pose, grasps.wrist)
    firm = grasps.kept & (Holding.of(solids, found).loose < FIRM)
    if not bool(firm.any()):
        return None
    away = (found.spheres[0] - drawn.spheres[0]).norm(dim=-1).mean(1)
    nearest = away.masked_fill(~firm, torch.inf).argmin()
    return found.take(nearest[None], "N")
