"""How far off an answer's keypoints may be, from how much the samples disagree."""

from jaxtyping import Float
from torch import Tensor

SCALE = 2.5
"""Samples tell what a network does not know, not where it is wrong: answers are off by so many
times the deviation over samples. See `python -m geneoh.evaluation.calibration`."""


def joint_spread(samples: Float[Tensor, "S T 21 3"], scale: float = SCALE) -> Float[Tensor, "T 21"]:
    """Root mean square distance in metres that the answer's keypoints are expected to be off by.

    Args:
        samples: keypoints of two samples or more.
        scale: what their deviation is multiplied by.
    """
    return scale * samples.var(0).sum(-1).sqrt()
