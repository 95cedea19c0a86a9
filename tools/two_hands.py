"""Two hands on one object, cleaned together: `python -m tools.two_hands`.

Clips in which two hands hold one object that no network has seen, under noises of `geneoh corrupt`.
Each cell has the input, the tuned Savitzky-Golay filter on the parameters of each hand, and geneoh:
means over clips, hands and frames; for the largest depth of the hands in each other, means over
clips.
"""

import argparse
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import get_args

import torch
from jaxtyping import Bool, Float
from torch import Tensor

import geneoh
from geneoh.baselines.filters import TUNED, filtered
from geneoh.choices import Noise
from geneoh.evaluation.protocols.synthetic import FPS, moving_object, right_hand
from geneoh.evaluation.scores import fitted_verts
from geneoh.fitting.subject import subject_of
from geneoh.geometry.changing_surface import ChangingSurface
from geneoh.geometry.distance import MovingSurface
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics.contact import (
    contact_agreement,
    depth_between,
    penetration_depth,
    tips_in_contact,
)
from geneoh.metrics.smoothness import finite_difference
from geneoh.seeds import seeded_generator
from geneoh.sequence.gaps import fill_gaps, filled_keypoints
from geneoh.sequence.noise import corrupt_sequence
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.synthesis.attempts import draw_attempts, tried_grasps
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.grasping.bimanual import BimanualConfig, grasp_directions, pair_hands
from geneoh.synthesis.motions.motion import Interactions, animate
from geneoh.synthesis.shapes.scans import read_folder
from geneoh.synthesis.shapes.solids import Solids
from tools.noisy_objects.clips import EXAMPLES, scans_of

FRAMES = 90
DEEPEST, OVERLAP = 0.01, 0.002
"""Largest penetration depth of a clean clip in the object, and in the other hand, metres."""
CONFIG = SynthesisConfig(
    frames=FRAMES, shape_std=0.0, bone_std=0.0, bimanual=BimanualConfig(share=1.0, bone_std=0.0)
)
ROWS = {
    "keypoint error, mm": "{:.1f}",
    "depth in the object, mm": "{:.1f}",
    "fingertips in contact, F, %": "{:.0f}",
    "acceleration, mm/frame²": "{:.1f}",
    "deepest in each other, mm": "{:.1f}",
}


@dataclass(frozen=True)
class Pair:
    """Two hands of a clip in T frames, as they are measured."""

    joints: Float[Tensor, "2 T 21 3"]  # world frame, metres
    depth: Float[Tensor, "2 T"]  # of the deepest vertex in the object, metres
    tips: Bool[Tensor, "2 T 5"]  # fingertips that touch the object
    overlap: float  # depth of the deepest vertex that they have in each other, metres


def main() -> None:
    """Print the table, a column for each noise."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--clips", type=int, default=8)
    parser.add_argument("--noises", nargs="+", choices=get_args(Noise), default=get_args(Noise))
    parser.add_argument("--preset", default="default")
    args = parser.parse_args()
    torch.set_num_threads(1)
    clips = list(islice(made_pairs(), args.clips))
    columns = [column(clips, noise, args.preset) for noise in args.noises]
    print("| input / filter / geneoh | " + " | ".join(args.noises) + " |")
    print("|---|" + "--:|" * len(args.noises))
    for row, (name, form) in enumerate(ROWS.items()):
        cells = (" / ".join(map(form.format, values[:, row].tolist())) for values in columns)
        print(f"| {name} | " + " | ".join(cells) + " |")


def made_pairs(scanned: Collection[str] | None = None, at_once: int = 24) -> Iterator[Sequence]:
    """Clips of two hands of the mean shape on held-out families and scans; always the same.

    Clips in which a hand goes through the object or the other hand are left out. `scanned` selects
    scans by name, by default all held-out ones; `at_once` is the number of grasps tried at a time.
    """
    objects = read_folder(EXAMPLES / "objects")
    scans = scans_of(objects, scanned or objects.held_out)
    names = [*CONFIG.held_out, *scans.names]
    generator = seeded_generator("two hands")
    while True:
        tried = draw_attempts(CONFIG, names, at_once, generator=generator, scans=scans)
        toward = grasp_directions(tried.solids, tried.shared)
        grasps = tried_grasps(tried, CONFIG, toward, generator)
        pairs = pair_hands(grasps, tried.shared, CONFIG.bimanual)
        kept, solids = grasps.take(grasps.kept, "B"), tried.solids.take(grasps.kept, "B")
        clips = animate(kept, solids, FRAMES, 1, CONFIG.animation, generator=generator, pairs=pairs)
        named = [name for name, there in zip(tried.families, grasps.kept, strict=True) if there]
        for second in torch.nonzero(pairs.second)[:, 0].tolist():
            first = int(pairs.first[second])
            clip = paired(clips, solids, first, second, Path(named[first]).stem)
            found = clean_pair(clip)
            if float(found.depth.max()) < DEEPEST and found.overlap < OVERLAP:
                yield clip


def paired(clips: Interactions, solids: Solids, first: int, second: int, name: str) -> Sequence:
    """A clip of a right hand, and of a left hand that mirrors the hand of another clip."""
    betas = torch.zeros(10)
    hand = load_hand("right").shaped(betas)
    motion = moving_object(clips, first, solids.take(slice(first, first + 1), "B"))
    right, left = (right_hand(clips, number, hand, betas) for number in (first, second))
    return Sequence((right, left.mirrored()), motion, FPS, f"two hands, {name}")


def column(clips: list[Sequence], noise: Noise, preset: str) -> Float[Tensor, "3 5"]:
    """Means over clips by version (input, filter, geneoh) and row of the table."""
    found = []
    for number, clean in enumerate(clips):
        noisy = corrupt_sequence(clean, noise, generator=seeded_generator(noise, number))
        cleaned = geneoh.denoise(noisy, preset=preset).sequence
        truth, surface = clean_pair(clean), clean.object.surface()
        versions = (
            [fill_gaps(hand) for hand in noisy.hands],
            [smoothed(hand, noisy.fps) for hand in noisy.hands],
            cleaned.hands,
        )
        found.append([scores(measured(hands, surface), truth) for hands in versions])
    return torch.tensor(found).nanmean(0)


def smoothed(hand: HandTrack, fps: float) -> HandTrack:
    """The keypoints of a hand as the tuned filter leaves them."""
    joints = filtered(hand, TUNED["savgol", "parameters"], "parameters", fps)
    everywhere = torch.ones_like(hand.valid)
    return HandTrack(hand.side, everywhere, joints, betas=hand.betas, hand_model=hand.hand_model)


def clean_pair(clip: Sequence) -> Pair:
    """The true hands of a clip."""
    return measured(clip.hands, clip.object.surface())


def measured(hands: Iterable[HandTrack], surface: MovingSurface) -> Pair:
    """Measures of two hands with gaps filled, by a mesh of each hand's shape fitted to them."""
    places, depths, touching, skins = [], [], [], []
    for hand in hands:
        model, joints = load_hand(hand.side), filled_keypoints(hand)
        verts = fitted_verts(subject_of(hand, model), joints)
        distance = surface.query(verts).distance
        places.append(joints)
        depths.append(penetration_depth(distance))
        touching.append(tips_in_contact(distance, verts, joints[:, list(TIP_KEYPOINTS)]))
        skins.append(ChangingSurface(verts, model.faces))
    overlap = float(depth_between(*skins).max())
    return Pair(torch.stack(places), torch.stack(depths), torch.stack(touching), overlap)


def scores(found: Pair, truth: Pair) -> list[float]:
    """The rows of the table for two hands beside the true ones."""
    touching = contact_agreement(found.tips.flatten(0, 1), truth.tips.flatten(0, 1))
    return [
        1000 * float((found.joints - truth.joints).norm(dim=-1).mean()),
        1000 * float(found.depth.mean()),
        100 * float(touching.f_score),
        1000 * float(finite_difference(found.joints, 2).norm(dim=-1).mean()),
        1000 * found.overlap,
    ]


if __name__ == "__main__":
    main()
