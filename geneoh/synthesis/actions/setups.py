"""Which hands act together on an object, how it stands on the table, and the possible verbs."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.mirror import mirror_points
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.language.vocabulary import words_of_name
from geneoh.synthesis.actions.action import VERBS
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.bimanual import HandPairs
from geneoh.synthesis.grasping.grasp_types import GRASP_TYPES
from geneoh.synthesis.grasping.grasps import Grasps
from geneoh.synthesis.motions.object_motion import HeldPart, ObjectMotionConfig
from geneoh.synthesis.shapes.solids import Solids

CONTAINERS = ("mug", "bottle", "bowl", "kettle", "wine_glass", "pan", "spray")
CONTAINER_WORDS = ("mug", "cup", "can", "bottle", "bowl", "cleanser", "skillet")
"""Last words of the names of scanned objects that things are poured from."""
LYING = ("hammer", "pen", "screwdriver", "capsule")
"""Families that are long along z and lie on the table; the others stand with z up."""
ANY_SIDE = ("box", "carton", "cylinder", "ellipsoid", "cluster", "ball")
"""Families that stand on any side."""
UPWARD = torch.cat([torch.eye(3), -torch.eye(3)])  # axes of an object's frame that may point up
_QUARTERS = torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 0], [0, 1, 0], [-1, 0, 0], [2, 0, 0]])
UPRIGHT = axis_angle_to_matrix(math.pi / 2 * _QUARTERS)
"""For each axis in `UPWARD` the rotation that turns it to +z."""
IMAGES = axis_angle_to_matrix(math.pi * torch.tensor([[0.0, 0, 0], [0, 0, 1], [0, 1, 0]]))
"""Rotations that, applied after a reflection at x = 0, make it one at x = 0, y = 0 or z = 0."""
RARE = {"pour": 3.0}  # sampling weight of verbs that few objects allow; all others have weight 1


@dataclass(frozen=True)
class SetupConfig:
    """Which hands act together, and when an object can stand below them."""

    image_share: float = 1.0
    """Of the single hands on an object with a plane of symmetry, the share that gets its own mirror
    image as second hand."""
    symmetric: float = 0.003  # largest distance of the mirrored surface from the surface, metres
    gap: float = 0.03  # least distance between keypoints of a hand and its image, metres
    under_table: float = 0.012
    """How far keypoints may be below the table in the grasp, metres: fingers reach under edges."""
    under_table_both: float = 0.035  # the same for two hands on one object
    parts: ObjectMotionConfig = field(
        default_factory=lambda: ObjectMotionConfig(touch=0.013, skin=0.006)
    )
    """Which part of an object counts as held, and how near the other part may come to the hand."""
    joint_travel: float = 0.03
    """Least travel of a joint that can be opened and closed, radians or metres."""
    both: float = 0.7
    """Of the pairs of hands on one object, the share that moves it together; in the other pairs the
    first hand passes it to the second."""


@dataclass(frozen=True)
class ActionSetup(Bundle):
    """N possible actions of H hands: one or two hands on an object that stands on a table."""

    first: Int[Tensor, " N"]  # index of the hand that holds the object, as a right hand
    second: Int[Tensor, " N"]  # index of the other, a right hand on the mirrored object; or -1
    image: Float[Tensor, "N 3 3"]
    """Rotation of the second hand after its reflection at x = 0, one of `IMAGES`."""
    standing: Float[Tensor, "N 3 3"]  # rotation from the object's own frame to the upright one
    possible: Bool[Tensor, "N V"]  # which of `VERBS` can be done

    @property
    def paired(self) -> Bool[Tensor, " N"]:
        """Whether there are two hands."""
        return self.second >= 0


def draw_setups(
    grasps: Grasps,
    joints: Float[Tensor, "H 21 3"],
    surface: Float[Tensor, "H P 3"],
    families: list[str],
    pairs: HandPairs,
    held: HeldPart,
    solids: Solids,
    config: SetupConfig,
    generator: torch.Generator,
) -> ActionSetup:
    """Setups whose object can stand on a table below the hands, and that allow a verb."""
    first, second, image = _second_hands(joints, surface, pairs, solids, config, generator)
    mirrored = mirror_points(joints[second]) @ image.mT
    other = torch.where((second >= 0)[:, None, None], mirrored, joints[first])
    keypoints = torch.cat([joints[first], other], 1)
    room = (keypoints @ UPWARD.mT).amin(1) - (surface[first] @ UPWARD.mT).amin(1)
    under = torch.where(second >= 0, config.under_table_both, config.under_table)
    stands = [_may_stand(families[i]) for i in first.tolist()]
    stands = torch.tensor(stands, dtype=torch.bool).reshape(-1, len(UPWARD))
    stands = stands & (room > -under[:, None])
    draws = Draws(len(first), generator)
    side = torch.where(stands, draws.share(len(UPWARD)), -1.0).argmax(1)
    around = axis_angle_to_matrix(2 * math.pi * draws.share(1) * torch.eye(3)[2])
    possible = _possible(first, second >= 0, grasps, held, families, config, draws)
    setup = ActionSetup(first, second, image, around @ UPRIGHT[side], possible)
    return setup.take(stands.any(1) & possible.any(1), "N")


def _second_hands(
    joints: Float[Tensor, "H 21 3"],
    surface: Float[Tensor, "H P 3"],
    pairs: HandPairs,
    solids: Solids,
    config: SetupConfig,
    generator: torch.Generator,
) -> tuple[Int[Tensor, " N"], Int[Tensor, " N"], Float[Tensor, "N 3 3"]]:
    """First hands, second hands (-1 for none), and the `ActionSetup.image` of the latter.

    A second hand has a grasp of its own or, on a symmetric object, is the mirror image of the first
    hand.
    """
    first = torch.nonzero(~pairs.second)[:, 0]
    second = torch.full((len(joints),), -1)
    second[pairs.first[pairs.second]] = torch.nonzero(pairs.second)[:, 0]
    second, choice = second[first], torch.zeros_like(first)
    draws = Draws(len(first), generator)
    wanted = draws.chance(config.image_share) & (second < 0)
    objects, hand = solids.take(first, "B"), joints[first]
    for index, turn in enumerate(IMAGES):
        image = mirror_points(surface[first][:, ::8]) @ turn.mT
        alike = objects.signed_distance(image).abs().amax(1) < config.symmetric
        gap = torch.cdist(hand, mirror_points(hand) @ turn.mT).amin((1, 2))
        found = wanted & alike & (gap > config.gap)
        second, choice = torch.where(found, first, second), torch.where(found, index, choice)
        wanted = wanted & ~found
    return first, second, IMAGES[choice]


def stands_upright(family: str) -> bool:
    """Whether objects of this family or scan stand with the z axis of their frame up."""
    return family not in ANY_SIDE and family not in LYING


def _may_stand(family: str) -> list[bool]:
    """Which axes of an object's frame may point up when it stands on a table, as in `UPWARD`."""
    if family in ANY_SIDE:
        return [True] * 6
    lies = family in LYING
    return [lies, lies, not lies, lies, lies, False]


def _possible(
    first: Int[Tensor, " N"],
    paired: Bool[Tensor, " N"],
    grasps: Grasps,
    held: HeldPart,
    families: list[str],
    config: SetupConfig,
    draws: Draws,
) -> Bool[Tensor, "N V"]:
    """Which verbs each first hand can do with its object, together with its second hand if any.

    A flat hand on top presses; a hand on the part that a joint moves opens and closes it; what two
    hands hold is passed or moved by both.
    """
    flat = grasps.types[first] == [each.name for each in GRASP_TYPES].index("support")
    travel = (held.travel[first, 1] - held.travel[first, 0]).abs()
    opens = (held.index[first] == 1) & (travel > config.joint_travel) & ~paired
    holds = torch.tensor([is_container(families[i]) for i in first.tolist()], dtype=torch.bool)
    together = draws.chance(config.both)
    moves = ~flat & ~opens & (~paired | together)
    able = {"press": flat & ~paired, "open": opens, "close": opens}
    able |= {"pour": moves & holds, "pass": paired & ~together & ~flat}
    return torch.stack([able.get(verb, moves) for verb in VERBS], 1)


def is_container(family: str) -> bool:
    """Whether something may be poured from an object of this family or scan."""
    *_, last = "", *words_of_name(Path(family).stem.replace(" ", "_"))
    return family in CONTAINERS or last.rstrip("s") in CONTAINER_WORDS


def draw_verb(possible: Bool[Tensor, "N V"], draws: Draws) -> Int[Tensor, " N"]:
    """A random possible verb for each setup, weighted by `RARE`."""
    weight = possible * torch.tensor([RARE.get(name, 1.0) for name in VERBS])
    return (weight / -draws.share(len(VERBS)).clamp(min=1e-9).log()).argmax(1)
