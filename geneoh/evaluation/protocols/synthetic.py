"""Synthetic test clips, which need no file: interactions with object families not trained on.

Each clip is generated when it is read, seeded by its number: a hand of the embedded model and a
mesh of a held-out family, at 30 frames a second.
"""

from functools import lru_cache, partial
from itertools import cycle, islice

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.evaluation.options import ProtocolOptions
from geneoh.evaluation.protocols.clips import Clip
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.model import ShapedHand
from geneoh.seeds import seeded_generator
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.grasping.grasps import Grasps, synthesize_grasps
from geneoh.synthesis.motions.motion import Interactions, animate
from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.synthesis.shapes.scans import Scans
from geneoh.synthesis.shapes.solids import PARTS, Solids
from geneoh.synthesis.shapes.surface import mesh_of_solid

COUNT = 100  # number of clips
FPS = 30.0
ATTEMPTS = 8  # grasps that are synthesized at a time; more than half pass the checks


def find(options: ProtocolOptions) -> list[Clip]:
    """All clips, named by object family and number; they cycle through the held-out families."""
    names = list(islice(cycle(SynthesisConfig().held_out), COUNT))
    return [
        Clip(f"{family}_{index:05d}", partial(draw_clip, family, index, options.frames))
        for index, family in enumerate(names)
    ]


@lru_cache(maxsize=2)
def draw_clip(family: str, index: int, frames: int, scans: Scans | None = None) -> Sequence:
    """A right hand with one object of a family or scan; deterministic in the arguments."""
    generator = seeded_generator("evaluation", index)
    betas = SynthesisConfig().shape_std * torch.randn(10, generator=generator)
    hand = load_hand("right").shaped(betas)
    grasp, solid = draw_grasp(hand, family, scans, generator=generator)
    moved = animate(grasp, solid, frames, 1, generator=generator)
    track, motion = right_hand(moved, 0, hand, betas), moving_object(moved, 0, solid)
    return Sequence((track,), motion, FPS, f"geneoh's synthetic clip {index}, {family}")


def right_hand(
    clips: Interactions, number: int, hand: ShapedHand, betas: Float[Tensor, " S"]
) -> HandTrack:
    """The hand track of clip `number`; `hand` is the embedded model with the shape `betas`."""
    pose, wrist = clips.pose[number], clips.wrist[number]
    joints = hand.joints_from_rotations(axis_angle_to_matrix(pose), wrist)
    known = {"joints": joints, "pose": pose, "wrist": wrist, "betas": betas}
    valid = torch.ones(len(pose), dtype=torch.bool)
    return HandTrack("right", valid, **known, hand_model="embedded")


def moving_object(clips: Interactions, number: int, solid: Solids) -> ObjectTrack:
    """The object track of clip `number`; `solid` holds only its object."""
    parts = PARTS if bool(solid.jointed) else 1
    meshes = tuple(mesh_of_solid(solid.only(part)) for part in range(parts))
    rotation, translation = clips.rotation[number], clips.translation[number]
    return ObjectTrack(meshes, rotation[:, :parts], translation[:, :parts])


def draw_grasp(
    hand: ShapedHand, family: str, scans: Scans | None = None, *, generator: torch.Generator
) -> tuple[Grasps, Solids]:
    """One grasp that passes the checks of synthesis, and its object.

    The checks use spheres along the bones, and the mesh may penetrate deeper. Of the grasps that
    pass, the one whose mesh has the smallest penetration depth is returned.
    """
    while True:
        solids = draw_objects([family] * ATTEMPTS, generator=generator, scans=scans)
        offsets = hand.offsets.expand(ATTEMPTS, 20, 3)
        grasps = synthesize_grasps(solids, offsets, generator=generator)
        if bool(grasps.kept.any()):
            break
    verts = hand.posed(grasps.pose, grasps.wrist).verts
    depth = -solids.signed_distance(verts).amin(-1)
    best = torch.where(grasps.kept, depth, torch.inf).argmin()[None]
    return grasps.take(best, "B"), solids.take(best, "B")
