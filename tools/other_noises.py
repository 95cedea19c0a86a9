"""Errors of trackers that the noises of `geneoh corrupt` leave out: `python -m tools.other_noises`.

Clean clips of the example recording, of held-out families and of held-out scans get one error at a
time. A row has mean keypoint errors in millimetres of the input, of the tuned Savitzky-Golay filter
and of geneoh, and the share of clips in which geneoh is farther off than the better of the two.
"""

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

import geneoh
from geneoh.baselines.filters import TUNED, smooth
from geneoh.fitting.twist import turned_about_bones
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.skeleton import rest_offsets
from geneoh.metrics.accuracy import mpjpe
from geneoh.seeds import seeded_generator
from geneoh.sequence.gaps import filled_keypoints
from geneoh.sequence.noise import corrupt, ornstein_uhlenbeck, perturbed
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.shapes.scans import read_folder
from tools.noisy_objects.clips import EXAMPLES, RECORDING, clip_of, made_clips, scans_of

FRAMES = 120  # of a made clip
Error = Callable[[HandTrack, torch.Generator], HandTrack]


def keypoints_alone(hand: HandTrack, joints: Float[Tensor, "T 21 3"]) -> HandTrack:
    """A track of keypoints, without parameters."""
    return HandTrack(hand.side, hand.valid, joints=joints)


def offsets(
    hand: HandTrack, place: float, turn: float, fingers: float, generator: torch.Generator
) -> Float[Tensor, "T 51"]:
    """White noise of the parameters by its standard deviations in metres and radians."""
    sizes = torch.tensor([place] * 3 + [turn] * 3 + [fingers] * 45)
    return sizes * torch.randn(hand.frames, 51, generator=generator)


def white(place: float, turn: float, fingers: float) -> Error:
    """White noise of the parameters."""

    def noisy(hand: HandTrack, generator: torch.Generator) -> HandTrack:
        return perturbed(hand, offsets(hand, place, turn, fingers, generator), hand.valid)

    return noisy


def with_light_noise(
    hand: HandTrack, error: Float[Tensor, "T 51"], generator: torch.Generator
) -> HandTrack:
    """Errors of the parameters beside white noise of 3 mm, 0.03 and 0.03 radians."""
    return perturbed(hand, error + offsets(hand, 0.003, 0.03, 0.03, generator), hand.valid)


def independent_keypoints(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """Independent Gaussian noise of 10 mm on every coordinate."""
    assert hand.joints is not None
    noise = torch.randn(hand.joints.shape, generator=generator)
    return keypoints_alone(hand, hand.joints + 0.01 * noise)


def depth(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """White noise of the translation, 20 mm along one random ray and 2 mm across it."""
    ray = torch.nn.functional.normalize(torch.randn(3, generator=generator), dim=0)
    error = offsets(hand, 0.002, 0.0, 0.05, generator)
    along = 0.02 * torch.randn(hand.frames, 1, generator=generator)
    error[:, :3] += along * ray
    return perturbed(hand, error, hand.valid)


def half_flexed(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """Finger rotations are 0.6 of the true ones, as of networks that regress to the mean."""
    assert hand.pose is not None
    error = torch.zeros(hand.frames, 51)
    error[:, 6:] = -0.4 * hand.pose[:, 1:].flatten(1)
    return with_light_noise(hand, error, generator)


def one_finger_straight(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """One finger, which the camera does not see, is nearly straight in all frames."""
    assert hand.pose is not None
    first = 3 * int(torch.randint(5, (1,), generator=generator))
    error = torch.zeros(hand.frames, 16, 3)
    error[:, 1 + first : 4 + first] = -0.9 * hand.pose[:, 1 + first : 4 + first]
    none = torch.zeros(hand.frames, 3)
    return with_light_noise(hand, torch.cat([none, error.flatten(1)], -1), generator)


def too_large(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """The hand is a tenth too large, with white noise of 4 mm on its translation."""
    assert hand.joints is not None
    wrist = hand.joints[:, :1]
    shift = 0.004 * torch.randn(hand.frames, 1, 3, generator=generator)
    return keypoints_alone(hand, wrist + 1.1 * (hand.joints - wrist) + shift)


def every_third_frame(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """The tracker updates in every third frame, and repeats its result in between."""
    kept = 3 * (torch.arange(hand.frames) // 3)
    noise = offsets(hand, 0.004, 0.03, 0.1, generator)
    return perturbed(at(hand, kept), noise[kept], hand.valid)


def a_frame_late(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """The hand comes one frame later than the object."""
    late = at(hand, (torch.arange(hand.frames) - 1).clamp(min=0))
    return with_light_noise(late, torch.zeros(hand.frames, 51), generator)


def at(hand: HandTrack, frames: Tensor) -> HandTrack:
    """A track with the poses of the given frames."""
    assert hand.joints is not None
    assert hand.pose is not None
    assert hand.wrist is not None
    return replace(
        hand, joints=hand.joints[frames], pose=hand.pose[frames], wrist=hand.wrist[frames]
    )


def plateaus(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """An error that stays for 6 to 30 frames and then is another one."""
    error = offsets(hand, 0.012, 0.06, 0.2, generator)
    lengths = torch.randint(6, 31, (hand.frames,), generator=generator)
    which = torch.arange(hand.frames).repeat_interleave(lengths)[: hand.frames]
    return with_light_noise(hand, error[which], generator)


def lasting(frames: float) -> Error:
    """Errors with a correlation time of `frames` frames, as of networks that use several frames."""

    def noisy(hand: HandTrack, generator: torch.Generator) -> HandTrack:
        white = offsets(hand, 0.012, 0.06, 0.2, generator)
        return perturbed(hand, ornstein_uhlenbeck(white, frames), hand.valid)

    return noisy


def swaying(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """Each parameter sways four times a second, at 30 frames a second, beside light noise."""
    size = math.sqrt(2) * offsets(hand, 0.012, 0.06, 0.2, generator)[0]
    turns = torch.rand(51, generator=generator) + 4 / 30 * torch.arange(hand.frames)[:, None]
    return with_light_noise(hand, size * torch.sin(2 * math.pi * turns), generator)


def filtered_with_lag(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """Translation noise of 8 mm after a causal moving average, which lags behind."""
    assert hand.joints is not None
    joints = hand.joints + 0.008 * torch.randn(hand.frames, 1, 3, generator=generator)
    for t in range(1, hand.frames):
        joints[t] = 0.6 * joints[t - 1] + 0.4 * joints[t]
    return keypoints_alone(hand, joints)


def a_second_lost(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """A second of the hand is missing."""
    start = int(torch.randint(20, hand.frames - 50, (1,), generator=generator))
    there = torch.ones(hand.frames, dtype=torch.bool)
    there[start : start + 30] = False
    return perturbed(hand, offsets(hand, 0.003, 0.02, 0.1, generator), there)


def twisted(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """Joints of the fingers are turned about their bones, by 15 to 60 degrees, and the next ones
    back: keypoints stay, as in fits to keypoints without a prior of poses."""
    assert hand.joints is not None
    assert hand.pose is not None
    rotations = axis_angle_to_matrix(hand.pose)
    size = torch.deg2rad(15 + 45 * torch.rand(5, 1, 3, generator=generator))
    twist = size * (2 * torch.randint(0, 2, size.shape, generator=generator) - 1)
    skeleton = rest_offsets(rotations, hand.joints, hand.trust)
    moved = turned_about_bones(rotations, skeleton, twist.expand(5, hand.frames, 3))
    return replace(hand, pose=matrix_to_axis_angle(moved))


def noisy_and_twisted(hand: HandTrack, generator: torch.Generator) -> HandTrack:
    """As `twisted`, on a hand with the noise "gauss"."""
    return twisted(corrupt(hand, "gauss", generator=generator), generator)


ERRORS: dict[str, Error] = {
    "place alone, 2 mm, white": white(0.002, 0.0, 0.0),
    "place alone, 5 mm, white": white(0.005, 0.0, 0.0),
    "place alone, 12 mm, white": white(0.012, 0.0, 0.0),
    "place along one ray, 20 mm, white": depth,
    "turn alone, 0.15 rad, white": white(0.0, 0.15, 0.0),
    "fingers alone, 0.3 rad, white": white(0.0, 0.0, 0.3),
    "every keypoint by itself, 10 mm": independent_keypoints,
    "every third frame": every_third_frame,
    "plateaus of 6 to 30 frames": plateaus,
    "alike for 4 frames": lasting(4.0),
    "alike for 15 frames": lasting(15.0),
    "swaying 4 times a second": swaying,
    "a second lost": a_second_lost,
    "a frame late": a_frame_late,
    "place filtered with a lag": filtered_with_lag,
    "fingers bent by 0.6 of the truth": half_flexed,
    "one finger straight": one_finger_straight,
    "hand a tenth too large": too_large,
    "fingers twisted about their bones": twisted,
    "gauss, and twisted so": noisy_and_twisted,
    "clean": lambda hand, _: hand,
    "gauss": lambda hand, generator: corrupt(hand, "gauss", generator=generator),
}


def main() -> None:
    """Print the table, a line for each error."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--clips", type=int, default=6, help="of families, and of scans")
    parser.add_argument("--seeds", type=int, default=3, help="of the recording")
    parser.add_argument("--errors", nargs="+", choices=ERRORS, default=ERRORS, metavar="NAME")
    parser.add_argument("--preset", default="default")
    parser.add_argument("--weights", type=Path, help="folder of other weights")
    args = parser.parse_args()
    torch.set_num_threads(1)
    options = geneoh.Options(preset=args.preset, weights=args.weights)
    groups = clips_of(args.clips, args.seeds)
    print("| error | " + " | ".join(f"{title} | worse" for title in groups) + " |")
    print("|---|" + "---|--:|" * len(groups))
    for name in args.errors:
        cells = (cell(name, ERRORS[name], clips, options) for clips in groups.values())
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


def clips_of(count: int, seeds: int) -> dict[str, list[Sequence]]:
    """The clean clips by where they come from; the recording once for each seed."""
    objects = read_folder(EXAMPLES / "objects")
    scans = scans_of(objects, objects.held_out)
    return {
        "recording": [clip_of(RECORDING)] * seeds,
        "made": made_clips(SynthesisConfig().held_out, count, 3000, FRAMES),
        "scanned": made_clips(scans.names, count, 3000, FRAMES, scans),
    }


def cell(name: str, error: Error, clips: list[Sequence], options: geneoh.Options) -> str:
    """The means over clips, and the share in which geneoh is worse, as cells of the table."""
    rows = torch.tensor(
        [scored(clip, error, seeded_generator(name, n), options) for n, clip in enumerate(clips)]
    )
    worse = (rows[:, 2] > rows[:, :2].amin(1)).double().mean()
    return " / ".join(f"{value:.1f}" for value in rows.mean(0)) + f" | {100 * worse:.0f}%"


def scored(
    clean: Sequence, error: Error, generator: torch.Generator, options: geneoh.Options
) -> tuple[float, ...]:
    """Errors of the input, the filter and geneoh, millimetres."""
    (hand,) = clean.hands
    assert hand.joints is not None
    noisy = error(hand, generator)
    filled = filled_keypoints(noisy)
    smoothed = smooth(filled, TUNED["savgol", "keypoints"], clean.fps)
    result = geneoh.denoise(replace(clean, hands=(noisy,)), options).sequence.hands[0].joints
    assert result is not None
    return tuple(
        1000 * float(mpjpe(joints, hand.joints).mean()) for joints in (filled, smoothed, result)
    )


if __name__ == "__main__":
    main()
