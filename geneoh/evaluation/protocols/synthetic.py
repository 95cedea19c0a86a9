"""Clips of our own making: object families and seeds that no training saw, without any file.

Each clip is drawn when it is read, from its number alone: a hand of the embedded model, an object
of a held-out family as a mesh, 30 frames a second.
"""

from dataclasses import dataclass, fields
from functools import lru_cache

import igl
import numpy as np
import torch

from geneoh.evaluation.protocols.options import ProtocolOptions
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.sequence.tracks import HandTrack, ObjectTrack, Sequence
from geneoh.synthesis.grasps import Grasps, synthesize_grasps
from geneoh.synthesis.motion import animate
from geneoh.synthesis.objects import FAR, TORUS, Solids, draw_objects
from geneoh.synthesis.shards import SynthesisConfig, seed_of

COUNT = 100
"""Clips in all."""
FPS = 30.0
ATTEMPTS = 8
"""Grasps tried at a time; more than half pass the checks."""
SPACING = 0.002
"""Metres between the grid points on which an object is turned into a mesh; the thinnest part of the
held-out families is 6 mm thick."""
MARGIN = 0.005
"""Metres of grid around an object."""


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
    solid = Solids(*(getattr(solids, f.name)[best] for f in fields(Solids)))
    grasp = Grasps(*(getattr(grasps, f.name)[best] for f in fields(Grasps)))
    moved = animate(grasp, solid, frames, 1, generator=generator)
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
    rotation, translation = moved.rotation[0, :, None], moved.translation[0, :, None]
    motion = ObjectTrack((mesh_of(solid),), rotation, translation)
    return Sequence((track,), motion, FPS, f"geneoh's synthetic clip {index}, {family}")


def mesh_of(solid: Solids) -> Mesh:
    """The surface of one object as a closed mesh, by marching cubes on its distance.

    Vertices are slid onto the surface afterwards, so that only edges are rounded, by the spacing.
    """
    centre, size = solid.center[0], solid.size[0]
    ring = solid.kind[0] == TORUS
    reach = torch.where(ring, size[:, :2].sum(-1), size.norm(dim=-1))[:, None] + MARGIN
    used = centre[:, 0] < FAR / 2
    low, high = (centre - reach)[used].amin(0), (centre + reach)[used].amax(0)
    ends = zip(low.tolist(), (high + SPACING).tolist(), strict=True)
    across, along, up = (torch.arange(a, b, SPACING) for a, b in ends)
    # libigl counts x fastest
    z, y, x = torch.meshgrid(up, along, across, indexing="ij")
    grid = torch.stack([x, y, z], -1).reshape(-1, 3)
    distance = solid.signed_distance(grid[None])[0].double().numpy()
    sizes = len(across), len(along), len(up)
    verts, faces, _ = igl.marching_cubes(distance, grid.double().numpy(), *sizes)
    points = torch.from_numpy(np.ascontiguousarray(verts)).float()
    off, normal = solid.distance_and_normal(points[None])
    points = points - (off[..., None] * normal)[0]
    return Mesh(points, torch.from_numpy(np.ascontiguousarray(faces)).long())
