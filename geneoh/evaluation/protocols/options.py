"""Settings of the protocols: where the paper and its released code disagree, and how much to run.

Defaults are the paper's text (GeneOH Diffusion, C.1) wherever it gives one.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from geneoh.choices import CaseNoise, Dataset, ObjectNoise
from geneoh.readers.base import ReaderOptions

SEEDS = (11, 22, 77)
"""Seeds of the paper's Table 5."""


@dataclass(frozen=True)
class DatasetDefaults:
    """What is scored on a data set unless the user chooses something else."""

    noises: tuple[CaseNoise, ...]
    seeds: tuple[int, ...] = SEEDS
    close_frames: int = 20
    """Frames of a clip in which the expensive metrics are measured."""


DEFAULTS: dict[Dataset, DatasetDefaults] = {
    # Many short clips: one seed and a few frames of each say as much as more of fewer clips.
    "synthetic": DatasetDefaults(("gauss", "beta"), SEEDS[:1], 5),
    "taco": DatasetDefaults(("gauss", "beta")),
    "grab": DatasetDefaults(("paper",)),
    "grab-beta": DatasetDefaults(("paper",)),
    "hoi4d": DatasetDefaults(("recorded",)),
    "arctic": DatasetDefaults(("paper",)),
}


@dataclass(frozen=True)
class ProtocolOptions:
    """How the clips of a data set are cut and how the paper's noise is drawn."""

    windows: Literal["all", "first", "whole"] = "all"
    """Windows of `frames` every `stride` frames (paper); only the first window of each recording
    (released code); or the whole recording, which is what a user cleans."""
    frames: int = 60
    """Length of a window, and the shortest stretch that counts, in frames of the protocol."""
    stride: int = 30
    """Frames between the starts of two windows."""
    noise_sizes: Literal["paper", "code"] = "paper"
    """Size of the noise "paper": as in the paper's text, or as in the released code."""
    finger_noise: Literal["components", "angles"] = "components"
    """The noise "paper" is drawn on the first 24 of MANO's pose components (paper and code), which
    needs the user's MANO files, or on each finger joint's axis-angle, which is larger."""
    start_frames: Literal["paper", "zero"] = "paper"
    """HOI4D: the paper's first frame of each category, or frame 0 for all (released code)."""
    reach: Literal["paper", "code"] = "paper"
    """ARCTIC: largest distance from the wrist to the object: 15 cm (paper) or 38.7 cm, because the
    released code compares the squared distance with 0.15."""
    object_noise: ObjectNoise | None = None
    """Noise on the object's poses that the methods see; scores are measured on the true ones. None:
    the methods see the true poses."""
    mano_dir: Path | None = None
    """Folder of the user's MANO files; GRAB and ARCTIC need it."""
    objects: Path | None = None
    """Folder of the object meshes, if they are not where the data set puts them."""

    @property
    def reader_options(self) -> ReaderOptions:
        """What the readers of data sets need to know."""
        return ReaderOptions(mano_dir=self.mano_dir, objects=self.objects)
