"""Actions as sequences, which every other command of geneoh reads."""

import torch

from geneoh.choices import SIDES
from geneoh.geometry.mesh import Mesh
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.synthesis.actions import FPS, Actions


def sequence_of(actions: Actions, meshes: tuple[Mesh, ...], source: str = "") -> Sequence:
    """The first action as a sequence of its hands of the mean shape and its object.

    `meshes` are one for each part of the object, in the frame of `Actions`; with one mesh the
    joint is left out.
    """
    frames = slice(int(actions.length[0]))
    hands = tuple(
        HandTrack(
            side=side,
            valid=actions.valid[0, frames],
            pose=actions.pose[0, number, frames],
            wrist=actions.wrist[0, number, frames],
            betas=torch.zeros(10),
            hand_model="embedded",
        )
        for number, side in enumerate(SIDES)
        if bool(actions.hands[0, number])
    )
    rotation, translation = actions.part_poses()
    parts = slice(len(meshes))
    track = ObjectTrack(meshes, rotation[0, frames, parts], translation[0, frames, parts])
    return Sequence(hands, track, FPS, source)
