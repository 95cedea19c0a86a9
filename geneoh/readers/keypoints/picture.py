"""Places of MediaPipe's hands before the camera, by their landmarks of the picture."""

from dataclasses import replace

import numpy as np
import torch

from geneoh.choices import Side
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


def camera_of(options: ReaderOptions) -> tuple[float, ImageSize] | None:
    """Focal length and size of the images, pixels, if the caller names both; `ConfigError` for one
    of them alone."""
    focal, size = options.focal, options.image_size
    if focal is not None and size is not None:
        return focal, size
    if focal is not None or size is not None:
        given, lacking = "--focal", "--image-size"
        if focal is None:
            given, lacking = lacking, given
        raise ConfigError(f"{given}: needs {lacking} too, to place MediaPipe's hands; pass it")
    return None


def placed_before_camera(found: Landmarks, focal: float, size: ImageSize, where: str) -> Landmarks:
    """The landmarks with each hand, which has a side, in the frame of the camera that saw it."""
    tracks, notes = {}, found.notes[len(NOTES) :]
    for side, track in found.tracks.items():
        assert side is not None, "hands that are placed have a side"
        seen = np.asarray(np.isfinite(track.image).all((-1, -2)))
        if not seen.any():
            raise InputError(
                f"{where}: --focal and --image-size place MediaPipe's hands by their landmarks of "
                "the picture (hand_landmarks), got none; save them too, or drop the options"
            )
        if count := int((track.trust > 0).sum() - seen.sum()):
            notes = (*notes, UNSEEN_NOTE.format(side, numbered(count, "frame")))
        tracks[side] = _placed(track, seen, side, focal, size)
    return replace(found, tracks=tracks, notes=(PLACED_NOTE, *notes), camera=np.zeros(3))


def _placed(
    track: LandmarkTrack, seen: Array, side: Side, focal: float, size: ImageSize
) -> LandmarkTrack:
    """One hand of mean size in the camera's frame, metres, in the frames with landmarks of the
    picture; without world landmarks these are its shape too."""
    width, height = size
    pixels = track.image * [width, height, width]
    centre = np.array([width / 2, height / 2])
    shape = np.where(np.isfinite(track.points), track.points, pixels / focal)
    hand = mean_hand(side)
    state = hand_before_camera(
        float32((pixels[..., :2] - centre) / focal), float32(shape), torch.from_numpy(seen), hand
    )
    points = state.joints(hand)[0].double().numpy()
    points[~seen] = np.nan
    return replace(track, points=points)
