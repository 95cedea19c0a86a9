"""Places of MediaPipe's hands before the camera, by their landmarks of the picture."""

from dataclasses import replace

import numpy as np
import torch

from geneoh.errors import ConfigError, InputError, numbered
from geneoh.fitting.before_camera import hand_before_camera
from geneoh.hand.library import mean_hand
from geneoh.readers.base import ImageSize, ReaderOptions
from geneoh.readers.keypoints.mediapipe import NOTES, Landmarks, LandmarkTrack
from geneoh.readers.records import Array, float32

PLACED_NOTE = (
    "hands are placed before the camera as of mean size, by their landmarks of the picture: "
    "coordinates are the camera's, x to the right, y down, z forward"
)
UNSEEN_NOTE = (
    "the {} hand counts as not seen in {}, which name the other side, or lack its landmarks of the "
    "picture"
)
WIDEST, LARGEST, SMALLEST = 5.0, 10.0, 0.01
"""Limits of what may be a hand in a picture: largest coordinate on the plane one metre before the
camera, at 79 degrees from its axis, and of the shape, metres; and least extent of either."""


def camera_of(options: ReaderOptions) -> tuple[float, ImageSize] | None:
    """Focal length and size of the images, pixels, if the caller names both; `ConfigError` for one
    of them alone."""
    focal, size = options.focal, options.image_size
    if focal is not None and size is not None:
        return focal, size
    if focal is None and size is None:
        return None
    given, lacking = ("--focal", "--image-size") if size is None else ("--image-size", "--focal")
    raise ConfigError(f"{given}: needs {lacking} too, to place MediaPipe's hands; pass it")


def placed_before_camera(found: Landmarks, focal: float, size: ImageSize, where: str) -> Landmarks:
    """The landmarks with each hand, which has a side, in the frame of the camera that saw it."""
    tracks, notes = {}, found.notes[len(NOTES) :]
    for side, track in found.tracks.items():
        assert side is not None, "hands that are placed have a side"
        if not np.isfinite(track.image).all((-1, -2)).any():
            raise InputError(
                f"{where}: --focal and --image-size place MediaPipe's hands by their landmarks of "
                "the picture (hand_landmarks), got none; save them too, or drop the options"
            )
        rays, shape = _rays_and_shape(track, focal, size)
        spans = np.stack([np.ptp(each[..., :2], axis=1).max(-1) for each in (rays, shape)])
        seen = (np.abs(rays).max((1, 2)) < WIDEST) & (np.abs(shape).max((1, 2)) < LARGEST)
        seen &= (spans > SMALLEST).all(0)
        if not seen.any():
            raise InputError(
                f"{where}: expected landmarks of a hand in a picture of {size[0]}x{size[1]} pixels "
                f"with a focal length of {focal:g}, got points of a size that no hand has; correct "
                "--focal and --image-size, or the file"
            )
        if count := int((track.trust > 0).sum() - seen.sum()):
            notes = (*notes, UNSEEN_NOTE.format(side, numbered(count, "frame")))
        hand, there = mean_hand(side), torch.from_numpy(seen)
        state = hand_before_camera(float32(rays), float32(shape), there, hand)
        points = state.joints(hand)[0].double().numpy()
        points[~seen] = np.nan
        tracks[side] = replace(track, points=points)
    return replace(found, tracks=tracks, notes=(PLACED_NOTE, *notes), camera=np.zeros(3))


def _rays_and_shape(track: LandmarkTrack, focal: float, size: ImageSize) -> tuple[Array, Array]:
    """(T, 21, 2) landmarks on the plane one metre before the camera, and (T, 21, 3) shape of the
    hand in metres, which without world landmarks is that of the landmarks of the picture."""
    width, height = size
    with np.errstate(over="ignore"):
        pixels = track.image * [width, height, width]
    shape = np.where(np.isfinite(track.points), track.points, pixels / focal)
    return (pixels[..., :2] - [width / 2, height / 2]) / focal, shape
