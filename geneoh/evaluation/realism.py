"""A report on how similar synthetic interactions are to a real recording.

Both are described by the same measures of a right hand at 30 frames a second: speed and
acceleration of wrist and fingertips, joint angles, contact and penetration depth of the mesh, and
the accuracy of a classifier that separates the two sources. A recording of one grasp is always a
narrow sample of hand motion. The accuracy is therefore reported with a control: how well the same
classifier separates single synthetic clips from all other synthetic clips.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.errors import InputError, numbered
from geneoh.evaluation import distributions
from geneoh.evaluation.distributions import joint_angles
from geneoh.evaluation.realism_clips import FPS, TIPS, HandClips, recorded_clip, synthetic_clips
from geneoh.evaluation.two_sample_classifier import (
    BLOCK,
    SNIPPET,
    VIEWS,
    all_snippets,
    block_snippets,
    cross_validate,
)
from geneoh.hand.library import load_hand
from geneoh.metrics.smoothness import valid_differences
from geneoh.objects.camera_motion import in_steady_world
from geneoh.seeds import seed_of
from geneoh.sequence.sequence import Sequence

CONTROLS = 12  # synthetic clips in the control


@dataclass(frozen=True)
class Comparison:
    """One measure of both sources."""

    name: str
    unit: str
    real: distributions.Quantiles
    synthetic: distributions.Quantiles
    distance: float  # Kolmogorov-Smirnov statistic of the two distributions, 0 to 1


@dataclass(frozen=True)
class RealismReport:
    """Similarity of synthetic interactions to a recording."""

    measures: tuple[Comparison, ...]
    correlation: dict[str, float]
    """Correlations of pairs of joint angles: their mean absolute value in each source, their mean
    absolute difference, and the correlation between the two sources' correlations."""
    accuracy: dict[str, float]  # of the classifier that separates the two sources, by view
    control: dict[str, float]  # mean accuracy on single synthetic clips against the others, by view
    snippets: tuple[int, int]  # number of classified snippets, real and synthetic
    clips: int  # number of synthetic clips
    augmented: bool = False  # whether the synthetic clips had the augmentation of training


def measure_realism(recording: Sequence, folder: Path, *, augmented: bool = False) -> RealismReport:
    """Compare the training shards in a folder with the first hand of a clean recording.

    With `augmented`, the synthetic clips get the augmentation of training.
    """
    hand = load_hand("right")
    real = recorded_clip(in_steady_world(recording), hand)
    synthetic = synthetic_clips(folder, hand, augmented=augmented)
    return replace(compare_clips(real, synthetic), augmented=augmented)


def compare_clips(real: HandClips, synthetic: HandClips) -> RealismReport:
    """The report on one real clip and many synthetic ones."""
    blocks = block_snippets(real.object[0], real.near[0])
    others = one_snippet_each(synthetic)
    if len(blocks) < 2 or len(others) < 2 * len(blocks):
        raise InputError(
            f"expected a hand at its object for {SNIPPET} frames without a gap in two or more "
            f"blocks of {BLOCK} frames of the recording, and in twice as many synthetic clips, got "
            f"{numbered(len(blocks), 'block')} and {numbered(len(others), 'clip')}; take a longer "
            "recording or more data"
        )
    return RealismReport(
        measures=tuple(comparisons(real, synthetic)),
        correlation=angle_correlations(real, synthetic),
        accuracy={view: cross_validate(blocks, others, view, FPS) for view in VIEWS},
        control=controls(synthetic, others),
        snippets=(sum(map(len, blocks)), len(others)),
        clips=len(synthetic.world),
    )


def one_snippet_each(clips: HandClips) -> Float[Tensor, "N S 21 3"]:
    """One snippet of each clip that has any, chosen at random with the clip's index as seed."""
    found = [clips.object.new_zeros(0, SNIPPET, 21, 3)]
    for index, (joints, near) in enumerate(zip(clips.object, clips.near, strict=True)):
        if len(snippets := all_snippets(joints, near)):
            found.append(snippets[seed_of("snippet", index) % len(snippets)][None])
    return torch.cat(found)


def controls(clips: HandClips, others: Float[Tensor, "N S 21 3"]) -> dict[str, float]:
    """Mean accuracy of separating single clips from the other clips of the same source, by view.

    The clip's own snippet is among the hundreds of `others`, which hardly changes the accuracy.
    """
    each = (block_snippets(*clip) for clip in zip(clips.object, clips.near, strict=True))
    chosen = list(islice((blocks for blocks in each if len(blocks) > 1), CONTROLS))
    found: dict[str, float] = {}
    for view in VIEWS:
        scores = [cross_validate(blocks, others, view, FPS) for blocks in chosen]
        found[view] = float(torch.tensor(scores).mean())
    return found


def comparisons(real: HandClips, synthetic: HandClips) -> Iterator[Comparison]:
    """The comparison of each measure between the two sources."""
    both = (real, synthetic)

    def compared(name: str, unit: str, values: list[Tensor], scale: float = 1.0) -> Comparison:
        first, second = (scale * each.flatten() for each in values)
        spans = distributions.quantiles(first), distributions.quantiles(second)
        return Comparison(name, unit, *spans, distributions.ks_distance(first, second))

    for points, which in (("wrist", [0]), ("fingertips", TIPS)):
        for frame in ("world", "object"):
            for order, name, unit in ((1, "speed", "m/s"), (2, "acceleration", "m/s²")):
                values = [
                    distributions.motion_size(getattr(clips, frame)[:, :, which], FPS, order)[
                        torch.stack([valid_differences(each, order) for each in clips.valid])
                    ]
                    for clips in both
                ]
                yield compared(f"{points}, {name}, {frame}", unit, values)
    angles = [joint_angles(clips.world[clips.valid]) for clips in both]
    for index, name in enumerate(distributions.ANGLES):
        yield compared(name, "°", [each[:, index] for each in angles], scale=180 / torch.pi)
    for name, unit, field, scale in (
        ("skin in contact", "cm²", "area", 1e4),
        ("fingertips in contact", "", "fingers", 1.0),
        ("penetration depth", "mm", "depth", 1e3),
    ):
        values = [getattr(clips, field)[clips.touching] for clips in both]
        yield compared(name, unit, values, scale)
    yield compared("frames in contact", "%", [clips.touching.float() for clips in both], 100.0)


def angle_correlations(real: HandClips, synthetic: HandClips) -> dict[str, float]:
    """Similarity of the correlations between joint angles in two sources."""
    ours, theirs = (
        distributions.correlations(joint_angles(clips.world[clips.valid]))
        for clips in (real, synthetic)
    )
    return {
        "real_mean_size": float(ours.abs().mean()),
        "synthetic_mean_size": float(theirs.abs().mean()),
        "mean_difference": float((ours - theirs).abs().mean()),
        "agreement": float(torch.corrcoef(torch.stack([ours, theirs]))[0, 1]),
    }


def table(report: RealismReport) -> list[str]:
    """The report as lines of text."""
    lines = [
        f"{'':<38}{'real 5%':>8}{'50%':>8}{'95%':>8}{'made 5%':>10}{'50%':>8}{'95%':>8}{'KS':>6}"
    ]
    for each in report.measures:
        spans = (asdict(side).values() for side in (each.real, each.synthetic))
        real, made = ("".join(f"{value:>8.3g}" for value in span) for span in spans)
        title = f"{each.name} {each.unit}".rstrip()
        lines.append(f"{title:<38}{real}  {made}{each.distance:>6.2f}")
    pairs = report.correlation
    lines.append(
        f"joint angles' correlations: mean size {pairs['real_mean_size']:.2f} real, "
        f"{pairs['synthetic_mean_size']:.2f} made, mean difference {pairs['mean_difference']:.2f}, "
        f"agreement {pairs['agreement']:.2f}"
    )
    lines.append(
        f"classifier accuracy on one second ({report.snippets[0]} real, {report.snippets[1]} made; "
        "0.5 is chance), and control:"
    )
    for view in report.accuracy:
        lines.append(f"  {view:<36}{report.accuracy[view]:>8.2f}{report.control[view]:>8.2f}")
    return lines
