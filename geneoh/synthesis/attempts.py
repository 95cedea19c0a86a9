"""One shard of synthetic interactions: attempts at grasps, and clips from the successful ones."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Int, Shaped
from torch import Tensor

from geneoh.bundle import Bundle, concatenated
from geneoh.geometry.openings import edges_of
from geneoh.geometry.thin_walls import goes_through
from geneoh.hand.library import load_hand
from geneoh.hand.model import ShapedHand
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.grasping.bimanual import bimanual_objects, grasp_directions, pair_hands
from geneoh.synthesis.grasping.grasps import Grasps, shifted_grips, synthesize_grasps
from geneoh.synthesis.motions.motion import Interactions, animate
from geneoh.synthesis.shapes.families import FAMILIES
from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.synthesis.shapes.scans import Scans
from geneoh.synthesis.shapes.solids import Solids


@dataclass(frozen=True)
class Attempts(Bundle):
    """Pairs of a hand and an object for which a grasp is searched; none is rejected yet."""

    families: Shaped[np.ndarray, " B"]  # names of families or scanned objects
    solids: Solids
    hands: ShapedHand  # `offsets` have bone lengths that are unique to each hand
    shared: Int[Tensor, " C"]
    """The last C of all attempts are second hands: index of each one's first."""


def draw_attempts(
    config: SynthesisConfig,
    families: list[str],
    missing: int,
    *,
    generator: torch.Generator,
    scans: Scans | None = None,
) -> Attempts:
    """First hands on objects of the families, then second hands on some of the objects."""
    count = 2 * missing + 4  # more than half fail, but second hands are added
    named = draw_names(families, count, config.scanned, generator=generator)
    alone = draw_objects(named, generator=generator, scans=scans)
    shared = bimanual_objects(alone, count, config.bimanual)
    mirrored = alone.take(shared, "B").mirrored()
    solids = concatenated([alone, mirrored], "B")
    betas = config.shape_std * torch.randn(count, 10, generator=generator)
    stretch = 1 + config.bone_std * torch.randn(count, 20, 1, generator=generator)
    differ = torch.randn(len(shared), 20, 1, generator=generator)
    stretch = torch.cat([stretch, stretch[shared] * (1 + config.bimanual.bone_std * differ)])
    hands = load_hand("right").shaped(torch.cat([betas, betas[shared]]))
    named += [named[i] for i in shared.tolist()]
    return Attempts(
        np.array(named), solids, replace(hands, offsets=hands.offsets * stretch), shared
    )


def draw_names(
    families: list[str], count: int, scanned_share: float, *, generator: torch.Generator
) -> list[str]:
    """Random object names: a scanned object with probability `scanned_share`, else a family."""

    def drawn(names: list[str]) -> list[str]:
        return [names[i] for i in torch.randint(len(names), (count,), generator=generator)]

    named = drawn([name for name in families if name in FAMILIES])
    if scanned := [name for name in families if name not in FAMILIES]:
        take = torch.rand(count, generator=generator) < scanned_share
        named = [b if t else a for a, b, t in zip(named, drawn(scanned), take, strict=True)]
    return named


def synthesize_shard(
    config: SynthesisConfig,
    families: list[str],
    *,
    generator: torch.Generator,
    scans: Scans | None = None,
) -> Interactions:
    """Interactions of the given families that passed the grasp checks, `config.shard` of them."""
    kept: list[Interactions] = []
    while (missing := config.shard - sum(len(part.wrist) for part in kept)) > 0:
        tried = draw_attempts(config, families, missing, generator=generator, scans=scans)
        kept.append(interactions_of(tried, config, generator=generator))
    return concatenated(kept, "B").take(slice(config.shard), "B")


def interactions_of(
    tried: Attempts, config: SynthesisConfig, *, generator: torch.Generator
) -> Interactions:
    """Clips of the attempts whose grasp is kept."""
    grasps = tried_grasps(tried, config, grasp_directions(tried.solids, tried.shared), generator)
    kept, solids = grasps.take(grasps.kept, "B"), tried.solids.take(grasps.kept, "B")
    return animate(
        kept,
        solids,
        config.frames,
        config.points,
        config.animation,
        generator=generator,
        pairs=pair_hands(grasps, tried.shared, config.bimanual),
        grips=shifted_grips(solids, kept, config.grasps, generator=generator),
    )


def tried_grasps(
    tried: Attempts,
    config: SynthesisConfig,
    toward: Float[Tensor, "B 3"],
    generator: torch.Generator,
) -> Grasps:
    """A grasp of every attempt. `kept` also excludes grasps whose skin penetrates too deep or
    passes through a thin wall, where penetration depth stays small."""
    solids, offsets = tried.solids, tried.hands.offsets
    grasps = synthesize_grasps(solids, offsets, config.grasps, generator=generator, toward=toward)
    skin = tried.hands.posed(grasps.pose, grasps.wrist).verts
    distance, normal = solids.distance_and_normal(skin)
    shallow = -distance.amin(-1) < config.grasps.checks.depth + config.grasps.checks.skin
    through = goes_through(skin, distance, normal, edges_of(tried.hands.model.faces))
    return replace(grasps, kept=grasps.kept & shallow & ~through)
