"""The base class of the configurations of networks, which limits their sizes."""

from dataclasses import dataclass
from typing import ClassVar

from geneoh.config import Limited


@dataclass(frozen=True)
class NetworkConfig(Limited):
    """Size and form of a network; whole numbers are 1 to 4,096 unless a network says otherwise."""

    LARGEST: ClassVar[int] = 4096
