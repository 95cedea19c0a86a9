"""Result of the examination of an object's track: its noise and faults, and sentences for users."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import Bundle, ByValue
from geneoh.errors import numbered
from geneoh.sequence.sequence import ObjectTrack

EXACT_ROTATION, EXACT_TRANSLATION = 0.008, 0.0006
"""White noise per axis up to which a track at 30 frames a second counts as exact, radians and
metres: motion capture has 0.003 and 0.00016. At lower frame rates motion itself looks like noise,
in proportion to the square of the time between frames, and the bounds are scaled by that."""


@dataclass(frozen=True, eq=False, repr=False)
class ObjectExamination(ByValue, Bundle):
    """Noise and faults in the track of an object with Q parts."""

    rotation_noise: Float[Tensor, "T Q"]
    """Standard deviation of white noise per axis, radians; 0 if a part's track is exact."""
    translation_noise: Float[Tensor, "T Q"]
    """Standard deviation of white noise per axis, metres; 0 if a part's track is exact."""
    confidence: Float[Tensor, "T Q"]
    """Agreement of each pose with the other poses of its part, from 0 (left out) to 1."""
    left_out: Bool[Tensor, "T Q"]
    """Poses whose rotation or translation no possible motion reaches."""
    symmetric: Bool[Tensor, "T Q"]
    """Poses that were changed by a symmetry rotation of the mesh."""
    doubted: Bool[Tensor, "T Q"]
    """Poses that may be wrong because of a jump of the rotation; see `Chain.doubted`."""
    is_noisy: Bool[Tensor, " Q"]
    """Whether a part's track was cleaned."""
    aligned: ObjectTrack
    """The input poses with symmetry flips undone."""

    @classmethod
    def of_exact(cls, motion: ObjectTrack) -> "ObjectExamination":
        """The examination of a track whose observed poses are all exact."""
        seen, none = motion.observed.to(motion.rotation), ~motion.observed & False
        return cls(0 * seen, 0 * seen, seen, none, none, none, none.any(0), motion)

    @property
    def white_noise(self) -> Float[Tensor, " 2"]:
        """Largest white noise over frames and parts, of rotation (rad) and translation (m)."""
        return torch.stack([self.rotation_noise.max(), self.translation_noise.max()])

    def sentences(self, refined: bool = False) -> Iterator[str]:
        """Sentences for the user about the object's poses; `refined` is whether the result has
        poses that agree with the clean hands."""
        cure = "with --refine-object the result has poses that agree with the clean hands, "
        cure = "" if refined else cure
        for part in torch.nonzero(self.is_noisy)[:, 0].tolist():
            name = self.aligned.name_of(part)
            each = self.rotation_noise[:, part], self.translation_noise[:, part]
            turns, shifts = (float(noise.max()) for noise in each)
            if turns > EXACT_ROTATION or shifts > EXACT_TRANSLATION:
                most = " up to" if any(bool((noise != noise[0]).any()) for noise in each) else ""
                yield (
                    f"the pose of {name} shakes by{most} {np.degrees(turns):.1f} degrees and "
                    f"{1000 * shifts:.1f} mm per axis: the hand was cleaned against a smooth track "
                    f"of it; {cure}with --trust-object the given ones are taken as exact"
                )
            if count := int(self.left_out[:, part].sum()):
                yield f"{numbered(count, 'frame')} in which the pose of {name} jumps, left out"
            if count := int(self.symmetric[:, part].sum()):
                frames = numbered(count, "frame")
                yield f"{frames} in which {name} is turned by its own symmetry, turned back"
            if count := int(self.doubted[:, part].sum()):
                frames = numbered(count, "frame")
                fault = f"{name} turns faster than it can move, and stays turned"
                yield f"{fault}: not relied on in {frames}"
