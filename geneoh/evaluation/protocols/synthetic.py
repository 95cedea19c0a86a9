"""Clips of our own making: object families and seeds that no training saw, without any file.

Each clip is drawn when it is read, from its number alone: a hand of the embedded model, an object
of a held-out family as a mesh, 30 frames a second.
"""

from dataclasses import dataclass
from functools import lru_cache

import torch

from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.synthesis.grasps import synthesize_grasps
from geneoh.synthesis.motion import animate
from geneoh.synthesis.objects import draw_objects
from geneoh.synthesis.shards import SynthesisConfig, seed_of
from geneoh.synthesis.solids import PARTS
from geneoh.synthesis.surface import mesh_of

COUNT = 100
"""Clips in all."""
FPS = 30.0
ATTEMPTS = 8
"""Grasps tried at a time; more than half pass the checks."""


@dataclass(frozen=True)
class Drawn:
    """One clip by its number."""

    index: int
    frames: int

    @property
    def name(self) -> str:
        """Family of the object, and number."""
        return f"{self.family}_{self.index:05d}"

    @property
    def family(self) -> str:
        """The held-out families take turns."""
        families = SynthesisConfig().held_out
        return families[self.index % len(families)]

    def read(self) -> Sequence:
        """Draw the clip: the same at every call."""
        return draw_clip(self.family, self.index, self.frames)


def find(options: ProtocolOptions) -> list[Drawn]:
    """Every clip."""
    return [Drawn(index, options.frames) for index in range(COUNT)]


@lru_cache(maxsize=2)
def draw_clip(family: str, index: int, frames: int) -> Sequence:
    """An interaction with one object of a family, held by a right hand."""
    generator = torch.Generator().manual_seed(seed_of("evaluation", index))
    shape_std = SynthesisConfig().shape_std
    betas = shape_std * torch.randn(10, generator=generator)
    hand = load_hand("right").shaped(betas)
    while True:
        solids = draw_objects([family] * ATTEMPTS, generator=generator)
        offsets = hand.offsets.expand(ATTEMPTS, 20, 3)
        grasps = synthesize_grasps(solids, offsets, generator=generator)
        if bool(grasps.kept.any()):
            break
    # The checks are on spheres along the bones; the skin may be deeper in, so the best is taken.
    skin = hand.posed(grasps.pose, grasps.wrist).verts
    depth = -solids.signed_distance(skin).amin(-1)
    best = torch.where(grasps.kept, depth, torch.inf).argmin()[None]
    solid = solids.chosen(best)
    moved = animate(grasps.chosen(best), solid, frames, 1, generator=generator)
    pose, wrist = moved.pose[0], moved.wrist[0]
    track = HandTrack(
        side="right",
        valid=torch.ones(frames, dtype=torch.bool),
        joints=hand.joints_from_rotations(axis_angle_to_matrix(pose), wrist),
        pose=pose,
        wrist=wrist,
        betas=betas,
        hand_model="embedded",
    )
    parts = [solid.only(part) for part in range(PARTS if bool(solid.jointed) else 1)]
    rotation, translation = (
        pose[0, :, : len(parts)] for pose in (moved.rotation, moved.translation)
    )
    motion = ObjectTrack(tuple(mesh_of(part) for part in parts), rotation, translation)
    return Sequence((track,), motion, FPS, f"geneoh's synthetic clip {index}, {family}")
