"""Actions as sequences, which every other command of geneoh reads."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import SIDES
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.synthesis.actions import FPS, Actions


def sequence_of(
    actions: Actions, index: int, meshes: tuple[Mesh, ...], source: str = ""
) -> Sequence:
    """One action as a sequence of its hands of the mean shape and its object.

    `meshes` are one for each part of the object, in the frame of `Actions`; with one mesh the
    joint is left out.
    """
    one = actions.take(slice(index, index + 1), "B")
    frames = slice(int(one.length[0]))
    hands = tuple(
        HandTrack(
            side=side,
            valid=torch.ones(int(one.length[0]), dtype=torch.bool),
            pose=one.pose[0, number, frames],
            wrist=one.wrist[0, number, frames],
            betas=torch.zeros(10),
            hand_model="embedded",
        )
        for number, side in enumerate(SIDES)
        if bool(one.hands[0, number])
    )
    rotation, translation = part_poses(one)
    parts = slice(len(meshes))
    track = ObjectTrack(meshes, rotation[0, frames, parts], translation[0, frames, parts])
    return Sequence(hands, track, FPS, source)


def part_poses(actions: Actions) -> tuple[Float[Tensor, "B T 2 3 3"], Float[Tensor, "B T 2 3"]]:
    """Rotation and translation of both parts, object to world; those of a rigid one are alike."""
    along = actions.joint[..., None] * actions.axis[:, None]
    slides = actions.slides[:, None, None]
    turn = axis_angle_to_matrix(torch.where(slides, 0.0, along))
    pivot = actions.pivot[:, None]
    shift = torch.where(slides, along, pivot - (turn @ pivot[..., None])[..., 0])
    rotation, translation = actions.rotation, actions.translation
    moved = (rotation @ shift[..., None])[..., 0] + translation
    return (
        torch.stack([rotation, rotation @ turn], 2),
        torch.stack([translation, moved], 2),
    )
