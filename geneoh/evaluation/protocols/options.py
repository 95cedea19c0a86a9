"""What a protocol leaves open: where the paper and its released code disagree, and how much to run.

Defaults are the paper's text (GeneOH Diffusion, C.1) wherever it gives one.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from geneoh.choices import CaseNoise, Dataset
from geneoh.readers.base import ReaderOptions

DEFAULT_NOISES: dict[Dataset, tuple[CaseNoise, ...]] = {
    "synthetic": ("gauss", "beta"),
    "taco": ("gauss", "beta"),
    "grab": ("paper",),
    "grab-beta": ("paper",),
    "hoi4d": ("recorded",),
    "arctic": ("paper",),
}

SEEDS = (11, 22, 77)
"""The paper's, Table 5."""


@dataclass(frozen=True)
class ProtocolOptions:
    """The open choices of the protocols."""

    windows: Literal["all", "first", "whole"] = "all"
    """Windows of `frames` every `stride` frames (paper); only the first of each recording (released
    code); or the recording in one piece, which is what a user cleans."""
    frames: int = 60
    stride: int = 30
    noise_sizes: Literal["paper", "code"] = "paper"
    """Of the noise "paper": as its text says, or as the released code has it."""
    finger_noise: Literal["components", "angles"] = "components"
    """Of the noise "paper": drawn on the first 24 of MANO's pose components (paper and code), which
    needs the user's MANO files, or on each finger joint's axis-angle, which is larger."""
    start_frames: Literal["paper", "zero"] = "paper"
    """HOI4D: the paper's first frame of each category, or frame 0 for all (released code)."""
    reach: Literal["paper", "code"] = "paper"
    """ARCTIC: how far the wrist may be from the object, 15 cm or, since the released code holds the
    squared distance against 0.15, 38.7 cm."""
    mano_dir: Path | None = None
    """Folder of the user's MANO files; GRAB and ARCTIC cannot do without."""
    objects: Path | None = None
    """Folder of the object meshes, where they do not stand where the data set has them."""

    @property
    def known(self) -> ReaderOptions:
        """What the readers of data sets are told."""
        return ReaderOptions(mano_dir=self.mano_dir, objects=self.objects)
