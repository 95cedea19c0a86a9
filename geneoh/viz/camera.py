"""Where a scene is looked at from: a camera with perspective, and a direction that shows the hand.

The camera looks at a point from a direction; `right`, `up` and `back` are its axes in the world.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

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
CALM = 0.2
"""Seconds over which the camera's path is averaged: a hand that trembles must not shake it."""
OBJECT_PULL = 0.5
"""How far from the hands to the object's middle the camera looks, as a share."""
MOST_ASIDE = 0.05
"""How far from the hands it looks at most, metres."""
MOST_FRAMES = 0.6
"""Share of the frames in which hands are surely seen whole."""
LARGE = 0.12
"""Half the diagonal of the largest object that is seen whole, metres."""
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


def cameras(scene: Scene, up: Float[np.ndarray, " 3"]) -> list[Camera]:
    """One camera for each frame: the same direction and size in all, so that frames compare."""
    axes, targets = best_axes(scene, up), _targets(scene)
    radius = _radius(scene, targets)
    return [Camera(axes, target, radius) for target in targets]


def best_axes(scene: Scene, up: Float[np.ndarray, " 3"]) -> Axes:
    """The direction from which most of the hands is seen, and most of what sank into the object.

    The object is looked through, as in the pictures; only the hands hide one another. One direction
    for the whole clip, judged over a few frames of the first take.
    """
    deepest = torch.stack([hand.depth.nan_to_num() for hand in scene.takes[0].hands]).amax(0)
    frames = deepest.topk(min(JUDGED_FRAMES, len(deepest))).indices.tolist()
    targets = _targets(scene)
    radius = _radius(scene, targets)
    tried = [axes_towards(back, up) for back in _directions(up)]
    return max(
        tried,
        key=lambda axes: sum(
            _shown(scene, frame, Camera(axes, targets[frame], radius)) for frame in frames
        ),
    )


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


def _shown(scene: Scene, frame: int, camera: Camera) -> float:
    """How much of the hands one frame shows, in pixels."""
    hands = scene.takes[0].hands
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


def _hands(scene: Scene) -> Float[torch.Tensor, "T J 3"]:
    """Keypoints of all hands of all takes, NaN where a hand is not there."""
    return torch.cat(
        [
            torch.where(hand.valid[:, None, None], hand.joints, torch.nan)
            for take in scene.takes
            for hand in take.hands
        ],
        dim=1,
    )


def _targets(scene: Scene) -> Float[np.ndarray, "T 3"]:
    """What to look at: the hands, and what is near of the object; a calm path over the frames."""
    parts = torch.stack([mesh.verts.mean(0) for mesh in scene.object.meshes])
    placed = (scene.object.rotation @ parts[None, ..., None])[..., 0] + scene.object.translation
    middle = placed.mean(1).numpy()
    centre = _hands(scene).nanmean(1).numpy()
    frames, there = np.arange(scene.frames), np.isfinite(centre).all(1)
    if not there.any():
        centre = middle
    else:
        centre = np.stack([np.interp(frames, frames[there], axis[there]) for axis in centre.T], -1)
    aside = OBJECT_PULL * (middle - centre)
    aside *= np.minimum(1, MOST_ASIDE / np.linalg.norm(aside, axis=-1, keepdims=True).clip(1e-9))
    return gaussian_filter1d(centre + aside, CALM * scene.fps, 0, mode="nearest")


def _radius(scene: Scene, targets: Float[np.ndarray, "T 3"]) -> float:
    """Of what must be seen around the targets in most frames, metres."""
    apart = (_hands(scene) - torch.from_numpy(targets).float()[:, None]).norm(dim=-1)
    reach = float(apart.nan_to_num().amax(1).quantile(MOST_FRAMES))
    size = max(float(mesh.extent().norm()) / 2 for mesh in scene.object.meshes)
    return 1.08 * max(reach, min(size, LARGE))
