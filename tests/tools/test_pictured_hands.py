"""Pictures of known hands for a real estimator."""

import numpy as np
import pytest
import torch

from geneoh.viz.scene import make_scene
from tools.noisy_objects.clips import RECORDING, clip_of
from tools.pictured_hands import (
    FOCAL,
    IN_VIEW,
    SIZE,
    SKIN,
    Photographer,
    before_camera,
    by_least_squares,
    errors_of,
)


@pytest.fixture(scope="module")
def seen():
    """Some frames of the recording before a camera."""
    return before_camera(clip_of(RECORDING)[40:44], 0.45, np.random.default_rng(0))


def test_the_picture_shows_the_hand_where_its_keypoints_are(seen):
    joints = seen.hands[0].joints.numpy()
    pixels = FOCAL * joints[..., :2] / joints[..., 2:] + np.array(SIZE) / 2
    inside = ((pixels >= 0) & (pixels < SIZE)).all((1, 2))
    assert inside.mean() >= IN_VIEW
    grey = np.full((2 * SIZE[1], 2 * SIZE[0], 3), 150.0)
    photographer = Photographer(make_scene({"": seen}), joints, grey, np.random.default_rng(0))
    picture = photographer.picture(1).astype(float)
    column, row = pixels[1, 9].astype(int)
    around = picture[row - 5 : row + 5, column - 5 : column + 5].mean((0, 1))
    shade = around / SKIN
    assert np.ptp(shade) < 0.1 * shade.mean(), "the colour of skin, lit or in shadow"


def test_exact_landmarks_give_exact_places(seen):
    joints = seen.hands[0].joints.double().numpy()
    results = []
    for points in joints:
        image = FOCAL * points[:, :2] / points[:, 2:] / SIZE + 0.5
        image = np.column_stack([image, np.zeros(21)])
        both = {"multi_hand_landmarks": image, "multi_hand_world_landmarks": points - points[9]}
        results.append(
            {
                name: [{"landmark": [dict(zip("xyz", map(float, p), strict=True)) for p in each]}]
                for name, each in both.items()
            }
        )
    np.testing.assert_allclose(by_least_squares(results), joints, atol=1e-5)
    empty = {"multi_hand_landmarks": [], "multi_hand_world_landmarks": []}
    assert np.isnan(by_least_squares([empty])).all()


def test_errors_are_told_apart_along_the_ray_and_in_shape(seen):
    (hand,) = seen.hands
    ray = torch.nn.functional.normalize(hand.joints.mean(1, keepdim=True), dim=-1)
    off = type(hand)(hand.side, hand.valid, hand.joints + 0.05 * ray)
    error, along, shape, _ = errors_of(off, seen)
    assert (error, along) == pytest.approx((50, 50), abs=0.1)
    assert shape < 1e-2
