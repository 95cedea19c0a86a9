"""Error and cost of a stream by its lag: `python -m tools.stream_lags`.

The example recording and made clips, under noises of `geneoh corrupt` and several seeds, go through
`geneoh.Stream`. It is compared with the input, the best simple filter of the same lag, and the
whole track cleaned at once. Errors are means over keypoints and frames, millimetres.
"""

import argparse
import time

import torch
from jaxtyping import Float
from torch import Tensor

import geneoh
from geneoh.baselines.filters import TUNED, Domain, filtered
from geneoh.bundle import concatenated
from geneoh.choices import FilterKind
from geneoh.metrics.accuracy import RADIUS_90
from geneoh.pipeline.streaming.stream import Stream
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.synthesis.data_config import SynthesisConfig
from tools.noisy_objects.clips import RECORDING, clip_of, made_clips

FILTERS: tuple[tuple[FilterKind, Domain], ...] = (
    ("savgol", "keypoints"),
    ("savgol", "parameters"),
    ("one-euro", "keypoints"),
)
SEEN = 60
"""Window of a filter in frames, as long as that of the stream."""
Row = dict[str, float]


def main() -> None:
    """Print one table for the recording and one for made clips, a line for each lag."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--lags", type=float, nargs="+", default=[0.1, 0.2, 0.3, 0.5, 1.0])
    parser.add_argument("--noises", nargs="+", default=["gauss", "drop", "camera"])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--clips", type=int, default=2, help="made clips")
    parser.add_argument("--frames", type=int, default=146, help="of each, at most")
    parser.add_argument("--made-only", action="store_true", help="leave out the recording")
    args = parser.parse_args()
    torch.set_num_threads(1)
    made = made_clips(SynthesisConfig().common, args.clips, 2000, args.frames)
    recorded = [] if args.made_only else [clip_of(RECORDING)[: args.frames]]
    for title, clips in (("recording", recorded), ("made clips", made)):
        if not clips:
            continue
        rows: dict[float, list[Row]] = {lag: [] for lag in args.lags}
        for clip in clips:
            for noise in args.noises:
                for seed in range(args.seeds):
                    generator = torch.Generator().manual_seed(seed)
                    noisy = corrupt_sequence(clip, noise, generator=generator)
                    measure(clip.hands[0], noisy, seed, rows)
        report(title, rows)


def measure(truth: HandTrack, noisy: Sequence, seed: int, rows: dict[float, list[Row]]) -> None:
    """Add a row of errors and costs for each lag, measured on one clip."""
    began = time.process_time()
    whole = geneoh.denoise(noisy, seed=seed).sequence.hands[0]
    spent = time.process_time() - began
    for lag in rows:
        frames = round(lag * noisy.fps)
        fixed = {
            "input": error(fill_gaps(noisy.hands[0]).joints, truth),
            "filter": min(
                error(lagged_filter(noisy.hands[0], frames, noisy.fps, *kind), truth)
                for kind in FILTERS
            ),
            "whole": error(whole.joints, truth),
            "whole_ms": 1000 * spent / noisy.frames,
        }
        rows[lag].append(fixed | streamed(truth, noisy, lag, seed))


def streamed(truth: HandTrack, noisy: Sequence, lag: float, seed: int) -> Row:
    """Error, cost and share within the 90% radius of a stream."""
    hand, motion = noisy.hands[0], noisy.object
    stream = Stream(motion.meshes, noisy.fps, lag, side=hand.side, seed=seed)
    found, slowest, began = [], 0.0, time.process_time()
    for frame in range(noisy.frames):
        before = time.process_time()
        one = hand[frame : frame + 1] if bool(hand.valid[frame]) else None
        found.append(stream.push(one, (motion.rotation[frame], motion.translation[frame])))
        slowest = max(slowest, time.process_time() - before)
    frames = [frame.hand for frame in [*found, *stream.flush()] if frame and frame.hand]
    spent = time.process_time() - began
    clean = concatenated(frames)
    assert clean.joint_spread is not None, "a stream draws two samples"
    apart = distances(clean.joints, truth[-len(frames) :])
    return {
        "stream": 1000 * float(apart.mean()),
        "inside": float((apart <= RADIUS_90 * clean.joint_spread).float().mean()),
        "ms": 1000 * spent / noisy.frames,
        "slowest_ms": 1000 * slowest,
    }


def lagged_filter(
    hand: HandTrack, lag: int, fps: float, kind: FilterKind, domain: Domain
) -> Float[Tensor, "T 21 3"]:
    """Keypoints of a filter that outputs each frame after `lag` further frames."""
    hand, found = fill_gaps(hand), []
    for frame in range(hand.frames):
        last = min(frame + lag, hand.frames - 1)
        first = max(0, last + 1 - SEEN)
        joints = filtered(hand[first : last + 1], TUNED[kind, domain], domain, fps)
        found.append(joints[frame - first])
    return torch.stack(found)


def error(joints: Float[Tensor, "T 21 3"] | None, truth: HandTrack) -> float:
    """Mean distance to the truth, millimetres."""
    return 1000 * float(distances(joints, truth).mean())


def distances(joints: Float[Tensor, "T 21 3"] | None, truth: HandTrack) -> Float[Tensor, "T 21"]:
    """Distance of each keypoint to the truth, metres."""
    assert joints is not None, "clean hands have keypoints"
    assert truth.joints is not None, "so has the truth"
    return (joints - truth.joints).norm(dim=-1)


def report(title: str, rows: dict[float, list[Row]]) -> None:
    """The means over all clips, noises and seeds as a Markdown table."""
    print(f"\n{title}, {len(next(iter(rows.values())))} runs\n")
    print("| lag, s | input | best filter | stream | whole track | stream / whole", end=" ")
    print("| truth in the 90% radius | processor, ms a frame | slowest push, ms | whole, ms |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for lag, each in rows.items():
        mean = {name: sum(row[name] for row in each) / len(each) for name in each[0]}
        print(
            f"| {lag:g} | {mean['input']:.1f} | {mean['filter']:.1f} | {mean['stream']:.1f} "
            f"| {mean['whole']:.1f} | {mean['stream'] / mean['whole']:.2f} "
            f"| {100 * mean['inside']:.0f}% | {mean['ms']:.0f} | {mean['slowest_ms']:.0f} "
            f"| {mean['whole_ms']:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
