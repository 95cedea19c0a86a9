"""The table under an object, as the object's frame sees it: what hands do not reach through."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle


@dataclass(frozen=True)
class Table(Bundle):
    """The plane of the table in the frames of B objects: p is `p @ up + height` over it, metres."""

    up: Float[Tensor, "B 3"]  # unit vectors
    height: Float[Tensor, " B"]  # of the frames' origins

    def depth(
        self, centers: Float[Tensor, "B K 3"], radii: Float[Tensor, "*B K"]
    ) -> Float[Tensor, "B K"]:
        """How far spheres reach under the table, metres; negative over it."""
        return radii - torch.linalg.vecdot(centers, self.up[:, None]) - self.height[:, None]
