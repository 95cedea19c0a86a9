"""Settings of the fit of hand parameters."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class FitConfig:
    """Numbers of steps, and the standard deviations and weights of the energy terms."""

    iterations: int = 4
    """Steps on keypoints alone."""
    by_frame: bool = False
    """Whether a step is taken in each frame in which the energy falls, instead of in all frames if
    their total falls: faster where frames hardly depend on each other."""
    contact_rounds: int = 4
    """Rounds of two steps with the surface terms; each round queries the distances again."""
    joint_std: float = 0.003
    """Standard deviation of fitted keypoints from targets of full trust, metres."""
    prior: float = 0.1
    """Weight of the pose prior: of a residual of one `pose_std` against a keypoint residual of one
    `joint_std`."""
    limit: float = 20.0
    """Weight of overshooting a joint limit, 1/rad."""
    steady_finger: float = 16.0
    """Weight of a finger joint's rotation between neighbouring frames, 1/rad."""
    steady_wrist: float = 4.0
    """Weight of the wrist's rotation between neighbouring frames, 1/rad; its translation has
    none."""
    depth_std: float = 0.0015
    """Standard deviation of the penetration depth, metres. It is not smaller because flesh is soft,
    and recorded hands penetrate by millimetres."""
    finger_std: float = 0.002
    """Standard deviation of the overlap of two fingers of the hand, metres; infinity ignores it."""
    apart_std: float = 0.0005
    """Standard deviation of half the penetration depth in the other hand, metres: each hand
    corrects one half."""
    touch: float = 0.003
    """Fingertips closer than this to the surface are attracted to it, metres."""
    touch_std: float = 0.002
    """Standard deviation of the distance of an attracted fingertip, metres."""
    surface_verts: int = 96
    """Vertices per frame that have surface terms: those of least signed distance."""


KEYPOINTS_ALONE = FitConfig(
    iterations=24, by_frame=True, steady_finger=0.2, steady_wrist=0.0, finger_std=math.inf
)
"""Settings that fit an uncleaned track closely, jitter included."""
