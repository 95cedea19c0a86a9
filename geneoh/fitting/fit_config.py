"""Settings of the fit of hand parameters."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FitConfig:
    """Numbers of steps, and the deviations and weights of the energy terms."""

    iterations: int = 4
    """Steps on keypoints alone."""
    contact_rounds: int = 4
    """Rounds of two steps with the surface; each round queries the distances anew."""
    joint_std: float = 0.003
    """Deviation of fitted keypoints from trusted targets, metres."""
    prior: float = 0.1
    """Weight of the relaxed pose, relative to one deviation of a keypoint."""
    limit: float = 20.0
    """Weight of overshooting a joint limit, 1/rad."""
    steady_finger: float = 16.0
    """Weight of a finger joint's change between frames, 1/rad."""
    steady_wrist: float = 4.0
    """Weight of the wrist's rotation between frames, 1/rad; its position has no such weight."""
    depth_std: float = 0.0015
    """Penetration that counts as much as a keypoint error of `joint_std`, metres: flesh is soft,
    and recorded hands penetrate by millimetres."""
    apart_std: float = 0.0005
    """The same for depth in the other hand, of which each hand sees its half."""
    touch: float = 0.003
    """Fingertips closer than this to the surface are attracted to it, metres."""
    touch_std: float = 0.002
    surface_verts: int = 96
    """Vertices per frame, nearest to or deepest in the object, that are considered."""


KEYPOINTS_ALONE = FitConfig(iterations=8, steady_finger=0.2, steady_wrist=0.0)
"""Settings for the mesh of an uncleaned track: close to its keypoints, jitter included."""
