"""What the interaction network is told: sentence, object, contact map, hands and frames."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.generators.text2hoi.objects import Objects
from geneoh.generators.text2hoi.tokens import defined_numbers


@dataclass(frozen=True)
class Condition(Bundle):
    """What B clips are to be, of at most T frames."""

    text: Float[Tensor, "B W"]  # features of the sentence
    objects: Objects
    contact: Float[Tensor, "B P"]  # probability that a point is touched
    present: Bool[Tensor, "B 2"]  # whether the left, and whether the right hand takes part
    valid: Bool[Tensor, "B T"]  # frames before the end
    text_given: Bool[Tensor, " B"]  # where the sentence is told at all
    object_given: Bool[Tensor, " B"]  # where object and contact map are told at all

    @property
    def shown(self) -> Bool[Tensor, "B T 208"]:
        """Numbers that mean something: of hands that take part, in frames before the end."""
        return defined_numbers(self.present, self.valid, self.objects.jointed)

    def without_text(self) -> "Condition":
        """The same with the sentence untold."""
        return replace(self, text_given=torch.zeros_like(self.text_given))
