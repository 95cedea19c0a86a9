"""The clips that a report on realism compares: recorded or synthetic right hands with meshes."""

from dataclasses import dataclass, fields, replace
from pathlib import Path

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import spread
from geneoh.errors import InputError
from geneoh.fitting.subject import subject_of
from geneoh.geometry.mesh import Mesh
from geneoh.hand.model import HandModel
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics.contact import TOUCH, in_contact, penetration_depth, tips_in_contact
from geneoh.representation.parameters import HandParameters
from geneoh.seeds import seeded_generator
from geneoh.sequence.normalisation import normalised_hands
from geneoh.sequence.sequence import Sequence
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.replay import replay_shard
from geneoh.synthesis.shards import find_shards
from geneoh.training import augmentation

FPS = 30.0
SHARDS, CLIPS_PER_SHARD = 8, 96
"""Number of training shards that are compared, spread over the folder, and of clips in each."""
MESH_EVERY = 10  # the mesh is measured in every tenth frame of synthetic clips, to save time
AT_OBJECT = 0.025
"""Largest distance in metres from the nearest keypoint to the object of a hand at the object. The
classifier gets only snippets with the hand at the object in all frames."""
TIPS = list(TIP_KEYPOINTS)


@dataclass(frozen=True)
class HandClips:
    """B clips of right hands from one source over T frames; the mesh is measured in N frames."""

    world: Float[Tensor, "B T 21 3"]  # keypoints in the world frame, metres
    object: Float[Tensor, "B T 21 3"]  # keypoints in the frame of the object's first part, metres
    valid: Bool[Tensor, "B T"]
    near: Bool[Tensor, "B T"]  # frames in which the hand is valid and at the object
    area: Float[Tensor, " N"]  # area of the mesh at most 5 mm from the object, square metres
    fingers: Float[Tensor, " N"]  # number of fingertips at most 5 mm from the object
    depth: Float[Tensor, " N"]  # penetration depth of the deepest vertex, metres
    touching: Bool[Tensor, " N"]  # whether any vertex is at most 5 mm from the object


@torch.no_grad()
def recorded_clip(sequence: Sequence, hand: HandModel) -> HandClips:
    """The recording's first hand as a right one at 30 frames a second, with the mesh of `hand`."""
    if not sequence.object.meshes:
        raise InputError(f"{sequence.source}: expected an object mesh, got none; pass --obj MESH")
    normalised = normalised_hands(sequence, FPS)[0]
    track, motion = normalised.track, normalised.object
    subject = subject_of(track, hand)
    state = subject.parameters()
    verts = subject.shaped.verts_from_rotations(state.rotations, state.wrist).verts[0]
    surface = motion.surface()
    joints, valid = subject.joints, track.observed
    if motion.valid is not None:
        valid = valid & motion.valid.all(1)
    distance = surface.query(verts).distance
    gap = surface.query(joints).distance.amin(-1)
    local = motion.seen_from(0, joints)
    return HandClips(
        world=joints[None],
        object=local[None],
        valid=valid[None],
        near=(valid & (gap < AT_OBJECT))[None],
        **mesh_measures(verts[valid], joints[valid][:, TIPS], distance[valid], hand.faces),
    )


def synthetic_clips(folder: Path, hand: HandModel, *, augmented: bool = False) -> HandClips:
    """The first clips of some training shards, which are spread over the folder."""
    paths = find_shards(folder, "train")
    at = spread(len(paths), min(SHARDS, len(paths))).tolist()
    found = [shard_clips(paths[i], hand, augmented) for i in at]
    names = [field.name for field in fields(HandClips)]
    return HandClips(*(torch.cat([getattr(clips, name) for clips in found]) for name in names))


@torch.no_grad()
def shard_clips(path: Path, hand: HandModel, augmented: bool) -> HandClips:
    """The first clips of one shard."""
    shard = replay_shard(path).take(slice(CLIPS_PER_SHARD), "B")
    if augmented:
        # The seed's name must not change, because published figures depend on it.
        generator = seeded_generator("lively", path.name)
        hands = HandParameters.of_pose(shard.clips.wrist, shard.clips.pose, shard.clips.offsets)
        hands = augmentation.augmented(hands, Draws(len(hands.wrist), generator))
        shard = replace(shard, clips=replace(shard.clips, wrist=hands.wrist, pose=hands.pose))
    world = shard.joints
    local = shard.in_object(world)
    every = torch.arange(world.shape[1]).expand(len(world), -1)
    gap = shard.distance(local, every).amin(-1)
    frames = every[:, ::MESH_EVERY]
    posed = shard.skin(frames)
    verts, tips = posed.verts.flatten(0, 1), posed.joints[:, :, TIPS].flatten(0, 1)
    distance = shard.distance(posed.verts, frames).flatten(0, 1)
    return HandClips(
        world=world,
        object=local,
        valid=torch.ones_like(gap, dtype=torch.bool),
        near=gap < AT_OBJECT,
        **mesh_measures(verts, tips, distance, hand.faces),
    )


def mesh_measures(
    verts: Float[Tensor, "N V 3"],
    tips: Float[Tensor, "N 5 3"],
    distance: Float[Tensor, "N V"],
    faces: Tensor,
) -> dict[str, Tensor]:
    """The fields of `HandClips` that are measured on posed meshes."""
    areas = torch.stack([vertex_areas(Mesh(each, faces)) for each in verts])
    return {
        "area": (areas * (distance <= TOUCH)).sum(-1),
        "fingers": tips_in_contact(distance, verts, tips).sum(-1).float(),
        "depth": penetration_depth(distance),
        "touching": in_contact(distance),
    }


def vertex_areas(mesh: Mesh) -> Float[Tensor, " V"]:
    """Area of each vertex in square metres: a third of the area of each adjacent face."""
    third = mesh.face_vectors().norm(dim=-1) / 6
    areas = torch.zeros_like(mesh.verts[:, 0])
    for corner in range(3):
        areas.index_add_(0, mesh.faces[:, corner], third)
    return areas
