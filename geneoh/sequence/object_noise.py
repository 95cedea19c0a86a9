"""Noise on the poses of an object, as pose estimators make it.

In "shaky_2" (2 degrees, 4 mm) and "shaky_10" (five times that) half of the variance is white noise,
half drift. "flips" has 1 degree and 2 mm, and in short runs of frames a random rotation about one
axis, as estimators of nearly round objects give. "lost" has 1 degree and 2 mm, and short runs of
frames without a pose.
"""

import math
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import ObjectNoise
from geneoh.errors import InputError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.sequence.gaps import fill_object
from geneoh.sequence.noise import ornstein_uhlenbeck
from geneoh.sequence.sequence import Sequence

DEGREES: dict[ObjectNoise, float] = {"shaky_2": 2.0, "shaky_10": 10.0, "flips": 1.0, "lost": 1.0}
"""Root mean square angle of the noise of the rotation, in degrees."""
METRES_PER_DEGREE = 0.002
"""Root mean square length of the translation noise per degree of rotation noise, metres."""
DRIFT_FRAMES = 15.0
"""Correlation time of the drift, frames."""
FLIP_SHARE, LONGEST_FLIP = 0.3, 12
"""Share of the frames with a flip (some runs overlap), and the longest run of them."""

LOST_SHARE, LOST_SHORTEST, LOST_LONGEST = 0.15, 3, 10
"""Share of the frames that are lost in runs (some runs overlap), and the lengths of a run."""


def corrupt_object(
    sequence: Sequence, noise: ObjectNoise, *, generator: torch.Generator
) -> Sequence:
    """The sequence with noisy poses of its object; the parts get independent noise.

    Raises:
        InputError: no pose of an object is known.
    """
    motion = sequence.object
    if not motion.is_seen:
        raise InputError(
            f"{sequence.source or 'the sequence'}: expected the poses of an object to add noise "
            "to, got hands alone; leave the object's noise out (--object-noise)"
        )
    frames, parts = motion.rotation.shape[:2]
    drawn = [draw_object_noise(noise, frames, generator=generator) for _ in range(parts)]
    turn = torch.stack([axis_angle_to_matrix(turn) for turn, _ in drawn], dim=1)
    shift = torch.stack([shift for _, shift in drawn], dim=1)
    rotation = motion.rotation @ turn.to(motion.rotation)
    translation = motion.translation + shift.to(motion.translation)
    source = f"{noise} noise of the object, seed {generator.initial_seed()}, on {sequence.source}"
    noisy = fill_object(replace(motion, rotation=rotation, translation=translation), motion.valid)
    return replace(sequence, object=noisy, source=source)


def draw_object_noise(
    noise: ObjectNoise,
    frames: int,
    about: Float[Tensor, " 3"] | None = None,
    *,
    generator: torch.Generator,
) -> tuple[Float[Tensor, "T 3"], Float[Tensor, "T 3"]]:
    """Rotations in the object frame, axis-angle in radians, and shifts in the world frame, metres.

    Frames without a pose hold NaN. All flips are about the axis `about`, a random one by default.
    """

    def white_and_drift(size: float) -> Float[Tensor, "T 3"]:
        white, unit = torch.randn(2, frames, 3, generator=generator)
        return size / math.sqrt(6) * (white + ornstein_uhlenbeck(unit, DRIFT_FRAMES))

    turn = white_and_drift(math.radians(DEGREES[noise]))
    shift = white_and_drift(METRES_PER_DEGREE * DEGREES[noise])
    if noise == "flips":
        axis = torch.nn.functional.normalize(torch.randn(3, generator=generator), dim=0)
        axis = axis if about is None else about
        for _ in range(max(1, round(FLIP_SHARE * frames / (LONGEST_FLIP / 2)))):
            start = int(torch.randint(frames, (), generator=generator))
            length = int(torch.randint(1, LONGEST_FLIP + 1, (), generator=generator))
            angle = math.pi * (2 * float(torch.rand((), generator=generator)) - 1)
            turn[start : start + length] += angle * axis
    if noise == "lost" and frames > LOST_LONGEST + 2:
        for _ in range(max(1, round(LOST_SHARE * frames / ((LOST_SHORTEST + LOST_LONGEST) / 2)))):
            start = int(torch.randint(1, frames - LOST_LONGEST - 1, (), generator=generator))
            length = int(torch.randint(LOST_SHORTEST, LOST_LONGEST + 1, (), generator=generator))
            turn[start : start + length] = math.nan
            shift[start : start + length] = math.nan
    return turn, shift
