"""Where a scene is looked at from: a camera with perspective, and a direction that shows the hand.

The camera looks at a point from a direction; `right`, `up` and `back` are its axes in the world.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from geneoh.viz.raster import rasterise
from geneoh.viz.scene import Scene

FIELD_OF_VIEW = np.deg2rad(28.0)
ROUND = 12
"""Directions tried around the up axis, on each of the heights."""
HEIGHTS = (-0.5, 0.0, 0.45, 0.95)
"""Heights of the tried directions above the level, radians."""
TRIAL = 96
"""Side in pixels of the pictures that directions are judged by."""
JUDGED_FRAMES = 3
DEEP_BONUS = 25.0
"""A pixel of skin inside the object counts this much more than another pixel of the hand."""

Axes = Float[np.ndarray, "3 3"]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera in the world frame, metres."""

    axes: Axes
    """Rows: right, up and back (from the target to the eye)."""
    target: Float[np.ndarray, " 3"]
    radius: float
    """Of the ball around the target that fills the shorter side of the picture, metres."""

    @property
    def eye(self) -> Float[np.ndarray, " 3"]:
        """Where the camera stands."""
        return self.target + self.axes[2] * self.radius / np.sin(FIELD_OF_VIEW / 2)

    def project(
        self, points: Float[np.ndarray, "*B 3"], size: tuple[int, int]
    ) -> Float[np.ndarray, "*B 3"]:
        """Pixel column, pixel row and 1 / depth of points in a picture of this width and height."""
        seen = (points - self.eye) @ self.axes.T
        nearness = 1 / np.maximum(-seen[..., 2], 1e-6)
        focal = min(size) / 2 / np.tan(FIELD_OF_VIEW / 2)
        column = size[0] / 2 + focal * seen[..., 0] * nearness
        row = size[1] / 2 - focal * seen[..., 1] * nearness
        nearness = np.where(seen[..., 2] < 0, nearness, 0.0)
        return np.stack([column, row, nearness], -1)


def axes_towards(back: Float[np.ndarray, " 3"], up: Float[np.ndarray, " 3"]) -> Axes:
    """Camera axes for a direction to the eye and the direction that is up in the picture."""
    back = back / np.linalg.norm(back)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


def best_axes(scene: Scene, up: Float[np.ndarray, " 3"]) -> Axes:
    """The direction from which most of the hands is seen, and most of what sank into the object.

    The object is looked through, as in the pictures; only the hands hide one another. One direction
    for the whole clip, judged over a few frames of the first take.
    """
    deepest = torch.stack([hand.depth.nan_to_num() for hand in scene.takes[0].hands]).amax(0)
    frames = deepest.topk(min(JUDGED_FRAMES, len(deepest))).indices.tolist()
    tried = [axes_towards(back, up) for back in _directions(up)]
    return max(tried, key=lambda axes: sum(_shown(scene, frame, axes) for frame in frames))


def _directions(up: Float[np.ndarray, " 3"]) -> list[Float[np.ndarray, " 3"]]:
    """Directions to the eye around the up axis."""
    up = up / np.linalg.norm(up)
    level = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    level /= np.linalg.norm(level)
    across = np.cross(up, level)
    return [
        np.cos(height) * (np.cos(turn) * level + np.sin(turn) * across) + np.sin(height) * up
        for height in HEIGHTS
        for turn in np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
    ]


def _shown(scene: Scene, frame: int, axes: Axes) -> float:
    """How much of the hands one frame shows, in pixels."""
    hands = scene.takes[0].hands
    camera = Camera(axes, *framing(scene, frame))
    verts = np.concatenate([hand.verts[frame].numpy() for hand in hands])
    starts = np.cumsum([0] + [len(hand.verts[frame]) for hand in hands])
    faces = np.concatenate(
        [hand.model.faces.numpy() + start for hand, start in zip(hands, starts, strict=False)]
    )
    inside = np.concatenate([hand.distance[frame].numpy() < 0 for hand in hands])
    screen = camera.project(verts, (TRIAL, TRIAL))
    raster = rasterise(screen, faces, (TRIAL, TRIAL))
    seen = raster.face[raster.covered]
    return len(seen) + DEEP_BONUS * float(inside[faces[seen, 0]].sum())


def framing(scene: Scene, frame: int) -> tuple[Float[np.ndarray, " 3"], float]:
    """What to look at in a frame, and the radius around it: hands and what is near of the object.

    The radius is the same in all frames, so that sizes compare.
    """
    middles, radii = _framings(scene)
    return middles[frame], radii


def _framings(scene: Scene) -> tuple[Float[np.ndarray, "T 3"], float]:
    joints = torch.cat([hand.joints for take in scene.takes for hand in take.hands], dim=1)
    centre = joints.nanmean(1)
    reach = (joints - centre[:, None]).norm(dim=-1).nan_to_num().amax(1).median()
    parts = [mesh.verts.mean(0) for mesh in scene.object.meshes]
    rest = torch.stack(parts)[None, ..., None]
    middle = ((scene.object.rotation @ rest)[..., 0] + scene.object.translation).mean(1)
    size = max(float(mesh.extent().norm()) / 2 for mesh in scene.object.meshes)
    pull = min(1.0, size / 0.15) * 0.4
    target = centre + pull * (middle - centre)
    radius = max(float(reach), min(size, 0.25)) * 1.05 + 0.01
    return target.numpy(), radius
