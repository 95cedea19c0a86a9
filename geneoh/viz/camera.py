"""The camera of pictures, films and pages: a pinhole, and a direction that shows the hands.

The camera looks at a target from a direction; `right`, `up` and `back` (from the target to the eye)
are its axes in the world.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d
from torch import Tensor

from geneoh.body.motion import pose
from geneoh.body.skeleton import JOINT_NAMES
from geneoh.readers.bodies.base import BodyRecording
from geneoh.sequence.sequence import ObjectTrack
from geneoh.viz.raster import rasterise
from geneoh.viz.scene import DrawnSurface, Scene, seen_object

FIELD_OF_VIEW = np.deg2rad(28.0)  # angle over the shorter side of a picture, radians
TURNS = 12  # directions that are tried around the up axis at each elevation
ELEVATIONS = (-0.5, 0.0, 0.45, 0.95)  # of tried directions above the horizontal, radians
WEIGHT_BELOW = 0.85  # weight of directions from below, where a table may be in the way
TRIAL_SIZE = 96  # side in pixels of the trial pictures that score a direction
JUDGED_FRAMES = 3  # frames that score a direction: those with the deepest penetration
SMOOTHING = 0.2  # standard deviation in seconds of the Gaussian filter on the camera's path
OBJECT_PULL = 0.5  # where the camera looks, as a share of the way from hands to object
MAX_OFFSET = 0.05  # largest distance of that target from the hands, metres
WHOLE_FRAMES = 0.98  # share of frames in which the border of the picture cuts nothing off
MARGIN = 1.04  # how much larger the picture is than what must be inside it
OUTLINE = 256  # vertices sampled from each object part to find its extent
NEARLY = 1.4  # largest factor on the radius to show the whole object, or the feet of a body
MAX_OBJECT = 0.12  # largest half diagonal of an object that the radius allows for, metres
BODY_SEEN = ("head", "left_wrist", "right_wrist", "left_shoulder", "right_shoulder", "spine2")
"""Joints of a body in the picture; the feet too, if the radius grows by less than `NEARLY`."""
BODY_TURN, BODY_ABOVE = 0.45, 0.15  # camera: radians from the front, and above the horizontal
BODY_SMOOTHING = 1.0  # seconds of the filter on the path of a camera that follows a body
HAND_ROOM = 0.22  # room around wrists and head for hands and skull, metres
DEEP_BONUS = 25.0  # extra weight of a pixel of skin inside the object

Axes = Float[np.ndarray, "3 3"]
Seen = tuple[Float[Tensor, "T N 3"], Bool[Tensor, " T"]]  # vertices; mask of the frames with them


@dataclass(frozen=True)
class Camera:
    """A pinhole camera in the world frame, metres."""

    axes: Axes  # rows: right, up and back (from the target to the eye)
    target: Float[np.ndarray, " 3"]
    radius: float  # of the ball around the target that fills the shorter side, metres

    @property
    def eye(self) -> Float[np.ndarray, " 3"]:
        """Position of the camera."""
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
    """One camera per frame, with the same direction and radius, so that frames are comparable."""
    if scene.body is not None:
        return _body_cameras(scene, scene.body, up)
    targets = _targets(scene)
    axes = _best_axes(scene, up, targets, _radius(scene, targets, np.eye(3)))
    radius = _radius(scene, targets, axes)
    if seen_object(scene.object).meshes:
        middles = _middles_of_all(scene, targets, axes)
        whole = MARGIN * _whole(_all(scene), middles, axes)
        if whole < NEARLY * radius:
            targets, radius = middles, whole
    return [Camera(axes, target, radius) for target in targets]


def _body_cameras(scene: Scene, body: BodyRecording, up: Float[np.ndarray, " 3"]) -> list[Camera]:
    """Cameras in front of a body, a little aside, that see it from the hands to the head."""
    posed = pose(body.skeleton, body.file_motion)
    front = posed.rotations[:, JOINT_NAMES.index("spine3"), :, 2].mean(0).numpy()
    front = front - (front @ up) * up
    if np.linalg.norm(front) < 0.1:  # the body turns all around, or lies
        front = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    front /= np.linalg.norm(front)
    aside = np.cross(up, front)
    back = np.cos(BODY_TURN) * front + np.sin(BODY_TURN) * aside + BODY_ABOVE * up
    axes = axes_towards(back, up)
    whole, above = (
        _path_around(posed.positions[:, list(map(JOINT_NAMES.index, names))].numpy(), axes, scene)
        for names in ((*BODY_SEEN, "left_foot", "right_foot"), BODY_SEEN)
    )
    targets, radius = whole if whole[1] < NEARLY * above[1] else above
    return [Camera(axes, np.asarray(target), radius) for target in targets]


def _path_around(
    seen: Float[np.ndarray, "T N 3"], axes: Axes, scene: Scene
) -> tuple[Float[np.ndarray, "T 3"], float]:
    """Targets and radius of a camera that sees some joints of a body, with room around them."""
    middle = (seen.max(1) + seen.min(1)) / 2
    targets = gaussian_filter1d(middle, BODY_SMOOTHING * scene.fps, 0, mode="nearest")
    offsets = (seen - targets[:, None]) @ axes.T
    return targets, float(np.abs(offsets[..., :2]).max()) + HAND_ROOM


def _best_axes(
    scene: Scene, up: Float[np.ndarray, " 3"], targets: Float[np.ndarray, "T 3"], radius: float
) -> Axes:
    """Camera axes that show most pixels of the hands, with extra weight on skin in the object.

    The object hides nothing, as in the pictures. The deepest frames of the first version count.
    """
    before = scene.versions[0]
    deepest = before.measures.depth.nan_to_num().where(before.measures.valid, -1)
    frames = deepest.topk(min(JUDGED_FRAMES, len(deepest))).indices.tolist()
    drawn = {frame: before.drawn(frame, "penetration") for frame in frames}

    def seen(axes: Axes) -> float:
        placed = {frame: Camera(axes, targets[frame], radius) for frame in frames}
        shown = sum(_seen_pixels(hands, placed[at]) for at, hands in drawn.items() if hands)
        return shown * (WEIGHT_BELOW if axes[2] @ up < 0 else 1.0)

    return max((axes_towards(back, up) for back in _directions(up)), key=seen)


def _directions(up: Float[np.ndarray, " 3"]) -> list[Float[np.ndarray, " 3"]]:
    """Directions to the eye around the up axis."""
    up = up / np.linalg.norm(up)
    level = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    level /= np.linalg.norm(level)
    across = np.cross(up, level)
    return [
        np.cos(elevation) * (np.cos(turn) * level + np.sin(turn) * across) + np.sin(elevation) * up
        for elevation in ELEVATIONS
        for turn in np.linspace(0, 2 * np.pi, TURNS, endpoint=False)
    ]


def _seen_pixels(hands: DrawnSurface, camera: Camera) -> float:
    """Number of visible pixels of the hands, with extra weight on skin inside the object."""
    screen = camera.project(hands.verts, (TRIAL_SIZE, TRIAL_SIZE))
    raster = rasterise(screen, hands.faces, (TRIAL_SIZE, TRIAL_SIZE))
    seen = raster.face[raster.covered]
    return len(seen) + DEEP_BONUS * float((hands.position[hands.faces[seen, 0]] > 0).sum())


def _targets(scene: Scene) -> Float[np.ndarray, "T 3"]:
    """Camera targets in the world: the mean keypoint, shifted towards the object's centre."""
    seen = [torch.where(hand.valid[:, None, None], hand.joints, torch.nan) for hand in scene.hands]
    centre = torch.cat(seen, dim=1).nanmean(1).numpy()
    frames, there = np.arange(scene.frames), np.isfinite(centre).all(1)
    motion = seen_object(scene.object)
    middle = _middles(motion) if motion.meshes else None
    if there.any():
        centre = np.stack([np.interp(frames, frames[there], axis[there]) for axis in centre.T], -1)
    elif middle is not None:
        centre = middle
    aside = np.zeros_like(centre) if middle is None else OBJECT_PULL * (middle - centre)
    aside *= np.minimum(1, MAX_OFFSET / np.linalg.norm(aside, axis=-1, keepdims=True).clip(1e-9))
    return _smooth(scene, centre + aside)


def _smooth(scene: Scene, path: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    """The path of a camera, smooth over each shot; at the cuts between shots it may jump."""
    shots = np.split(path, scene.cuts)
    smoothed = (gaussian_filter1d(s, SMOOTHING * scene.fps, 0, mode="nearest") for s in shots)
    return np.concatenate(list(smoothed))


def _middles(motion: ObjectTrack) -> Float[np.ndarray, "T 3"]:
    """The middle of the object's parts in each frame."""
    parts = torch.stack([mesh.verts.mean(0) for mesh in motion.meshes])
    placed = (motion.rotation @ parts[None, ..., None])[..., 0] + motion.translation
    return placed.mean(1).numpy()


def _radius(scene: Scene, targets: Float[np.ndarray, "T 3"], axes: Axes) -> float:
    """Radius with which a camera of these axes sees the hands around the targets, metres."""
    sizes = [float(mesh.extent().norm()) / 2 for mesh in seen_object(scene.object).meshes] or [0.0]
    hands = [(hand.verts, hand.valid) for hand in scene.hands]
    return MARGIN * max(_whole(hands, targets, axes), min(max(sizes), MAX_OBJECT))


def _all(scene: Scene) -> Iterator[Seen]:
    """The hands of all versions, and the outline of each part of the object that was ever seen."""
    yield from ((hand.verts, hand.valid) for hand in scene.hands)
    motion = seen_object(scene.object)
    for part, mesh in enumerate(motion.meshes):
        verts = mesh.some_verts(OUTLINE)
        placed = verts @ motion.rotation[:, part].mT + motion.translation[:, part, None]
        yield placed, torch.ones(scene.frames, dtype=torch.bool)


def _middles_of_all(
    scene: Scene, targets: Float[np.ndarray, "T 3"], axes: Axes
) -> Float[np.ndarray, "T 3"]:
    """The targets, moved in the picture plane to the centre of the box of hands and object."""
    across = torch.from_numpy(axes[:2]).float()
    low = torch.full((scene.frames, 2), torch.inf)
    high = -low
    for verts, there in _all(scene):
        seen = (verts - torch.from_numpy(targets).float()[:, None]) @ across.T
        low = torch.minimum(low, seen.amin(1).where(there[:, None], low))
        high = torch.maximum(high, seen.amax(1).where(there[:, None], high))
    return _smooth(scene, targets + ((low + high) / 2).numpy() @ axes[:2])


def _whole(seen: Iterable[Seen], targets: Float[np.ndarray, "T 3"], axes: Axes) -> float:
    """Radius with which a camera sees all vertices in nearly all frames that have any, metres."""
    half, middle = FIELD_OF_VIEW / 2, torch.from_numpy(targets).float()[:, None]
    radius, has_any = torch.zeros(len(targets)), torch.zeros(len(targets), dtype=torch.bool)
    for verts, there in seen:
        has_any |= there
        aside = (verts - middle) @ torch.from_numpy(axes).float().T
        # perspective: a point that is nearer to the eye by `aside[2]` needs a larger radius
        needed = np.cos(half) * aside[..., :2].abs().amax(-1) + np.sin(half) * aside[..., 2]
        radius = torch.maximum(radius, needed.amax(-1).where(there, radius))
    return float(radius[has_any].quantile(WHOLE_FRAMES))
