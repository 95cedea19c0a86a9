"""Hands brought to the surface they hold: penetration and gaps that a network leaves are undone.

Ours. The pose in the middle of a hold descends the energy by which the training data were grasped
(`geneoh.synthesis.grasps`), and the change goes to the whole hold, and fades out on the ways to it
and from it.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.choices import SIDES
from geneoh.generators.text2hoi.resting import touching_hands
from geneoh.generators.text2hoi.standing import StandingObject
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.library import load_hand
from geneoh.synthesis.actions import Actions
from geneoh.synthesis.grasps import GraspConfig, GraspEnergy, Grasps, settled_grasps
from geneoh.synthesis.objects import scanned_object
from geneoh.synthesis.scans import MeshFolder, build_scans
from geneoh.synthesis.schedule import minimum_jerk
from geneoh.synthesis.solids import Solids

REACH = 0.012
"""Distance from the surface within which a pad of the hand is brought to it, metres."""
FADE = 10.0  # frames over which the change fades out
SETTLING = GraspConfig(
    steps=80,
    wrist_rate=0.003,
    angle_rate=0.02,
    energy=GraspEnergy(liked=0.5),  # fingers stay nearer to how they were drawn
)


def solid_of(stood: StandingObject) -> tuple[Solids, Float[Tensor, " 3"]]:
    """The standing object as a grid of signed distance, and the middle that it is around.

    Raises:
        InputError: the mesh encloses nothing.
    """
    verts = stood.mesh.verts @ stood.rotation.T + stood.shift
    middle = (verts.amin(0) + verts.amax(0)) / 2
    name = "the mesh" if stood.mesh.source is None else str(stood.mesh.source)
    found = MeshFolder((name,), (), "", (Mesh(verts - middle, stood.mesh.faces),))
    return scanned_object(build_scans(found)), middle


def settled(actions: Actions, stood: StandingObject, config: GraspConfig = SETTLING) -> Actions:
    """The first action with hands that touch their object and do not sink into it."""
    solids, middle = solid_of(stood)
    for number, side in enumerate(SIDES):
        touching = touching_hands(actions)[0, number]
        if bool(touching.any()):
            mirrored = side == "left"
            own = solids.mirrored() if mirrored else solids
            actions = _settled_hand(actions, number, touching, own, middle, mirrored, config)
    return actions


def _settled_hand(
    actions: Actions,
    number: int,
    touching: Bool[Tensor, " T"],
    solids: Solids,
    middle: Float[Tensor, " 3"],
    mirrored: bool,
    config: GraspConfig,
) -> Actions:
    """One hand of the first action settled, as a right hand on the mirror image if it is left."""
    frames = torch.nonzero(touching)[:, 0]
    turn = actions.rotation[0].mT @ axis_angle_to_matrix(actions.pose[0, number, :, 0])
    apart = actions.wrist[0, number] - actions.translation[0]
    wrist = (actions.rotation[0].mT @ apart[..., None])[..., 0] - middle
    pose = torch.cat([matrix_to_axis_angle(turn)[:, None], actions.pose[0, number, :, 1:]], 1)
    if mirrored:
        wrist, pose = mirror_points(wrist), mirror_axis_angle(pose)
    held = frames[len(frames) // 2]
    grasp = Grasps(
        pose=pose[held][None],
        wrist=wrist[held][None],
        offsets=load_hand("right").shaped(torch.zeros(1, 10)).offsets,
        kept=torch.ones(1, dtype=torch.bool),
        types=torch.zeros(1, dtype=torch.long),
    )
    after = settled_grasps(solids, grasp, config, reach=REACH)
    share = _fading(touching)[:, None]
    bend = axis_angle_to_matrix(after.pose[0, 0]) @ axis_angle_to_matrix(pose[held, 0]).mT
    turned = axis_angle_to_matrix(share * matrix_to_axis_angle(bend))
    wrist = wrist + share * (after.wrist[0] - wrist[held])
    fingers = pose[:, 1:] + share[..., None] * (after.pose[0, 1:] - pose[held, 1:])
    turn = matrix_to_axis_angle(turned @ axis_angle_to_matrix(pose[:, 0]))
    pose = torch.cat([turn[:, None], fingers], 1)
    if mirrored:
        wrist, pose = mirror_points(wrist), mirror_axis_angle(pose)
    world = actions.rotation[0] @ axis_angle_to_matrix(pose[:, 0])
    place = (actions.rotation[0] @ (wrist + middle)[..., None])[..., 0] + actions.translation[0]
    poses, wrists = actions.pose.clone(), actions.wrist.clone()
    poses[0, number] = torch.cat([matrix_to_axis_angle(world)[:, None], pose[:, 1:]], 1)
    wrists[0, number] = place
    return replace(actions, pose=poses, wrist=wrists)


def _fading(touching: Bool[Tensor, " T"]) -> Float[Tensor, " T"]:
    """1 from the first to the last frame in which a hand touches, falling to 0 beside them."""
    frames = torch.nonzero(touching)[:, 0]
    time = torch.arange(len(touching), dtype=torch.float32)
    off = torch.maximum(frames[0] - time, time - frames[-1]).clamp(min=0)
    return 1 - minimum_jerk(off / FADE)
