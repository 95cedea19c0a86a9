"""The weights in the package, on bodies that no network has learned from.

Bounds leave about as much again as what was measured with the weights of November 2026.
"""

from functools import cache

import torch

import geneoh
from geneoh.body.motion import BodyMotion, pose
from geneoh.body.skeleton import BODY_JOINTS, embedded_skeleton
from geneoh.generators.both2hands.library import SHIPPED, load_both2hands
from geneoh.generators.both2hands.limits import ALLOWED, FingerRange
from geneoh.generators.both2hands.on_body import BodyOptions, generate_on_body
from geneoh.generators.both2hands.sampling import Both2HandsSampling, generate_hands, sample_hands
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.metrics.smoothness import acceleration, in_mm_per_frame_squared
from geneoh.readers.bodies.base import BodyRecording, resting_body
from geneoh.synthesis.gestures.synthesis import BodyConfig, gesturing

WAVES, FIST = "the left hand waves, the right hand rests", "both hands make a fist"
VARIANTS = [("wave", 8)]
BODIES = [365, 390]
FPS = 30.0


@cache
def gestures():
    """A clip of 5 s of two bodies, in ways and proportions that were held out."""
    generator = torch.Generator().manual_seed(1)
    return gesturing(VARIANTS, BODIES, 150, BodyConfig(), generator=generator)


@cache
def fingers(sentence: str, seed: int = 0, smoothing: float = 1.5):
    """The rotations of the fingers that the networks make in four steps, (B, T, 30, 3, 3)."""
    clips, config = gestures(), Both2HandsSampling(steps=4, smoothing=smoothing)
    said, generator = [sentence] * len(BODIES), torch.Generator().manual_seed(seed)
    made = sample_hands(
        load_both2hands(), clips.motion, clips.skeleton, said, config, generator=generator
    )
    return made.rotations[:, :, BODY_JOINTS:]


def apart(one, other) -> float:
    """Mean angle between rotations, degrees."""
    return float(matrix_to_axis_angle(one.mT @ other).norm(dim=-1).mean().rad2deg())


def shaking(fingers) -> float:
    """Mean acceleration of the finger joints of a body that does not move, mm/frame²."""
    still = (
        resting_body(fingers.shape[1]).rotations[:, :BODY_JOINTS].expand(len(fingers), -1, -1, 3, 3)
    )
    root = torch.zeros(*fingers.shape[:2], 3)
    posed = pose(embedded_skeleton(), BodyMotion(root, torch.cat([still, fingers], 2)))
    joints = posed.positions[:, :, BODY_JOINTS:]
    return float(in_mm_per_frame_squared(acceleration(joints, FPS), FPS).mean())


def beyond(fingers):
    """How far each joint is beyond the limits of a hand, radians."""
    return FingerRange.of_hands().beyond(matrix_to_axis_angle(fingers))


def test_the_weights_of_all_networks_take_less_than_ten_megabytes():
    assert sum(path.stat().st_size for path in SHIPPED.iterdir()) < 10_000_000


def test_another_sentence_changes_shipped_hands_far_more_than_another_seed():
    changed = apart(fingers(WAVES), fingers(FIST))
    assert changed > 15  # 49 degrees
    assert changed > 3 * apart(fingers(WAVES), fingers(WAVES, seed=1))  # 2 degrees


def test_shipped_hands_are_smooth_by_the_gaussian_at_the_end():
    smooth = shaking(fingers(WAVES))
    assert smooth < 0.1  # 0.04 mm/frame², and 0.12 without the Gaussian
    assert smooth < 0.6 * shaking(fingers(WAVES, smoothing=0.0))


def test_hardly_a_joint_of_shipped_hands_is_beyond_the_limits_of_a_hand():
    assert (beyond(fingers(WAVES)) > ALLOWED).float().mean() < 0.03  # none


def test_no_joint_that_is_given_to_users_is_beyond_the_limits_of_a_hand():
    clips = gestures()
    body = BodyMotion(clips.motion.root[0], clips.motion.rotations[0])
    generator = torch.Generator().manual_seed(0)
    skeleton = clips.skeleton.take(slice(1), "B")
    made = generate_hands(
        body, skeleton, FIST, steps=2, generator=generator, networks=load_both2hands()
    )
    assert beyond(made.rotations[:, BODY_JOINTS:]).max() <= ALLOWED


def test_the_same_seed_gives_the_same_file_and_another_one_other_hands(tmp_path):
    clips = gestures()
    motion = BodyMotion(clips.motion.root[0, :20], clips.motion.rotations[0, :20])
    body = BodyRecording(motion, embedded_skeleton(), torch.zeros(3), FPS, "a body")
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        made = generate_on_body(WAVES, body, BodyOptions(steps=2, seed=seed))
        geneoh.save(made, tmp_path / f"{name}.npz")
    first, same, other = ((tmp_path / f"{name}.npz").read_bytes() for name in "abc")
    assert first == same
    assert first != other
