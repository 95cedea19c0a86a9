from dataclasses import replace

import bodies
import pytest
import torch

from geneoh.body.motion import BodyMotion
from geneoh.body.skeleton import Skeleton
from geneoh.errors import InputError
from geneoh.readers.bodies.base import body_at_rate, checked_body
from geneoh.readers.bodies.read import read_body


@pytest.fixture
def body(tmp_path):
    return read_body(bodies.amass(tmp_path / "a.npz", bodies.swaying(41), 120.0))


def test_a_body_comes_to_thirty_frames_a_second_and_back(body):
    slower = body_at_rate(body, 30.0)
    assert (slower.frames, slower.fps) == (11, 30.0)
    assert torch.equal(slower.motion.rotations, body.motion.rotations[::4])
    again = body_at_rate(slower, 120.0)
    assert (again.frames, again.fps) == (41, 120.0)
    torch.testing.assert_close(again.motion.rotations, body.motion.rotations, atol=5e-3, rtol=0)
    torch.testing.assert_close(again.motion.root, body.motion.root, atol=1e-5, rtol=0)


def test_a_single_frame_stays_one(body):
    single = replace(body, motion=body.motion[:1])
    assert body_at_rate(single, 30.0).frames == 1


def test_a_body_that_lasts_too_long_is_refused(body):
    with pytest.raises(InputError, match="must last at most 108000 frames"):
        body_at_rate(replace(body, fps=1e-3), 30.0)


def test_a_skeleton_in_other_units_is_refused(body):
    giant = replace(body, skeleton=Skeleton(100 * body.skeleton.offsets))
    with pytest.raises(InputError, match=r"must be 0.3 to 3 m high"):
        checked_body(giant)


@pytest.mark.parametrize(
    ("change", "noted"),
    [
        (lambda root: root, False),
        (lambda root: root + 9, False),
        (lambda root: 0.1 * root + torch.tensor([0.0, 97.0, 0.0]), True),
        (lambda root: 100 * (root - root[:1]), True),
    ],
)
def test_places_that_may_not_be_in_metres_are_noted(body, change, noted):
    walking = replace(body, fps=30.0)
    moved = BodyMotion(change(walking.motion.root), walking.motion.rotations)
    assert bool(checked_body(replace(walking, motion=moved)).notes) == noted
