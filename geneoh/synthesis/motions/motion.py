"""From grasps to interactions at 30 frames a second: reach, hold, carry, let go, leave.

Some clips have more: a table, an object joint that the hand moves, a second hand, or a regrasp (a
moment in which the hand opens and grasps again).
"""

from dataclasses import dataclass, field

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.representation.region import ObjectSurface
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.grasping.bimanual import HandPairs
from geneoh.synthesis.grasping.grasps import Grasps, Grips
from geneoh.synthesis.motions.clearance import ClearanceConfig, MovingSolids, clear_ways
from geneoh.synthesis.motions.hand_motion import HandMotionConfig, HandPath, hand_ways
from geneoh.synthesis.motions.object_motion import (
    ObjectMotionConfig,
    ScheduleConfig,
    carry,
    draw_schedule,
    draw_standing,
    held_part,
)
from geneoh.synthesis.shapes.solids import Solids


@dataclass(frozen=True)
class AnimationConfig:
    """Settings of all motion in a clip."""

    schedule: ScheduleConfig = field(default_factory=ScheduleConfig)
    object: ObjectMotionConfig = field(default_factory=ObjectMotionConfig)
    hand: HandMotionConfig = field(default_factory=HandMotionConfig)
    clearance: ClearanceConfig = field(default_factory=ClearanceConfig)


@dataclass(frozen=True)
class Interactions(ObjectSurface):
    """B right-hand interactions of T frames in the world frame, with their skeletons.

    Every object has two parts; those of a rigid object have the same pose.
    """

    pose: Float[Tensor, "B T 16 3"]
    wrist: Float[Tensor, "B T 3"]
    offsets: Float[Tensor, "B 20 3"]
    scan: Int[Tensor, " B"]  # number of the scanned object that is held; negative for a family


def animate(
    grasps: Grasps,
    solids: Solids,
    frames: int,
    points: int,
    config: AnimationConfig | None = None,
    *,
    generator: torch.Generator,
    pairs: HandPairs | None = None,
    grips: Grips | None = None,
) -> Interactions:
    """One interaction of `frames` frames per grasp, with `points` surface points of the object.

    The hand approaches from a random place, and leaves to another, with open fingers; in between it
    keeps its grasp in the frame of the part that it holds, or moves through `grips`. Without
    `pairs` no clip is of a second hand.
    """
    config = config or AnimationConfig()
    pairs = pairs or HandPairs.none(len(grasps.pose))
    draws = Draws(len(grasps.pose), generator)
    surface, normals = solids.surface_points(points, generator=generator)
    joints, _ = grasps.posed()
    standing = draw_standing(joints, surface, pairs.shared, config.object, draws)
    held = held_part(solids, joints, config.object)
    schedule = draw_schedule(frames, pairs, config.schedule, draws)
    rotation, translation = carry(solids, held, standing, schedule, pairs, config.object, draws)
    free = ~pairs.shared
    in_object = hand_ways(grasps, standing, schedule, config.hand, draws, grips=grips, free=free)

    def drawn(clips: Int[Tensor, " C"]) -> HandPath:
        """Motions of the hands of some clips in the world frame."""
        part = held.index[clips]
        return in_object(clips).moved(rotation[clips, :, part], translation[clips, :, part])

    moving = MovingSolids(solids, rotation, translation)
    hand = clear_ways(drawn, moving, grasps.offsets, config.clearance)
    return Interactions(
        pose=hand.pose,
        wrist=hand.wrist,
        offsets=grasps.offsets,
        rotation=rotation,
        translation=translation,
        points=surface,
        normals=normals,
        part=solids.nearest_part(surface) * solids.jointed[:, None],
        scan=solids.scan.clamp(min=-1),
    )
